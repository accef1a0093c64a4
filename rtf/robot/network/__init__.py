"""The ports of devices that are the same in YARP 3 and YARP 4: streams, their servers and clients, connections."""
