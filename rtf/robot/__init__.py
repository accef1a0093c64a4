"""Robot devices: their interfaces in the terms of the iCub, drivers, and network servers and clients.

``interfaces`` are the abstract classes of devices, ``devices`` the drivers, ``server`` puts a device on the network,
``client`` is a device that is served elsewhere, and ``interface`` starts a robot from its configuration.
"""
