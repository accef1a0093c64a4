"""The 53 axes of the simulated iCub: limits, motors, gears and motor couplings, in YARP's order.

All arrays of the simulator with one column for each axis (actuators of the model, boards, ports) are in the order of
:data:`AXES`: the parts as the robot lists them, and in each part the joints as its control board numbers them.

Sources. Limits of the body: the published robot description (iCubGazeboV2_5). Limits of eyes and hands, gearboxes,
encoders, currents and couplings: the published configuration of a version 2.5 robot. Torques of the legs: the robot
description. The other torques, the armatures, frictions and dampings are nominal: plausible for motors behind 100:1
gears, not identified on a robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Resolution of the joint encoders: counts a turn.
ENCODER_TICKS_PER_DEGREE = 182.044
#: The same value as in the simulation of the robot on Gazebo.
BODY_VELOCITY = 100.0
FINGER_VELOCITY = 200.0


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis as a control board sees it. Angles are those of the axis, after the gearbox, in degrees."""

    part: str
    name: str
    minimum: float  # deg, within the mechanical range
    maximum: float
    max_velocity: float  # deg/s
    max_torque: float  # Nm, the greatest torque of the drive
    gearbox: float  # turns of the motor a turn of the axis; negative where the motor is mounted the other way round
    encoder_resolution: float  # ticks/deg of the joint encoder
    rotor_resolution: float  # ticks a turn of the motor encoder
    armature: float  # kg m2, the rotor's inertia seen from the axis
    friction: float  # Nm, dry
    damping: float  # Nm s/rad
    home: float  # deg, a pose in which nothing touches
    nominal_current: float  # A
    peak_current: float  # A
    overload_current: float  # A, beyond which the drive switches off


@dataclass(frozen=True, slots=True)
class _Drive:
    """Type of a motor, with its encoder and its currents."""

    rotor_resolution: float
    nominal: float
    peak: float
    overload: float


_LEG = _Drive(14400, 5.0, 10.0, 15.0)  # brushless, on two-axis boards, with an optical encoder on the rotor
_ARM = _Drive(14400, 4.0, 5.0, 15.0)
_NECK = _Drive(2048, 1.5, 4.0, 6.0)  # brushed, with an encoder of four edges a line
_HAND = _Drive(40, 0.6, 1.0, 2.0)

#: Dry friction as a share of the torque of the drive.
_FRICTION_SHARE = 0.02


def _axis(
    name: str,
    limits: tuple[float, float],
    torque: float,
    gearbox: float,
    drive: _Drive,
    *,
    armature: float,
    damping: float,
    velocity: float = BODY_VELOCITY,
    home: float = 0.0,
) -> Axis:
    """Make an axis whose part is set later; values that are not given follow from the type of motor."""
    return Axis(
        part="",
        name=name,
        minimum=limits[0],
        maximum=limits[1],
        max_velocity=velocity,
        max_torque=torque,
        gearbox=gearbox,
        encoder_resolution=ENCODER_TICKS_PER_DEGREE,
        rotor_resolution=drive.rotor_resolution,
        armature=armature,
        friction=_FRICTION_SHARE * torque,
        damping=damping,
        home=home,
        nominal_current=drive.nominal,
        peak_current=drive.peak,
        overload_current=drive.overload,
    )


def _finger(name: str, maximum: float) -> Axis:
    return _axis(
        name, (0.0, maximum), 0.3, 256.0, _HAND, armature=2e-4, damping=2e-3, velocity=FINGER_VELOCITY
    )  # fmt: skip


_HEAD_AXES = (
    _axis("neck_pitch", (-40, 22), 8.0, 161.7, _NECK, armature=0.01, damping=0.06),
    _axis("neck_roll", (-20, 20), 8.0, 161.7, _NECK, armature=0.01, damping=0.06),
    _axis("neck_yaw", (-50, 50), 5.0, 100.0, _NECK, armature=0.01, damping=0.06),
    _axis("eyes_tilt", (-30, 30), 0.3, -141.0, _HAND, armature=4e-4, damping=4e-3, velocity=FINGER_VELOCITY),
    # Both eyes turn with the version, so it has the inertia and the strength of two; to the vergence they are half of
    # one, and as strong as one.
    _axis("eyes_version", (-30, 30), 0.3, 50.0, _HAND, armature=4e-4, damping=4e-3, velocity=FINGER_VELOCITY),
    _axis("eyes_vergence", (0, 50), 0.15, 50.0, _HAND, armature=1e-4, damping=1e-3, velocity=FINGER_VELOCITY),
)
_TORSO_AXES = (
    _axis("torso_yaw", (-50, 50), 50.0, -100.0, _LEG, armature=0.08, damping=0.06),
    _axis("torso_roll", (-30, 30), 80.0, -100.0, _LEG, armature=0.08, damping=0.06),
    _axis("torso_pitch", (-20, 70), 80.0, -100.0, _LEG, armature=0.08, damping=0.06),
)


def _arm_axes(side: str, mounted: int) -> tuple[Axis, ...]:
    """Return the sixteen axes of an arm; ``mounted`` is 1 or -1, the mounting direction of the shoulder's motors."""
    gear = 100.0 * mounted
    return (
        _axis(f"{side}_shoulder_pitch", (-95.5, 10), 40.0, gear, _ARM, armature=0.05, damping=0.06, home=-30),
        _axis(f"{side}_shoulder_roll", (0, 160.8), 40.0, gear, _ARM, armature=0.05, damping=0.06, home=45),
        _axis(f"{side}_shoulder_yaw", (-37, 80), 20.0, gear, _ARM, armature=0.04, damping=0.06),
        _axis(f"{side}_elbow", (15, 106), 20.0, gear, _ARM, armature=0.04, damping=0.06, home=45),
        _axis(f"{side}_wrist_prosup", (-60, 60), 4.0, -100.0, _NECK, armature=3e-3, damping=0.02),
        _axis(f"{side}_wrist_pitch", (-80, 25), 2.0, 159.0, _NECK, armature=3e-3, damping=0.02),
        _axis(f"{side}_wrist_yaw", (-20, 25), 2.0, 159.0, _NECK, armature=3e-3, damping=0.02),
        _finger(f"{side}_hand_finger", 60),
        _finger(f"{side}_thumb_oppose", 90),
        _finger(f"{side}_thumb_proximal", 90),
        _finger(f"{side}_thumb_distal", 180),
        _finger(f"{side}_index_proximal", 90),
        _finger(f"{side}_index_distal", 180),
        _finger(f"{side}_middle_proximal", 90),
        _finger(f"{side}_middle_distal", 180),
        _finger(f"{side}_pinky", 270),
    )


def _leg_axes(side: str, mounted: int) -> tuple[Axis, ...]:
    """Return the six axes of a leg; ``mounted`` is 1 on the left, -1 on the right, where motors turn the other way."""
    return (
        _axis(f"{side}_hip_pitch", (-45, 134), 55.5, -150.0 * mounted, _LEG, armature=0.08, damping=0.223),
        _axis(f"{side}_hip_roll", (-20, 120), 37.0, 100.0 * mounted, _LEG, armature=0.06, damping=0.223, home=15),
        _axis(f"{side}_hip_yaw", (-80, 80), 37.0, -100.0 * mounted, _LEG, armature=0.06, damping=0.223),
        _axis(f"{side}_knee", (-124, 4), 37.0, -100.0 * mounted, _LEG, armature=0.06, damping=0.223),
        _axis(f"{side}_ankle_pitch", (-35, 35), 37.0, 100.0 * mounted, _LEG, armature=0.06, damping=0.223),
        _axis(f"{side}_ankle_roll", (-25, 25), 37.0, 100.0 * mounted, _LEG, armature=0.06, damping=0.223),
    )


def _in_part(part: str, axes: tuple[Axis, ...]) -> tuple[Axis, ...]:
    return tuple(replace(axis, part=part) for axis in axes)


#: The parts in the robot's order, and their axes in the order of the part's control board.
PARTS: dict[str, tuple[Axis, ...]] = {
    "head": _in_part("head", _HEAD_AXES),
    "left_arm": _in_part("left_arm", _arm_axes("l", 1)),
    "right_arm": _in_part("right_arm", _arm_axes("r", -1)),
    "torso": _in_part("torso", _TORSO_AXES),
    "left_leg": _in_part("left_leg", _leg_axes("l", 1)),
    "right_leg": _in_part("right_leg", _leg_axes("r", -1)),
}

#: The part that is not simulated by physics, and all parts that a simulated robot can serve.
FACE = "face"
SERVED: tuple[str, ...] = (*PARTS, FACE)

#: All axes; the actuators of the model are in this order.
AXES: tuple[Axis, ...] = tuple(chain.from_iterable(PARTS.values()))

#: Place of an axis in :data:`AXES`.
INDEX: dict[str, int] = {axis.name: index for index, axis in enumerate(AXES)}


def part_slice(part: str) -> slice:
    """Return the slice of ``part`` in :data:`AXES`. Raises KeyError for a part that the robot does not have."""
    names = list(PARTS)
    if part not in PARTS:
        raise KeyError(f"the iCub has no part {part!r}; its parts are {', '.join(names)}")
    first = sum(len(PARTS[name]) for name in names[: names.index(part)])
    return slice(first, first + len(PARTS[part]))


@dataclass(frozen=True, slots=True)
class Coupling:
    """The coupling of the motors of some neighbouring joints of a part.

    ``motor = joint_to_motor @ joint`` and ``torque of the joints = joint_to_motor.T @ torque of the motors``, both
    before the gearbox: an encoder of motor *i* turns ``gearbox[i]`` times as far. Rows and columns are in the order of
    the part's control board. A robot returns this matrix as its remote variable ``kinematic_mj``.
    """

    first: int  # joint of the part at which the block starts
    joint_to_motor: tuple[tuple[float, ...], ...]

    @property
    def size(self) -> int:
        """The number of joints, and of motors."""
        return len(self.joint_to_motor)

    @property
    def motor_to_joint(self) -> NDArray[np.float64]:
        """The inverse."""
        return np.linalg.inv(np.array(self.joint_to_motor))


def _identity(first: int, size: int) -> Coupling:
    return Coupling(first, tuple(tuple(float(row == column) for column in range(size)) for row in range(size)))


#: The shoulder's second and third motor sit in the torso and pull cables over pulleys of 40/65.
_SHOULDER = Coupling(0, ((1.0, 0.0, 0.0, 0.0), (-1.625, 1.625, 0.0, 0.0), (0.0, 0.0, 1.625, 0.0), (0.0, 0.0, 0.0, 1.0)))
_HAND_BLOCKS = (_identity(4, 4), _identity(8, 4), _identity(12, 4))
_LEG_BLOCKS = (_identity(0, 4), _identity(4, 2))

#: The couplings of each part, one block for each of its boards; together they cover all joints of the part.
COUPLINGS: dict[str, tuple[Coupling, ...]] = {
    # One motor an eye: the first is of the right eye (version - vergence), the second of the left one.
    "head": (
        _identity(0, 2),
        Coupling(2, ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, -1.0), (0.0, 0.0, 1.0, 1.0))),
    ),
    "left_arm": (_SHOULDER, *_HAND_BLOCKS),
    "right_arm": (_SHOULDER, *_HAND_BLOCKS),
    # Roll and pitch are a differential: half the difference and half the sum.
    "torso": (Coupling(0, ((1.0, 0.0, 0.0), (0.0, 0.5, -0.5), (0.0, 0.5, 0.5))),),
    "left_leg": _LEG_BLOCKS,
    "right_leg": _LEG_BLOCKS,
}


def joint_to_motor(part: str) -> NDArray[np.float64]:
    """Return the couplings of a part as one square matrix: motors = matrix @ joints, before the gearbox."""
    matrix = np.zeros((len(PARTS[part]), len(PARTS[part])))
    for block in COUPLINGS[part]:
        span = slice(block.first, block.first + block.size)
        matrix[span, span] = block.joint_to_motor
    return matrix
