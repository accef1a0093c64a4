"""Kinematics: chains of a robot as data, forward and inverse.

A :class:`Chain` comes from tables (:func:`robot_chains`), or from the robot's description (:func:`described_chain`),
for which the package of the physics engine is needed. :class:`InverseKinematics` finds the posture of a chain that has
a pose. It needs the package daqp (``pip install 'rtf[kinematics]'``). :class:`Eyes` and :class:`Pinhole` say where two
eyes look, and what they see.
"""

from rtf.robot.kinematics.chain import Chain, LinearConstraint, Link
from rtf.robot.kinematics.described import described_chain
from rtf.robot.kinematics.eyes import Eyes
from rtf.robot.kinematics.goals import LookAt
from rtf.robot.kinematics.inverse import InverseKinematics, PointPreference, Priority, Solution
from rtf.robot.kinematics.pinhole import Pinhole, triangulated
from rtf.robot.kinematics.poses import axis_angle_of, pose_error, pose_of, rotation_of, vector_of
from rtf.robot.kinematics.tables import ChainTables, robot_chains

__all__ = [
    "Chain",
    "ChainTables",
    "Eyes",
    "InverseKinematics",
    "LinearConstraint",
    "Link",
    "LookAt",
    "Pinhole",
    "PointPreference",
    "Priority",
    "Solution",
    "axis_angle_of",
    "described_chain",
    "pose_error",
    "pose_of",
    "robot_chains",
    "rotation_of",
    "triangulated",
    "vector_of",
]
