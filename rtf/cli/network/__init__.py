"""The commands for a network of ports, under the names that they have in YARP's own tool."""
