"""Force-torque sensors in several postures: gains and axes, by the known weights of the links beyond them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import SensorCategory
from rtf.robot.model.errors import MissingPackageError
from rtf.robot_testing import Safety
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.ft_sensor_loads import WeightModel, parts_above, place_of
from rtf.robot_testing.judging.vector_channels import Bounds, judge_channels
from rtf.robot_testing.motion.start_position import bring
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.slides import in_units
from rtf.robot_testing.stream_test import StreamTest
from rtf.robot_testing.streams.sensor_streams import MEASURES, names_of, readings_of, sensors_in
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part
    from rtf.robot_testing.streams.message import Message

_ENDING = "/analog:o"
_AXES = "xyz"
#: Time at rest before a measurement, s: the integral of a controller and the swinging of the limb have ended.
_REST = 0.4
_FEWEST_MESSAGES, _FEWEST_POSTURES = 3, 4
#: Joints that are moved for a sensor: three directions are all that a force has.
_MOST_JOINTS = 3


class _Sensor(NamedTuple):
    """A sensor: its name, its port, its place in the model, and its number in a message of several sensors."""

    name: str
    port: str
    place: str
    number: int | None


class FtSensorPostures(StreamTest):
    """Moves the joints above each sensor to both sides, and compares its changes with those of its load by the model.

    Offsets cancel out: a line through the postures has the gain as its slope, for each force and each torque. One that
    is explained by another axis shows that. What hardly changes in these postures is not judged. The robot must not
    touch anything.
    """

    aliases = ("ftSensorPostures", "FtSensorGain")
    tags = ("motion", "sensors", "force-torque")
    judged_sensors = ("force_torque",)
    safety = Safety.MOTION

    sensors = Parameter(list[str], "places of the sensors, such as left_arm; none: all of the robot", default=[])
    amplitude = Parameter(float, "way of each joint to either side", unit="deg", default=30.0, low=5.0, high=90.0)
    speed = Parameter(float, "speed of the moves", unit="deg/s", default=30.0, low=1.0, high=60.0)
    time = Parameter(float, "how long a posture is measured", unit="s", default=0.3, low=0.05)
    # Masses in descriptions are known within some per cent, and so are the calibrations of such sensors.
    gain = Parameter(float, "greatest error of a gain", default=0.12, low=0.01)
    # The noise of a mean, and the error of the model in a posture; less change of a load cannot be judged.
    force_error = Parameter(float, "error of a force in a posture that is no finding", unit="N", default=0.2, low=0.0)
    torque_error = Parameter(float, "the same of a torque", unit="Nm", default=0.03, low=0.0)
    # With five times the error as standard deviation of the load, nine postures know a gain within 0.2 at 99 %.
    known = Parameter(
        float, "least deviation of a load, in such errors, for its gain to be judged", default=5.0, low=1.0
    )

    def setup(self) -> None:
        """Find the sensors, and open the parts above them."""
        super().setup()
        self.model = robot_model(self)
        try:
            self.weights = WeightModel(self.model)
        except MissingPackageError as error:
            self.assert_error(f"the weights of the links are needed: {error}")
        self.found = [
            sensor
            for sensor in self._sensors()
            if (sensor.place in self.sensors if self.sensors else self._can_move(sensor))
        ]
        self.assert_error_if_false(
            self.found,
            f"/{self.robot_name} has no force-torque sensor with a known place"
            + (f" among {', '.join(self.sensors)}" if self.sensors else ""),
        )
        for name in dict.fromkeys(name for sensor in self.found for name in parts_above(self.model, sensor.place)):
            self.open_part(name).set_mode(ControlMode.POSITION)

    def _can_move(self, sensor: _Sensor) -> bool:
        """Return whether all parts above a sensor are there; say so if not."""
        names = parts_above(self.model, sensor.place)
        missing = [f"/{self.robot_name}/{name}" for name in names if not self.has_part(name)]
        if missing:
            self.report(f"{sensor.name} is not judged: there is no {', '.join(missing)}")
        return not missing

    def _sensors(self) -> list[_Sensor]:
        """Return the sensors whose places the model knows, each once: on ports of their own, or several on one."""
        found: dict[str, _Sensor] = {}
        for port in self.known_ports(_ENDING):
            place = port.removesuffix(_ENDING).rpartition("/")[2]
            if parts_above(self.model, place):
                found[place] = _Sensor(port, port, place, None)
        for port in self.known_ports(MEASURES):
            for number, name in enumerate(names_of(self.network, port, SensorCategory.FORCE_TORQUE)):
                if place := place_of(self.model, name):
                    found.setdefault(place, _Sensor(name, port, place, number))
        return list(found.values())

    def run(self) -> None:
        """Move part by part; all sensors that its joints carry are measured meanwhile. Then judge each sensor."""
        there = [sensor for sensor in self.found if self.open_stream(sensor.port, keep=True)]
        parts = [parts_above(self.model, sensor.place)[-1] for sensor in there]
        for number, name in enumerate(dict.fromkeys(parts)):
            self.progress(number / len({*parts}), name)
            sensors = [sensor for sensor, part in zip(there, parts, strict=True) if part == name]
            rows = self._measure_postures(self.open_part(name), sensors)
            for place, sensor in enumerate(sensors):
                with self.subresult(sensor.name):
                    self._judge(
                        sensor, *(np.array(values) for values in zip(*(row[place] for row in rows), strict=True))
                    )

    # Measuring ---------------------------------------------------------------------------------------------------

    def _measure_postures(self, part: Part, sensors: Sequence[_Sensor]) -> list[list[tuple[FloatArray, FloatArray]]]:
        """Return the measured and the expected load of each sensor: at home, and with each joint to either side."""
        joints = sorted({joint for sensor in sensors for joint in self._informative_joints(part, sensor)})
        self.assert_error_if_false(joints, f"no joint of {part.name} changes the loads of its sensors enough")
        rows = [self._posture(part, sensors)]
        for joint in joints:
            try:
                for goal in self._goals(part, joint):
                    bring(self, part, [joint], [goal], speed=self.speed)
                    part.wait(_REST)
                    rows.append(self._posture(part, sensors))
                bring(self, part, [joint], [part.home[joint]], speed=self.speed)
            except GuardError as error:
                self.blame(part, error, "does not move", joints=[joint])
        self.assert_error_if_true(len(rows) < _FEWEST_POSTURES, f"the limits of {part.name} leave {len(rows)} postures")
        return rows

    def _goals(self, part: Part, joint: int) -> list[float]:
        """Return the ends of a joint's way: ``amplitude`` to either side of home, within the limits."""
        home = part.home[joint]
        ends = (min(part.high[joint] - 1.0, home + self.amplitude), max(part.low[joint] + 1.0, home - self.amplitude))
        return [float(end) for end in ends if abs(end - home) >= self.amplitude / 3.0]

    def _informative_joints(self, part: Part, sensor: _Sensor) -> list[int]:
        """Return the joints of a part that change the force on a sensor most, at most ``_MOST_JOINTS``."""
        before, changes = self._expected(sensor), dict[int, float]()
        for joint in part.held():
            for goal in self._goals(part, joint):
                pose = part.home.copy()
                pose[joint] = goal
                self.weights.set(part.names, in_units(part.board, pose))
                change = float(np.linalg.norm((self.weights.load(sensor.place) - before)[:3]))
                changes[joint] = max(change, changes.get(joint, 0.0))
        informative = [joint for joint, change in changes.items() if change > self.known * self.force_error]
        return sorted(informative, key=lambda joint: -changes[joint])[:_MOST_JOINTS]

    def _posture(self, part: Part, sensors: Sequence[_Sensor]) -> list[tuple[FloatArray, FloatArray]]:
        """Return for each sensor its mean reading now, and its load by the model (N, Nm)."""
        first = [len(self.listener.recorders[sensor.port].messages) for sensor in sensors]
        part.wait(self.time)
        return [
            (self._mean(sensor, begin), self._expected(sensor)) for sensor, begin in zip(sensors, first, strict=True)
        ]

    def _mean(self, sensor: _Sensor, first: int) -> FloatArray:
        readings = self._readings(sensor, self.listener.recorders[sensor.port].messages[first:])
        self.assert_true(
            len(readings) >= _FEWEST_MESSAGES, f"{len(readings)} messages of {sensor.name} came in {self.time:g} s"
        )
        self.assert_true(bool(np.isfinite(readings).all()), f"{sensor.name} sends values that are not finite")
        mean: FloatArray = readings.mean(axis=0)
        return mean

    def _readings(self, sensor: _Sensor, messages: Sequence[Message]) -> FloatArray:
        if not messages:
            return np.empty((0, 6))
        if sensor.number is None:
            return readings_of(sensor.port, messages)
        return sensors_in(sensor.port, messages, SensorCategory.FORCE_TORQUE)[sensor.number]

    def _expected(self, sensor: _Sensor) -> FloatArray:
        """Return the load of a sensor at the present positions, by the model."""
        for name in parts_above(self.model, sensor.place):
            part = self.open_part(name)
            self.weights.set(part.names, in_units(part.board, part.board.encoders()))
        try:
            return self.weights.load(sensor.place)
        except RefusedError as error:
            self.assert_error(f"the load of {sensor.name} is unknown: {error}")

    # Judging -----------------------------------------------------------------------------------------------------

    def _judge(self, sensor: _Sensor, measured: FloatArray, expected: FloatArray) -> None:
        self.measure("postures", len(measured), "count")
        for what, symbol, columns, error in (
            ("force", "N", slice(0, 3), self.force_error),
            ("torque", "Nm", slice(3, 6), self.torque_error),
        ):
            found, wanted = measured[:, columns], expected[:, columns]
            self.record(
                f"{what}s in the postures",
                **{f"expected_{axis}": (wanted[:, k], symbol) for k, axis in enumerate(_AXES)},
                **{f"measured_{axis}": (found[:, k], symbol) for k, axis in enumerate(_AXES)},
            )
            bounds = Bounds(self.gain, error, self.known)
            judge_channels(self, sensor.name, what, symbol, found, wanted, bounds)
