"""Control boards on the network, of either version of YARP: server, client, and a remapper of clients."""
