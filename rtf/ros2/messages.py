"""Messages of ROS 2 as DDS has them: the same fields in the same order, under the names of ROS's own types.

:func:`ros_type` is the name that people write, such as ``sensor_msgs/msg/JointState``.
"""

# Types of fields are read at run time, so annotations are not postponed.

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct

from rtf.ros2.cdr import Message

if TYPE_CHECKING:  # what the types of DDS are in Python
    float64 = float
    int32 = int
    uint8 = int
    uint32 = int
    sequence = list
    Bytes = list[int] | bytes
    Covariance = list[float]
    Guid = list[int]
    ShortName = str
else:
    from cyclonedds.idl.types import array, bounded_str, float64, int32, sequence, uint8, uint32

    Bytes = sequence[uint8]
    Covariance = array[float64, 9]
    Guid = array[uint8, 16]
    ShortName = bounded_str[256]

_NS = 1_000_000_000


def _dds(name: str) -> str:
    package, _, short = name.partition("/")
    return f"{package}.msg.dds_.{short.removeprefix('msg/')}_"


def ros_type(kind: type[IdlStruct]) -> str:
    """Return the name of a type in ROS."""
    package, _, name = kind.__idl_typename__.partition(".msg.dds_.")
    return f"{package}/msg/{name.removesuffix('_')}"


@dataclass
class Time(Message, typename=_dds("builtin_interfaces/Time")):
    """A time since 1970, or since a simulation began."""

    sec: int32 = 0
    nanosec: uint32 = 0

    @classmethod
    def of(cls, seconds: float) -> "Time":
        """Return a time of seconds; one that does not fit into 32 bits is the nearest that does."""
        bounded = min(max(seconds, -(2.0**31)), 2.0**31 - 1)
        whole = math.floor(bounded)
        return cls(whole, min(int((bounded - whole) * _NS), _NS - 1))

    @property
    def seconds(self) -> float:
        """The time in s."""
        return self.sec + self.nanosec / _NS


@dataclass
class Header(Message, typename=_dds("std_msgs/Header")):
    """When and in which frame."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class JointState(Message, typename=_dds("sensor_msgs/JointState")):
    """Positions (rad, m), velocities and efforts (Nm, N) of joints; a list is empty where nothing is known."""

    header: Header = field(default_factory=Header)
    name: sequence[str] = field(default_factory=list)
    position: sequence[float64] = field(default_factory=list)
    velocity: sequence[float64] = field(default_factory=list)
    effort: sequence[float64] = field(default_factory=list)


@dataclass
class Image(Message, typename=_dds("sensor_msgs/Image")):
    """A picture; ``step`` is the length of a row in bytes."""

    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    encoding: str = "rgb8"
    is_bigendian: uint8 = 0
    step: uint32 = 0
    data: Bytes = field(default_factory=list)


@dataclass
class Clock(Message, typename=_dds("rosgraph_msgs/Clock")):
    """The time of a simulation."""

    clock: Time = field(default_factory=Time)


@dataclass
class Vector3(Message, typename=_dds("geometry_msgs/Vector3")):
    """A vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Wrench(Message, typename=_dds("geometry_msgs/Wrench")):
    """A force (N) and a torque (Nm)."""

    force: Vector3 = field(default_factory=Vector3)
    torque: Vector3 = field(default_factory=Vector3)


@dataclass
class WrenchStamped(Message, typename=_dds("geometry_msgs/WrenchStamped")):
    """A wrench with its time."""

    header: Header = field(default_factory=Header)
    wrench: Wrench = field(default_factory=Wrench)


@dataclass
class String(Message, typename=_dds("std_msgs/String")):
    """A text."""

    data: str = ""


# The graph of nodes --------------------------------------------------------------------------------------------------


@dataclass
class Gid(Message, typename=_dds("rmw_dds_common/Gid")):
    """The identifier of an entity: its GUID in DDS."""

    data: Guid = field(default_factory=lambda: [0] * 16)


@dataclass
class NodeEntities(Message, typename=_dds("rmw_dds_common/NodeEntitiesInfo")):
    """A node and what it has."""

    node_namespace: ShortName = "/"
    node_name: ShortName = ""
    reader_gid_seq: sequence[Gid] = field(default_factory=list)
    writer_gid_seq: sequence[Gid] = field(default_factory=list)


@dataclass
class ParticipantEntities(Message, typename=_dds("rmw_dds_common/ParticipantEntitiesInfo")):
    """The nodes of a participant, which every ROS 2 program publishes on ``ros_discovery_info``."""

    gid: Gid = field(default_factory=Gid)
    node_entities_info_seq: sequence[NodeEntities] = field(default_factory=list)


# Commands of controllers ---------------------------------------------------------------------------------------------


@dataclass
class Duration(Message, typename=_dds("builtin_interfaces/Duration")):
    """A time between two."""

    sec: int32 = 0
    nanosec: uint32 = 0

    @classmethod
    def of(cls, seconds: float) -> "Duration":
        """Return a duration of seconds."""
        time = Time.of(seconds)
        return cls(time.sec, time.nanosec)

    @property
    def seconds(self) -> float:
        """The duration in s."""
        return self.sec + self.nanosec / _NS


@dataclass
class MultiArrayDimension(Message, typename=_dds("std_msgs/MultiArrayDimension")):
    """A dimension of an array."""

    label: str = ""
    size: uint32 = 0
    stride: uint32 = 0


@dataclass
class MultiArrayLayout(Message, typename=_dds("std_msgs/MultiArrayLayout")):
    """The dimensions of an array; none for a plain list."""

    dim: sequence[MultiArrayDimension] = field(default_factory=list)
    data_offset: uint32 = 0


@dataclass
class Float64MultiArray(Message, typename=_dds("std_msgs/Float64MultiArray")):
    """Numbers: the commands of a ``forward_command_controller``, one for each of its joints."""

    layout: MultiArrayLayout = field(default_factory=MultiArrayLayout)
    data: sequence[float64] = field(default_factory=list)


@dataclass
class JointTrajectoryPoint(Message, typename=_dds("trajectory_msgs/JointTrajectoryPoint")):
    """Where joints are at a time after the beginning."""

    positions: sequence[float64] = field(default_factory=list)
    velocities: sequence[float64] = field(default_factory=list)
    accelerations: sequence[float64] = field(default_factory=list)
    effort: sequence[float64] = field(default_factory=list)
    time_from_start: Duration = field(default_factory=Duration)


@dataclass
class JointTrajectory(Message, typename=_dds("trajectory_msgs/JointTrajectory")):
    """The way of joints; a stamp of 0 means that it begins at once."""

    header: Header = field(default_factory=Header)
    joint_names: sequence[str] = field(default_factory=list)
    points: sequence[JointTrajectoryPoint] = field(default_factory=list)


# Sensors -------------------------------------------------------------------------------------------------------------


@dataclass
class Quaternion(Message, typename=_dds("geometry_msgs/Quaternion")):
    """An orientation."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Imu(Message, typename=_dds("sensor_msgs/Imu")):
    """An orientation, an angular velocity (rad/s) and an acceleration (m/s²); a covariance of -1: not measured."""

    header: Header = field(default_factory=Header)
    orientation: Quaternion = field(default_factory=Quaternion)
    orientation_covariance: Covariance = field(default_factory=lambda: [0.0] * 9)
    angular_velocity: Vector3 = field(default_factory=Vector3)
    angular_velocity_covariance: Covariance = field(default_factory=lambda: [0.0] * 9)
    linear_acceleration: Vector3 = field(default_factory=Vector3)
    linear_acceleration_covariance: Covariance = field(default_factory=lambda: [0.0] * 9)
