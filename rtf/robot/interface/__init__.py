"""The robot interface: starts a robot from its configuration, watches over what it does, and ends it in order.

``read_robot`` makes a ``Robot`` of XML files, ``RobotInterface`` opens its devices and goes through its phases,
``open_service`` answers questions about it, and ``draw_text`` and ``draw_svg`` show what would be done.
"""
