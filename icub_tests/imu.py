"""IMU: the inertial units agree with the joint encoders, at rest and in motion."""

from __future__ import annotations

import math
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.errors import RtfError
from rtf.robot.control_modes import ControlMode
from rtf.robot.interfaces import SensorCategory
from rtf.robot.sensors.measurements import SENSOR_MESSAGE
from rtf.robot_testing import Safety, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.kinematics import rotation_of, rotation_vector
from rtf.robot_testing.judging.orientations import each_once, sure_turn, turns_of, vertical_turn
from rtf.robot_testing.judging.robot_description import read_description
from rtf.robot_testing.judging.statistics import jitter
from rtf.robot_testing.judging.vector_channels import Bounds, judge_channels
from rtf.robot_testing.motion.start_position import late_evidence, late_joints
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.slides import in_metres, in_units
from rtf.robot_testing.stream_test import StreamTest
from rtf.robot_testing.streams.sensor_streams import MEASURES, sensors_of
from rtf.robot_testing.streams.stream_statistics import stream_of
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part, Trace
    from rtf.robot_testing.judging.kinematics import KinematicModel
    from rtf.robot_testing.streams.message import Message

_GRAVITY = 9.81
_SHARE = 0.8  # share of the commanded motion that is required
_REST = 0.6  # s at rest at each turning point
_HOMING_SPEED = 20.0
#: Rotations are compared over windows of this number of messages; below this rate (deg/s) a unit is at rest.
_WINDOW, _AT_REST = 10, 0.5
#: The jumps of the angular velocity by the joints, deg/s, beyond which a unit is shaken; a robot at rest has none.
_SHAKEN = 0.3
_FEWEST_AT_REST = 20
#: Errors of a window's mean that are no finding: twice the jitter of stamps, 5 ms at an acceleration of 100 deg/s², and
#: the offsets of accelerometers; and how many of them a quantity has to vary by for its gain to be known.
_RATE_ERROR, _ACCELERATION_ERROR, _KNOWN = 1.0, 0.15, 4.0
_ANY_TURN = 180.0  # deg: with a wider interval the orientation of a unit is unknown


class _Unit(NamedTuple):
    """An inertial unit: name, frame, and its index among the sensors of each category; None if it has none."""

    name: str
    frame: str
    orientation: int
    gyroscope: int | None
    accelerometer: int | None


class _Felt(NamedTuple):
    """The measurements of a unit, a row for each message, and its expected orientations by the joints (n, 3, 3)."""

    times: FloatArray
    expected: FloatArray
    orientations: FloatArray
    speeds: FloatArray | None
    accelerations: FloatArray | None


class Imu(StreamTest):
    """Moves the joints that carry the inertial units, and compares the units with the kinematic model of the robot.

    The heading is fitted, as a unit's north is not the robot's front. The mounting of a unit is judged by gravity, by
    angular velocities, and by the orientations in all postures.
    """

    aliases = ("imu", "ImuTest", "IMU")
    tags = ("motion", "sensors", "imu")
    judged_sensors = ("inertial",)
    safety = Safety.MOTION

    port = Parameter(str, "the server of the units, without /measures:o; none: /ROBOT/inertial", default="")
    parts = Parameter(
        list[str], "parts whose joints carry the units", default=["head", "torso"], key="remoteControlBoards",
        aliases=("parts",),
    )  # fmt: skip
    axes = Parameter(
        list[str], "joints to be moved, as far as they carry a unit; none: all that do", default=[], key="axesNames",
        aliases=("axes",),
    )  # fmt: skip
    model = Parameter(str, "the description of the robot, a URDF file; none: the published one", default="")
    sensors = Parameter(list[str], "the units, or all", default=["all"], key="sensorsList", aliases=("sensors",))
    amplitude = Parameter(float, "way of each joint to either side", unit="deg", default=15.0, low=2.0)
    speed = Parameter(float, "speed of the moves", unit="deg/s", default=20.0, low=1.0, high=60.0)
    max_error = Parameter(
        float, "greatest error of the orientation", unit="rad", default=0.1, low=0.0, key="maxError",
        aliases=("max_error",),
    )  # fmt: skip
    max_gravity_error = Parameter(float, "the same of the direction of gravity", unit="deg", default=3.0, low=0.0)
    max_rate_error = Parameter(float, "rms error of the angular velocity", unit="deg/s", default=3.0, low=0.0)
    # The units are ten times more accurate; the zeros of the joints that carry them are accurate to a degree.
    max_turn = Parameter(float, "misalignment of a unit (lower confidence bound)", unit="deg", default=3.0, low=0.0)
    # Data sheets of such units have scales within 3 %, and misalignments of two degrees.
    gain = Parameter(float, "greatest error of the gain along an axis", default=0.1, low=0.01)
    # Ten times what such units have at 100 Hz.
    max_rate_noise = Parameter(float, "noise of the angular velocity", unit="deg/s", default=1.0, low=0.0)
    max_acceleration_noise = Parameter(float, "the same of the acceleration", unit="m/s^2", default=0.3, low=0.0)
    gravity_tolerance = Parameter(float, "tolerance of gravity about 9.81", unit="m/s^2", default=0.5, low=0.0)

    def setup(self) -> None:
        """Read the model, find the units, and open the parts in position mode."""
        super().setup()
        self.kinematics = self._model()
        self.server = (self.port or f"/{self.robot_name}/inertial").removesuffix(MEASURES)
        self.units = self._units()
        self.robot_parts = [self.open_part(name) for name in self.parts]
        self.moved = self._moved()
        for part in self.robot_parts:
            part.set_mode(ControlMode.POSITION)

    def _model(self) -> KinematicModel:
        try:
            return read_description(robot_model(self), self.model, self.robot_name)
        except RtfError as error:
            self.assert_error(f"cannot read the model: {error}")

    def _units(self) -> list[_Unit]:
        try:
            infos = sensors_of(self.network, f"{self.server}{MEASURES}")
        except RtfError as error:
            self.assert_error(f"{self.server} does not report its units: {error}{self._other_servers()}")
        places = [{info.name: k for k, info in enumerate(infos[category])} for category in _CATEGORIES]
        found = [
            _Unit(info.name, info.frame, k, places[0].get(info.name), places[1].get(info.name))
            for k, info in enumerate(infos[SensorCategory.ORIENTATION])
        ]
        if self.sensors != ["all"]:
            missing = set(self.sensors) - {unit.name for unit in found}
            there = ", ".join(unit.name for unit in found)
            self.assert_error_if_true(missing, f"{self.server} has no {', '.join(sorted(missing))}; it has {there}")
            found = [unit for unit in found if unit.name in self.sensors]
        self.assert_error_if_false(found, f"{self.server} has no unit with an orientation")
        for unit in found:
            self.assert_error_if_false(
                unit.frame in self.kinematics.links,
                f"{unit.name} measures in the frame {unit.frame!r}, which is not a link of {self.kinematics.place}",
            )
        return found

    def _other_servers(self) -> str:
        """Return which other servers have units with an orientation, for the end of an error text; "" without any."""
        found = []
        for stream in self.known_ports(MEASURES):
            with suppress(RtfError):  # one that does not answer cannot be used instead
                if sensors_of(self.network, stream)[SensorCategory.ORIENTATION]:
                    found.append(stream.removesuffix(MEASURES))
        return f"; inertial units are at {', '.join(found)}: set the parameter port" if found else ""

    def _moved(self) -> list[tuple[Part, int]]:
        """Return the joints to move: those that carry a unit and, if ``axes`` is given, are in it."""
        carrying = {joint for unit in self.units for joint in self.kinematics.chain(unit.frame)}
        known = {name: (part, k) for part in self.robot_parts for k, name in enumerate(part.names)}
        missing = carrying - set(known)
        self.assert_error_if_true(
            missing, f"no part of {', '.join(self.parts)} has {', '.join(sorted(missing))}; add its part"
        )
        moved = [name for name in known if name in carrying and (not self.axes or name in self.axes)]
        self.assert_error_if_false(
            moved, f"none of {', '.join(self.axes)} carries a unit; those that do are {', '.join(sorted(carrying))}"
        )
        return [known[name] for name in moved]

    # Moving ------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Move joint by joint while units and joints are recorded, then compare them."""
        stream = f"{self.server}{MEASURES}"
        if not self.open_stream(stream, keep=True):
            return
        with ExitStack() as recording:
            traces = [recording.enter_context(part.recorded()) for part in self.robot_parts]
            self.robot_parts[0].wait(_REST)
            joints = self.moved
            self.moved = []
            for place, (part, joint) in enumerate(joints):
                self.progress(place / len(joints), part.names[joint])
                if self._move(part, joint):
                    self.moved.append((part, joint))
        self.assert_error_if_false(self.moved, "no joint moved as commanded: nothing to compare")
        self._check_motion(traces)
        times, angles = self._angles(traces)
        messages = stream_of(self.listener.recorders[stream].messages).messages
        for unit in self.units:
            with self.subresult(unit.name):
                self._judge(unit, self._felt(unit, messages, times, angles))

    def _goals(self, part: Part, joint: int) -> tuple[float, float]:
        """Return the turning points of a joint: ``amplitude`` to either side of home, within the limits."""
        home = part.home[joint]
        return min(part.high[joint], home + self.amplitude), max(part.low[joint], home - self.amplitude)

    def _move(self, part: Part, joint: int) -> bool:
        """Move a joint to both sides and home; a joint that does not arrive fails. Return whether it arrived."""
        late: dict[int, str] = {}
        try:
            for goal in self._goals(part, joint):
                late = late or late_joints(part, [joint], [goal], speed=self.speed)
                part.wait(_REST)
            late = late_joints(part, [joint], [part.home[joint]], speed=self.speed) | late
        except GuardError as error:
            self.judge_stop(part, joint, error)
            return False
        if late:
            found = late_evidence(part, late)
            complaint = Evidence.uncertain(joint, late[joint], "does not move")
            self.judge_evidence(part, joint, complaint, found)
        return not late

    def _check_motion(self, traces: Sequence[Trace]) -> None:
        """End with an error if a joint did not move enough to compare."""
        for part, joint in self.moved:
            high, low = self._goals(part, joint)
            moved = float(np.ptp(traces[self.robot_parts.index(part)].positions[:, joint]))
            self.measure(f"motion of {part.names[joint]}", moved, "deg")
            self.assert_error_if_false(
                moved >= _SHARE * (high - low),
                f"{part.names[joint]} moved by {part.shown(joint, moved, '.1f')}, not by "
                f"{part.shown(joint, high - low, '.1f')}: nothing to compare",
            )

    # Comparing ---------------------------------------------------------------------------------------------------

    def _angles(self, traces: Sequence[Trace]) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return the times of the states, and the positions (rad, m) of all joints at these times."""
        times = traces[0].time
        angles = {}
        for part, trace in zip(self.robot_parts, traces, strict=True):
            turns = [in_metres(part.board, joint) is None for joint in range(part.axes)]
            own, positions = trace.time, in_units(part.board, trace.positions) * np.where(turns, np.radians(1.0), 1.0)
            for joint, name in enumerate(part.names):
                angles[name] = np.interp(times, own, positions[:, joint])
        return times, angles

    def _felt(
        self, unit: _Unit, messages: Sequence[Message], times: FloatArray, angles: dict[str, FloatArray]
    ) -> _Felt:
        """Return the measurements of a unit during the recorded states, with the expected orientations."""
        read = [SENSOR_MESSAGE.decode(one.data, one.dialect) for one in messages]
        stamps = np.array([values[SensorCategory.ORIENTATION][unit.orientation].time for values in read])
        used = [place for place in each_once(stamps) if times[0] <= stamps[place] <= times[-1]]
        self.assert_true(
            len(used) > _FEWEST_AT_REST, f"only {len(used)} measurements of {unit.name} came while joints moved"
        )
        stamps, read = stamps[used], [read[place] for place in used]
        chain = self.kinematics.chain(unit.frame)
        at = {name: np.interp(stamps, times, angles[name]) for name in chain}
        expected = [
            self.kinematics.transform(unit.frame, {name: values[k] for name, values in at.items()})[:3, :3]
            for k in range(stamps.size)
        ]
        orientations = [
            rotation_of(*np.radians(one[SensorCategory.ORIENTATION][unit.orientation].values)) for one in read
        ]
        gyroscope, accelerometer = (
            None if place is None else np.array([one[category][place].values for one in read])
            for category, place in zip(_CATEGORIES, (unit.gyroscope, unit.accelerometer), strict=True)
        )
        felt = _Felt(stamps, np.array(expected), np.array(orientations), gyroscope, accelerometer)
        self._require_numbers(unit, felt)
        return felt

    def _require_numbers(self, unit: _Unit, felt: _Felt) -> None:
        measured = [values.reshape(len(values), -1) for values in felt[2:] if values is not None]
        missing = int((~np.isfinite(np.hstack(measured))).any(axis=1).sum())
        self.assert_fail_if_true(
            missing,
            f"{missing} of {felt.times.size} measurements of {unit.name} are not finite; "
            f"{likely_causes('sensor frozen')}",
        )

    def _judge(self, unit: _Unit, felt: _Felt) -> None:
        turning = turns_of(felt.expected, felt.times, _WINDOW)
        fast = np.linalg.norm(turning, axis=1)
        self._judge_orientation(felt)
        self._judge_noise(unit, "angular velocity", felt.speeds, "deg/s", self.max_rate_noise, felt)
        self._judge_noise(unit, "acceleration", felt.accelerations, "m/s^2", self.max_acceleration_noise, felt)
        expected, found = [], []
        if felt.speeds is not None:
            rates = self._judge_rates(felt.times, felt.speeds, turning)
            each, bounds = slice(None, None, _WINDOW), Bounds(self.gain, _RATE_ERROR, _KNOWN)
            judge_channels(self, unit.name, "angular velocity", "deg/s", rates[each], turning[each], bounds)
            expected.append(turning[fast > _AT_REST])
            found.append(rates[fast > _AT_REST])
        if felt.accelerations is not None:
            up, measured = self._judge_gravity(unit, felt.expected, felt.accelerations, fast)
            expected.append(up * _AT_REST)
            found.append(measured * _AT_REST)
        if found:
            self._judge_mounting(unit, np.concatenate(found), np.concatenate(expected))

    def _judge_orientation(self, felt: _Felt) -> None:
        heading = vertical_turn(felt.orientations, felt.expected)
        self.measure("heading of the unit's north", math.degrees(heading), "deg")
        aligned = rotation_of(0.0, 0.0, heading) @ felt.orientations
        errors = np.array(
            [rotation_vector(found @ wanted.T) for found, wanted in zip(aligned, felt.expected, strict=True)]
        )
        size = np.linalg.norm(errors, axis=1)
        self.record(
            "orientation",
            time=(felt.times - felt.times[0], "s"),
            error=(np.degrees(size), "deg"),
            **{f"about_{axis}": (np.degrees(errors[:, k]), "deg") for k, axis in enumerate("xyz")},
        )
        self.measure("rms error of the orientation", float(np.sqrt(np.mean(size**2))), "rad")
        for k, axis in enumerate("xyz"):
            self.measure(f"greatest error about {axis}", float(np.abs(errors[:, k]).max()), "rad")
        self._off("greatest error of the orientation", float(size.max()), "rad", self.max_error)
        still = int((np.ptp(felt.orientations, axis=0) == 0.0).all())
        self.check_fail_if_true(still, f"the orientation never changed; {likely_causes('sensor frozen')}")

    def _judge_noise(
        self, unit: _Unit, what: str, values: FloatArray | None, symbol: str, most: float, felt: _Felt
    ) -> None:
        """Judge the noise of the noisiest axis, from measurement to measurement."""
        if values is not None:
            noise = max(map(jitter, values.T))
            if noise > most and (shaken := max(map(jitter, turns_of(felt.expected, felt.times, 1).T))) > _SHAKEN:
                self.inconclusive(
                    f"its {what} jumps by {noise:.2g} {symbol}; but it is shaken: by the joints that carry it, its "
                    f"angular velocity jumps by {shaken:.2g} deg/s"
                )
            hint = f"{unit.name}: its {what} jumps by {noise:.2g} {symbol}; {likely_causes('noise')}"
            self.measure(f"noise of the {what}", noise, symbol, high=most, hint=hint)

    def _judge_rates(self, times: FloatArray, speeds: FloatArray, turning: FloatArray) -> FloatArray:
        """Compare the mean angular velocities of windows with those of the joints; return the means."""
        steps = np.diff(times)[:, None] * (speeds[1:] + speeds[:-1]) / 2
        turned = np.cumsum(np.vstack([np.zeros(3), steps]), axis=0)
        means: FloatArray = (turned[_WINDOW:] - turned[:-_WINDOW]) / (times[_WINDOW:] - times[:-_WINDOW])[:, None]
        errors = np.linalg.norm(means - turning, axis=1)
        self.record(
            "turning rate",
            time=(times[_WINDOW:] - times[0], "s"),
            expected=(np.linalg.norm(turning, axis=1), "deg/s"),
            measured=(np.linalg.norm(means, axis=1), "deg/s"),
        )
        self._off("rms error of the turning rate", float(np.sqrt(np.mean(errors**2))), "deg/s", self.max_rate_error)
        return means

    def _judge_gravity(
        self, unit: _Unit, expected: FloatArray, accelerations: FloatArray, turning: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Compare the direction of gravity in the unit's frame, at rest; return the expected and the found ones."""
        # Leave out windows near the begin and end of a move: there the unit is accelerated.
        around = 2 * _WINDOW + 1
        rest = np.flatnonzero(np.convolve(turning < _AT_REST, np.ones(around), "same") > around - 0.5)
        self.assert_error_if_true(
            rest.size < _FEWEST_AT_REST, f"{unit.name} was at rest in {rest.size} of {turning.size} windows only"
        )
        up = expected[rest][:, 2, :]
        found = np.array([accelerations[k : k + _WINDOW].mean(axis=0) for k in rest])
        size = np.linalg.norm(found, axis=1)
        cosine = np.einsum("ij,ij->i", up, found) / np.maximum(size, 1e-9)
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        self._off("greatest error of the direction of gravity", float(angle.max()), "deg", self.max_gravity_error)
        mean = float(size.mean())
        low, high = _GRAVITY - self.gravity_tolerance, _GRAVITY + self.gravity_tolerance
        hint = f"{unit.name} measures {mean:.2f} m/s^2 at rest; {likely_causes('offset')}"
        self.measure("gravity", mean, "m/s^2", low, high, hint=hint)
        bounds = Bounds(self.gain, _ACCELERATION_ERROR, _KNOWN)
        judge_channels(self, unit.name, "acceleration", "m/s^2", found, _GRAVITY * up, bounds)
        return up, found / np.maximum(size, 1e-9)[:, None]

    def _off(self, name: str, value: float, symbol: str, high: float) -> None:
        hint = f"{name} is {value:.3g} {symbol}; {likely_causes('orientation')}"
        self.measure(name, value, symbol, high=high, hint=hint)

    def _judge_mounting(self, unit: _Unit, found: FloatArray, expected: FloatArray) -> None:
        """Judge the misalignment that would explain the unit's measurements; overlapping windows count once."""
        turn = sure_turn(found[::_WINDOW], expected[::_WINDOW])
        if turn.interval > _ANY_TURN:
            self.report(f"these motions do not determine the mounting of {unit.name}")
            return
        self.measure("interval of the turn of its mounting (99 %)", turn.interval, "deg")
        hint = (
            f"{unit.name} is misaligned by {turn.angle:.1f} ± {turn.interval:.2f} deg about "
            f"({', '.join(f'{part:.2f}' for part in turn.axis)}) of its frame {unit.frame}; "
            f"{likely_causes('orientation')}"
        )
        self.measure("turn of its mounting", turn.angle, "deg", high=self.max_turn + turn.interval, hint=hint)


_CATEGORIES = (SensorCategory.GYROSCOPE, SensorCategory.ACCELEROMETER)
