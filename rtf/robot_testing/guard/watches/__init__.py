"""Watches of joints that press: each is one function of (state, bounds), in a file of its own.

A watch returns how fast each joint uses up the time that it may spend in a condition, in 1/s: a third of the time after
0.1 s with 3.3/s. Zero or less gives time back. :class:`~rtf.robot_testing.guard.watches.joint_watch.JointWatch` adds
up; a joint whose time is used up violates the watch.
"""
