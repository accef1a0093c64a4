"""Sensors on the network, one file for each type: its server and its client, with the devices of both."""
