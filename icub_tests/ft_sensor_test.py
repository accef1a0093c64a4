"""Force-torque sensors: they show their static load, with the noise of a working sensor."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import SensorCategory
from rtf.robot.model.errors import MissingPackageError
from rtf.robot_testing import likely_causes
from rtf.robot_testing.judging.blame import accused
from rtf.robot_testing.judging.ft_sensor_loads import WeightModel, parts_above, place_of
from rtf.robot_testing.judging.statistics import jitter
from rtf.robot_testing.motion.stop_evidence import stop_evidence
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.stream_test import RateTest
from rtf.robot_testing.streams.sensor_streams import MEASURES, names_of, readings_of, sensors_in
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.trace import Trace
    from rtf.robot_testing.streams.stream_statistics import Stream

_CHANNELS = 6
_NAMES = ("force x", "force y", "force z", "torque x", "torque y", "torque z")
_UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")
_ENDING = "/analog:o"
#: Pieces of the measurement; the noise is that without the one that deviates most. Friction that has held a joint lets
#: it go now and then: it slips by a count of its encoder, and jerks its links for some hundredths of a second.
_PIECES = 10
#: A joint at rest moves by less: from end to end, deg, as it may slip by some counts, and from state to state.
_MOVES, _JUMPS = 0.2, 0.01


class FtSensorTest(RateTest):
    """Compares the mean of a sensor with its known load, and its noise with the usual range.

    The load is given, or computed by the model of the robot from the weight beyond the sensor in the current posture.
    The robot has to be at rest, without contact beyond the sensor. A sensor with an unknown load does not pass: it is
    inconclusive, or skipped if ``use_model`` is off.

    A port may publish one sensor, or several in one message (``/measures:o``); each of them is judged.
    """

    aliases = ("ftSensorTest", "FtSensor", "ftsensor", "ftSensorTests", "ftsensor-tests")
    tags = ("sensors", "force-torque")
    judged_sensors = ("force_torque",)

    port = Parameter(str, "the sensor's port; none: all of the robot", default="", key="portname", aliases=("port",))
    time = Parameter(float, "how long it is read", unit="s", default=1.0, low=0.1)
    frequency = Parameter(float, "its rate", unit="Hz", default=100.0, low=0.01)
    # As the parameter files of the iCub allow for its ports of 100 Hz.
    frequency_tolerance = Parameter(float, "tolerance of the rate", unit="Hz", default=5.0, low=0.0)
    expected = Parameter(
        list[float], "three forces (N) and three torques (Nm) that it should show; none: by the model", default=[]
    )
    use_model = Parameter(
        bool, "compute the load by the model unless expected is given; if off, the load is skipped", default=True
    )
    # Strain-gauge sensors of this kind drift by a few N with temperature and mounting.
    force_tolerance = Parameter(float, "tolerance of a force", unit="N", default=5.0, low=0.0)
    torque_tolerance = Parameter(float, "tolerance of a torque", unit="Nm", default=1.0, low=0.0)
    # One step per minute of a 16 bit converter (1000 N, 20 Nm) is more; rounding errors are less.
    least_noise = Parameter(float, "least standard deviation of a force", unit="N", default=1e-6, low=0.0)
    least_torque_noise = Parameter(float, "the same of a torque", unit="Nm", default=1e-6, low=0.0)
    # Ten counts of a sensor of 1500 N and fifty of one of 35 Nm with 16 bits: a loose cable shows more.
    force_noise = Parameter(float, "greatest standard deviation of a force", unit="N", default=0.5, low=0.0)
    torque_noise = Parameter(float, "greatest standard deviation of a torque", unit="Nm", default=0.05, low=0.0)
    # Three times the weight of a whole iCub.
    saturation = Parameter(float, "force at which the sensor saturates", unit="N", default=1000.0, low=0.0)

    _motion: Sequence[tuple[Part, Trace]] = ()  # what the joints did while the sensors were read

    def setup(self) -> None:
        """Find the sensors."""
        super().setup()
        self.assert_error_if_false(
            len(self.expected) in (0, _CHANNELS), f"expected has {len(self.expected)} values; give six, or none"
        )
        self.ports = [self.port] if self.port else self._sensors()
        self.assert_error_if_false(
            self.ports,
            f"no force-torque sensor of /{self.robot_name} is registered at the name server; give its port as portname",
        )

    def _sensors(self) -> list[str]:
        """Return the ports of the known sensors of the robot, and the ports of several sensors that add others."""
        robot = robot_model(self)
        single = [name for name in self.known_ports(_ENDING) if parts_above(robot, self._place(name))]
        known = {self._place(name) for name in single}
        several = [
            name
            for name in self.known_ports(MEASURES)
            if {place_of(robot, sensor) for sensor in self._names(name)} - known
        ]
        return single + several

    def _place(self, port: str) -> str:
        return port.removesuffix(_ENDING).rpartition("/")[2]

    def _names(self, port: str) -> list[str]:
        return names_of(self.network, port, SensorCategory.FORCE_TORQUE)

    def run(self) -> None:
        """Read all of them at the same time, and judge each."""
        parts = self._parts_above(self.ports)  # first: it takes time, in which streams would be recorded
        there = [name for name in self.ports if self.open_stream(name, keep=True)]
        with ExitStack() as recording:
            self._motion = [(part, recording.enter_context(part.recorded())) for part in parts]
            if there:
                self.listen(self.time)
        for name in there:
            with self.subresult(name):
                self._judge(name)

    def _parts_above(self, ports: Sequence[str]) -> list[Part]:
        """Open the parts of the robot that carry the sensors, those that are there."""
        robot = robot_model(self)
        places = [place for port in ports for place in self._places(port)]
        names = dict.fromkeys(name for place in places for name in parts_above(robot, place))
        return [self.open_part(name) for name in names if self.has_part(name)]

    def _places(self, port: str) -> list[str]:
        if not port.endswith(MEASURES):
            return [self._place(port)]
        return [place_of(robot_model(self), name) for name in self._names(port)]

    def _judge(self, name: str) -> None:
        found = self.judged(self.listener.recorders[name].messages, self.time, name)
        stream = self.judge(found, self.frequency, self.frequency_tolerance)
        if name.endswith(MEASURES):
            self._judge_many(name, stream)
        else:
            values = readings_of(name, stream.messages)
            self._judge_sensor(name, self._place(name), values, stream)

    def _judge_many(self, port: str, stream: Stream) -> None:
        """Judge each sensor of a message of several sensors."""
        sensors = sensors_in(port, stream.messages, SensorCategory.FORCE_TORQUE)
        self.assert_true(sensors, f"the messages of {port} have no force-torque sensor")
        names = self._names(port)
        if len(names) != len(sensors):
            names = [f"sensor {number}" for number in range(len(sensors))]
        for name, values in zip(names, sensors, strict=True):
            with self.subresult(name):
                self._judge_sensor(f"{name} of {port}", place_of(robot_model(self), name), values, stream)

    def _judge_sensor(self, name: str, place: str, values: FloatArray, stream: Stream) -> None:
        self.assert_equal(values.shape[1], _CHANNELS, f"numbers in a message of {name}")
        self.assert_true(np.isfinite(values).all(), f"{name} sends {_not_finite(values)} values that are not finite")
        times = stream.times - stream.times[0]
        self.record(
            "force and torque",
            time=(times, "s"),
            **{axis.replace(" ", "_"): (values[:, k], _UNITS[k]) for k, axis in enumerate(_NAMES)},
        )
        self._judge_noise(name, values)
        self._judge_load(name, place, values.mean(axis=0))

    def _judge_noise(self, name: str, values: FloatArray) -> None:
        greatest = float(np.abs(values[:, :3]).max())
        hint = f"{name} is saturated, at the end of its range; {likely_causes('offset', 'noise')}"
        self.measure("greatest force", greatest, "N", high=self.saturation, hint=hint)
        moving: str | None = None  # not asked yet
        for axis, (what, symbol) in enumerate(zip(_NAMES, _UNITS, strict=True)):
            low, high = (
                (self.least_noise, self.force_noise) if symbol == "N" else (self.least_torque_noise, self.torque_noise)
            )
            deviation = _noise(values[:, axis])
            if deviation > high and moving is None:
                moving = self._moving()
            if deviation > high and moving:
                self.inconclusive(f"{what} has a noise of {deviation:.2g} {symbol}; but {moving}")
            dead = f"does not change at all; {likely_causes('sensor frozen')}"
            loud = f"is noisy; {likely_causes('noise')}"
            hint = f"{name}: {what} {dead if deviation < low else loud}"
            self.measure(f"noise of {what}", deviation, symbol, low=low, high=high, hint=hint)

    def _moving(self) -> str:
        """Return which joint has shaken the robot, else which moved farthest without a command; "" if none did."""
        found = []
        for part, trace in self._motion:
            for joint, positions in enumerate(trace.positions.T):
                way = float(np.ptp(positions))
                if way > _MOVES or jitter(positions) > _JUMPS:
                    found.append((way, f"{part.names[joint]} moves by {part.shown(joint, way)}"))
        if not found:
            return ""
        cause = next(
            (one.text for part, _ in self._motion for one in accused(stop_evidence(part)).values()), max(found)[1]
        )
        return f"it was disturbed: {cause}"

    def _judge_load(self, name: str, place: str, mean: FloatArray) -> None:
        if not self.expected and not self.use_model:
            self._measure_mean(mean)
            with self.subresult("load"):
                self.skip("use_model is off and expected is not given: the mean is not judged")
            return
        try:
            expected = np.array(self.expected) if self.expected else self._modelled(place)
        except (MissingPackageError, RefusedError) as error:
            self._measure_mean(mean)
            self.inconclusive(f"the load of {name} is unknown, its mean is not judged: {error}; or give expected")
        for axis, (what, symbol) in enumerate(zip(_NAMES, _UNITS, strict=True)):
            tolerance = self.force_tolerance if symbol == "N" else self.torque_tolerance
            low, high = expected[axis] - tolerance, expected[axis] + tolerance
            hint = (
                f"{name} does not show its load: {what} is off by {mean[axis] - expected[axis]:+.2f} {symbol}; "
                f"{likely_causes('offset')}"
            )
            self.measure(what, mean[axis], symbol, low, high, hint=hint)

    def _measure_mean(self, mean: FloatArray) -> None:
        for what, symbol, value in zip(_NAMES, _UNITS, mean, strict=True):
            self.measure(what, value, symbol)

    def _modelled(self, place: str) -> FloatArray:
        """Return the load by the model. Raises MissingPackageError, or RefusedError for an unknown place."""
        robot = robot_model(self)
        model = WeightModel(robot)
        for part_name in parts_above(robot, place):
            part = self.open_part(part_name)
            model.set(part.names, part.board.encoders())
        return model.load(place)


def _noise(values: FloatArray) -> float:
    """Return the standard deviation of values without the piece that deviates most; of few values that of all."""
    if len(values) < 2 * _PIECES:
        return float(values.std(ddof=1))
    squares = (values - np.median(values)) ** 2
    worst = max(np.array_split(np.arange(len(values)), _PIECES), key=lambda piece: float(squares[piece].sum()))
    return float(np.delete(values, worst).std(ddof=1))


def _not_finite(values: FloatArray) -> int:
    return int((~np.isfinite(values)).sum())
