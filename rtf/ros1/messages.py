"""Messages and services of ROS 1 that are used here, each as :class:`~rtf.ros1.types.MessageType`.

Their fields have the names of ROS; times are in ``sec`` and ``nanosec``.
"""

from __future__ import annotations

import math
from typing import Any

from rtf.ros1.types import message_type, service_type

Clock = message_type("rosgraph_msgs/Clock")
Header = message_type("std_msgs/Header")
Image = message_type("sensor_msgs/Image")
Imu = message_type("sensor_msgs/Imu")
JointState = message_type("sensor_msgs/JointState")
Quaternion = message_type("geometry_msgs/Quaternion")
String = message_type("std_msgs/String")
Vector3 = message_type("geometry_msgs/Vector3")
Wrench = message_type("geometry_msgs/Wrench")
WrenchStamped = message_type("geometry_msgs/WrenchStamped")

EMPTY = service_type("std_srvs/Empty")
SET_BOOL = service_type("std_srvs/SetBool")
TRIGGER = service_type("std_srvs/Trigger")

_NS = 1_000_000_000
#: Times of ROS 1 begin in 1970 and end in 2106; the package rosbags has them until 2038.
_LAST = 2.0**31 - 1
_Time = type(Header().stamp)


def time_of(seconds: float) -> Any:  # its class is made at run time
    """Return a time of seconds; one that does not fit is the nearest that does."""
    bounded = min(max(seconds, 0.0), _LAST)
    whole = math.floor(bounded)
    return _Time(whole, min(int((bounded - whole) * _NS), _NS - 1))


def seconds_of(time: Any) -> float:
    """Return the seconds of a time, or of a duration."""
    return float(time.sec + time.nanosec / _NS)
