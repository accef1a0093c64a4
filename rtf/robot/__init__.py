"""Robot devices: their interfaces in the terms of the iCub, drivers, and network servers and clients.

``interfaces`` are the abstract classes of devices, and ``devices`` the drivers. ``boards`` and ``sensors`` are servers,
which put a device on the network, and clients, which are a device that is served elsewhere. They use the protocols in
``yarp3`` and ``yarp4``, and ``network``, which has the ports that are the same in both. ``model`` is a robot as data,
and ``interface`` starts a robot from its configuration.
"""
