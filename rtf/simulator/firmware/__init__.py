"""Emulated boards on CAN buses: firmware that drives the motors of the simulated robot and reads its encoders.

A board knows its bus and its own axes, nothing else: what talks to it can be a driver of ours, in this process or
another one, or any other program that speaks the protocol of :mod:`rtf.robot.devices.can`.
"""
