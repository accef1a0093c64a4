"""The CAN buses of the iCub: their messages, and drivers of the boards on them.

``messages``, ``codes``, ``motor_messages``, ``sensor_messages`` and ``codec`` are the protocol on bytes, for a driver
and an emulated board alike: no bus, no thread, no clock, and nothing of python-can.
"""
