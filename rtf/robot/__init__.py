"""The robot: what a device can do, in the words of the iCub, and the stubs that carry it through the network.

``interfaces`` says what can be asked of a device, ``devices`` are drivers, ``server`` puts a device on the network and
``client`` is the device at the other end, ``interface`` starts a robot from its configuration.
"""
