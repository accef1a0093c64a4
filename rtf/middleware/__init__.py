"""The core: ports that speak YARP's wire protocol, the names by which they are found, and what travels between them."""
