"""Drivers: devices that are the robot, or make several of them one."""
