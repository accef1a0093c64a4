"""``gazecontrollerserver``: the gaze controller as a device of a configuration, on the attached boards.

It is attached to the boards of head and torso, and perhaps to an inertial sensor. Parameters have the names and the
meanings of ``config.ini`` of iKinGazeCtrl; a key of a group stands in the group:

=========================  ============================================================================================
``name``                   prefix of the ports (default ``/iKinGazeCtrl``)
``head_version``           version of the chains (default 2.5)
``torso``                  ``off``: the torso stands at 0, and its board is not needed
``trajectory_time``        group: ``neck`` (0.75 s) and ``eyes`` (0.25 s)
``saccades``               whether the eyes jump to targets far away (on)
``vor``, ``ocr``           gains of the reflexes; 1 and 0 with an inertial sensor, 0 and 1 without
``imu``                    group: ``gyro_noise_threshold``, rotations below which count as none (5 deg/s)
``eye_tilt``               group: ``min`` (-20 deg) and ``max`` (15 deg)
``CAMERA_CALIBRATION_LEFT``  group: ``w``, ``h``, ``fx``, ``fy``, ``cx``, ``cy``; and ``_RIGHT``
``ALIGN_KIN_LEFT``         group: ``HN``, the pose of the camera in the frame of the eye, 16 numbers; and ``_RIGHT``
=========================  ============================================================================================

Of this project: ``period`` in ms (default 10), ``Robot``, one of ``rtf robot list`` or a path, which has the tables of
the chains (default icub), ``eye_joints``, the axes of tilt, version and vergence on the board of the head, and
``eyes_lag``, how much later (s, default 0) their speeds follow what they are commanded, which the reflexes foresee.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Bottle, Property, as_string
from rtf.robot import parameters
from rtf.robot.controllers.gaze import GazeSettings
from rtf.robot.devices.remapper import ControlBoardRemapper
from rtf.robot.errors import DeviceError, NotSupportedError, RefusedError
from rtf.robot.gaze.controller import GazeController
from rtf.robot.gaze.server import GazeServer
from rtf.robot.gaze.views import SIDES, EyeViews
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory
from rtf.robot.kinematics import Eyes, Pinhole, robot_chains
from rtf.robot.kinematics.poses import checked_pose
from rtf.robot.model import load_robot
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.request_table import VERSION, array
from rtf.robot.network.task_server import ControlledServer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.robot.device import Device
    from rtf.robot.interfaces import Eye, FloatArray

_MILLISECOND = 1e-3
_ROBOT, _HEAD = "icub", "2.5"
_EYE_JOINTS = "(eyes_tilt eyes_version eyes_vergence)"
#: Eyes that follow later than this (s) are not led by the reflex.
_LONGEST_LAG = 0.1
_TILT = (-20.0, 15.0)
_PINHOLE = ("w", "h", "fx", "fy", "cx", "cy")
_MATRIX = 16
_TORSO = 3


class GazeControllerDevice(PublishingDevice):
    """The controller, and the server of its ports."""

    unit = _MILLISECOND
    default_period = 10.0
    default_name = "/iKinGazeCtrl"

    #: Ends the program of the controller, if that is its own.
    quit_program: Callable[[], None] | None = None

    _views: EyeViews
    _gyroscope: IMultipleAnalogSensors | None = None

    def configure(self, configuration: Property) -> None:
        self._version = as_string(configuration.get("head_version", _HEAD)).removeprefix("v")
        self._has_torso = as_string(configuration.get("torso", "torso")) != "off"
        self._robot = load_robot(as_string(configuration.get("Robot", _ROBOT)))
        self._eye_joints = parameters.names(configuration, "eye_joints") or parameters.names(
            Property.parse(f"(eye_joints {_EYE_JOINTS})"), "eye_joints"
        )
        tilt = parameters.group_of(configuration, "eye_tilt")
        low, high = (parameters.number(tilt, key, default) for key, default in zip(("min", "max"), _TILT, strict=True))
        if low > high:
            raise parameters.wrong(tilt, "min", f"the eyes tilt from {low:g} to {high:g} deg; the smaller comes first")
        self._tilt = low, high
        self._eyes_lag = parameters.number(configuration, "eyes_lag", 0.0)
        if not 0.0 <= self._eyes_lag <= _LONGEST_LAG:
            raise parameters.wrong(configuration, "eyes_lag", f"it is a time from 0 to {_LONGEST_LAG:g} s")
        self._extrinsics = {eye: _extrinsics(configuration, eye) for eye in SIDES}
        self._cameras = {eye: one for eye in SIDES if (one := _camera(configuration, eye)) is not None}
        self._settings = self._read_settings(configuration)
        try:
            self._views = EyeViews(self._chains(), self._cameras, self._extrinsics)
        except RefusedError as error:
            raise parameters.wrong(configuration, "head_version", str(error)) from None

    def _read_settings(self, configuration: Property) -> dict[str, Any]:
        """Return the settings that are given, by the names of GazeSettings. Raises ConfigurationError."""
        times = parameters.group_of(configuration, "trajectory_time")
        given = {
            "neck_time": parameters.positive(times, "neck", GazeSettings().neck_time),
            "eyes_time": parameters.positive(times, "eyes", GazeSettings().eyes_time),
            "gyro_threshold": parameters.number(
                parameters.group_of(configuration, "imu"), "gyro_noise_threshold", GazeSettings().gyro_threshold
            ),
            "saccades": parameters.flag(configuration, "saccades", default=True),
        }
        for key, name in (("vor", "vestibular"), ("ocr", "opto_kinetic")):
            if configuration.check(key):
                given[name] = parameters.number(configuration, key, 0.0)
        return given

    def _chains(self) -> Eyes:
        tables = robot_chains(self._robot)
        left, right, head, self._imu = (
            tables.chain(name, self._version).limited_by(self._robot.axes)
            for name in ("left_eye", "right_eye", "head", "head_imu")
        )
        left = left.with_tip(left.tip @ self._extrinsics["left"])
        right = right.with_tip(right.tip @ self._extrinsics["right"])
        if self._has_torso:
            return Eyes(left, right, head)
        stands = dict.fromkeys(head.joints[:_TORSO], 0.0)
        self._imu = self._imu.blocked(stands)
        return Eyes(left.blocked(stands), right.blocked(stands), head.blocked(stands))

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Find the joints on the boards, and open the ports. Raises DeviceError."""
        sensors = {name: found for name, device in devices.items() if (found := _sensors(device)) is not None}
        if len(sensors) > 1:
            raise DeviceError(f"{self.name} has one inertial sensor, not {', '.join(sensors)}")
        self._gyroscope = next(iter(sensors.values()), None)
        board = ControlBoardRemapper(self.name, network=self.network)
        board.open(Property({"axesNames": Bottle([*self._views.eyes.head.joints, *self._eye_joints])}))
        board.attach({name: device for name, device in devices.items() if name not in sensors})
        super().attach({"neck and eyes": board})

    def serve(self, device: Device) -> ControlledServer[GazeController]:
        """Make the controller of a board, and open its ports."""
        felt = self._gyroscope is not None
        reflexes = {"vestibular": float(felt), "opto_kinetic": float(not felt)}
        controller = GazeController(
            device,
            self._views,
            settings=GazeSettings(**{**reflexes, **self._settings}),
            gyroscope=self._rotation if felt else None,
            sensor_pose=self._imu.pose,
            tilt=self._tilt,
            eyes_lag=self._eyes_lag,
            period=self.period,
            info=[("server_version", VERSION), ("head_version", self._version)],
        )
        server = GazeServer(
            controller,
            self.port_name,
            network=self.network,
            period=self.period,
            outlets=self.outlets,
            quit_program=self.quit_program,
        )
        return ControlledServer(controller, server)

    def _rotation(self) -> FloatArray:
        assert self._gyroscope is not None
        return self._gyroscope.read_sensor(SensorCategory.GYROSCOPE, 0).values


def _sensors(device: Device) -> IMultipleAnalogSensors | None:
    """Return a device as sensors, one of which is a gyroscope; None for a board."""
    try:
        found = device.view(IMultipleAnalogSensors)  # type: ignore[type-abstract]  # it is only looked for
    except NotSupportedError:
        return None
    return found if found.sensors(SensorCategory.GYROSCOPE) else None


def _camera(configuration: Property, eye: Eye) -> Pinhole | None:
    """Return the camera of an eye; None if the configuration has none. Raises ConfigurationError."""
    key = f"CAMERA_CALIBRATION_{eye.upper()}"
    if not configuration.check(key):
        return None
    group = parameters.group_of(configuration, key)
    width, height, fx, fy = (parameters.positive(group, one) for one in _PINHOLE[:4])
    cx, cy = (parameters.positive(group, one) for one in _PINHOLE[4:])
    return Pinhole(int(width), int(height), fx, fy, cx, cy)


def _extrinsics(configuration: Property, eye: Eye) -> FloatArray:
    """Return the pose of the camera in the frame of its eye (4, 4). Raises ConfigurationError."""
    group = parameters.group_of(configuration, f"ALIGN_KIN_{eye.upper()}")
    if not group.check("HN"):
        return np.eye(4)
    try:
        return checked_pose(array(group.find("HN"), _MATRIX).reshape(4, 4))
    except RefusedError as error:
        raise parameters.wrong(group, "HN", f"16 numbers of a pose are needed: {error}") from None
