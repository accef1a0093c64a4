"""The robot interface: it starts a robot from its configuration, supervises the run, and shuts it down in order.

``read_robot`` creates a ``Robot`` from XML files, ``RobotInterface`` opens its devices and runs its phases,
``open_service`` opens the RPC port, and ``draw_text`` and ``draw_svg`` show the plan.
"""
