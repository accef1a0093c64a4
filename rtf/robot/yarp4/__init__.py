"""Control boards and cameras of YARP 4, whose requests are functions of a service: ``positionMoveOneRPC 3 20.5``.

Newer sensors, such as batteries, have such a service in YARP 3.12, too.
"""
