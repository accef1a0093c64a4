"""The commands for a network of ports, under the words that YARP's own tool has for them."""
