"""Ports that speak YARP's wire protocol, the registration of their names, and the types of their messages."""
