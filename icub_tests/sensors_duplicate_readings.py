"""Sensors, duplicate readings: each message of a sensor has a new measurement."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.bottle import Bottle
from rtf.robot.interfaces import SensorCategory
from rtf.robot_testing import likely_causes
from rtf.robot_testing.stream_test import StreamTest
from rtf.robot_testing.streams.sensor_streams import channels_of, readings_of
from rtf.robot_testing.streams.stream_statistics import stream_of
from rtf.testing import Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.bottle import Value
    from rtf.robot.interfaces import FloatArray

_ENDINGS = ("/analog:o", "/measures:o", "/inertial")
#: Sensors whose values may be constant for seconds, as the measured quantity is and their resolution is coarse.
_AT_REST = tuple(
    f" {category.name.lower()}"
    for category in (SensorCategory.ORIENTATION, SensorCategory.TEMPERATURE, SensorCategory.MAGNETOMETER)
)

#: Risk of more equal values by chance than are allowed for, and the normal deviation with this risk.
_RARE, _BEYOND = 1e-6, 4.75
#: Rounds of an iteration for the share of rows that are equal, and the feedback in it beyond which it means nothing.
_ROUNDS, _UNSURE = 100, 0.9
#: Terms of a sum whose rest is below rounding.
_MANY = 40.0


class _Tolerated(NamedTuple):
    name: str
    duplicates: int


class SensorsDuplicateReadings(StreamTest):
    """Records sensors, and counts repeated messages, repeated values, and channels that never change.

    A sensor that repeats every value equally often is slower than its publisher; one that repeats values now and then
    loses readings.
    """

    aliases = ("SensorsDuplicateRd", "sensorsDuplicateReadings", "sensors-duplicate-readings")
    tags = ("streams", "sensors")
    judged_sensors = ("force_torque", "inertial", "angles")

    port = Parameter(str, "one port; none: those of ports", default="", aliases=("portname",))
    ports = Parameter(
        Bottle, "the ports: (name duplicates), with the number of tolerated duplicates", default=Bottle(),
        key="PORTS", aliases=("ports",),
    )  # fmt: skip
    # As in the parameter files of the iCub.
    tolerated = Parameter(int, "default number of tolerated duplicates", default=0, low=0)
    time = Parameter(float, "how long the ports are recorded", unit="s", default=2.0, low=0.1)
    # As in the original: smaller differences are rounding errors of numbers with 16 digits.
    same = Parameter(float, "greatest relative difference of equal values", default=1e-12, low=0.0)

    def setup(self) -> None:
        """Choose the ports."""
        super().setup()
        self.expected = self._expected()
        self.assert_error_if_false(
            self.expected,
            f"no sensor of /{self.robot_name} is registered at the name server; name their ports in [PORTS]",
        )

    def _expected(self) -> list[_Tolerated]:
        if self.port:
            return [_Tolerated(self.port, self.tolerated)]
        if len(self.ports):
            return [self._line(line) for line in self.lines(self.ports)]
        return [_Tolerated(name, self.tolerated) for name in self.known_ports(*_ENDINGS)]

    def _line(self, parts: list[Value]) -> _Tolerated:
        # Older files have a third number, the rate, which this test ignores.
        if isinstance(parts[0], str) and len(parts) > 1 and isinstance(parts[1], int) and parts[1] >= 0:
            return _Tolerated(parts[0], parts[1])
        return self.assert_error(
            f"[PORTS] {Bottle(parts).to_text()}: a line has a port and the number of tolerated duplicates, such as: "
            "/icub/left_arm/analog:o 0"
        )

    def run(self) -> None:
        """Record all ports, and judge each."""
        there = [one for one in self.expected if self.open_stream(one.name, keep=True)]
        if there:
            self.listen(self.time, arrivals=False)
        for one in there:
            with self.subresult(one.name):
                self._judge(one)

    def _judge(self, one: _Tolerated) -> None:
        found = self.judged(self.listener.recorders[one.name].messages, self.time, one.name)
        stream = stream_of(found)
        twice = f"{stream.duplicates} messages came again, with the same number"
        self._measure("messages that came twice", stream.duplicates, "count", one.duplicates, twice)
        self.judge_stamps(stream, one.duplicates)
        values = readings_of(one.name, stream.messages)
        self.assert_true(values.shape[1] > 0, "the messages have no measurement")
        self._judge_values(one, values, stream.times)

    def _judge_values(self, one: _Tolerated, values: FloatArray, times: FloatArray) -> None:
        scale = np.maximum(np.abs(values).max(axis=0), np.finfo(float).tiny)
        same = np.abs(np.diff(values, axis=0)) <= self.same * scale
        repeats = same.all(axis=1)
        fresh = np.concatenate([[True], ~repeats])
        self._record_ages(fresh, times)
        runs, total, most = _runs(repeats), int(repeats.sum()), one.duplicates
        if chance := _by_chance(same):
            self.measure("values that may be equal by chance", chance, "count")
            most += chance
        if total > most and values.any() and np.array_equal(values, np.rint(values)):
            self.inconclusive(
                f"{total} of {len(values)} values are repeated: whole numbers may be constant; move the robot, or "
                "tolerate duplicates in [PORTS]"
            )
        why = _pattern(runs)
        self._measure("share of repeated values", 100.0 * total / len(repeats), "%", 100.0 * most / len(repeats), why)
        self._measure("longest run of one value", max(runs), "count", most + 1, why)
        # The longest time if all tolerated duplicates come in a row.
        longest = 1e3 * float(np.diff(times).max()) * (most + 1)
        without = 1e3 * float(np.diff(times[fresh], append=times[-1]).max())
        self._measure("longest time without a new value", without, "ms", longest, why)
        self._measure("values that came twice", total, "count", most, why)
        self._judge_channels(one.name, values)

    def _record_ages(self, fresh: NDArray[np.bool_], times: FloatArray) -> None:
        """Record the age of each value: 0 for a new one, a sawtooth for a sensor that is slower than its port."""
        last = np.maximum.accumulate(np.where(fresh, np.arange(len(fresh)), 0))
        self.record("age of the values", time=(times - times[0], "s"), age=(1e3 * (times - times[last]), "ms"))

    def _measure(self, name: str, value: float, symbol: str, most: float, why: str) -> None:
        self.measure(name, value, symbol, high=most, hint=f"{why}; {likely_causes('duplicate')}")

    def _judge_channels(self, port: str, values: FloatArray) -> None:
        names = channels_of(self.network, port, values.shape[1])
        nothing = [name for name, column in zip(names, values.T, strict=True) if not np.isfinite(column).all()]
        self.assert_fail_if_true(nothing, f"{', '.join(nothing)} of {port} sends values that are not finite")
        still: NDArray[np.bool_] = np.ptp(values, axis=0) == 0.0
        absent = still & (values[0] == 0.0) & (not still.all())  # servers send zeros for sensors that a unit lacks
        sensors = [name.rpartition(" ")[0] for name in names]
        living = {sensor for sensor, dead in zip(sensors, still, strict=True) if not dead}
        odd: list[str] = []
        stuck: list[str] = []
        for name, sensor, dead, gone in zip(names, sensors, still, absent, strict=True):
            if dead:
                (odd if gone or sensor in living or sensor.endswith(_AT_REST) else stuck).append(name)
        if odd:
            self.warn(f"constant: {', '.join(odd)}; a coarse resolution at rest, or a sensor that the unit lacks")
        self.check_fail_if_true(
            stuck,
            f"{', '.join(stuck)} of {port} never changed in {len(values)} messages; {likely_causes('sensor frozen')}",
        )


def _by_chance(same: NDArray[np.bool_]) -> int:
    """Return how many values of a sensor with a coarse resolution may equal the one before without a fault.

    ``same`` says which channels (columns) equal those before. Channels whose noise is some counts are equal now and
    then, each on its own, and all of them with the product of their shares. The shares follow from the rows that differ
    in some channel, which rows that are repeated do not change: ``p = q + (1 - q) P``, if *q* is the share of a channel
    in those rows, and *P* that of the other rows, the product. Beyond the returned number there are more in one of a
    million recordings, by chance and by the error of the shares.
    """
    changed = same[~same.all(axis=1)]
    differs = 1.0 - changed.mean(axis=0) if len(changed) else np.ones(same.shape[1])
    if (differs == 1.0).any():
        return 0
    together = 0.0
    for _ in range(_ROUNDS):
        together = float(np.prod(1.0 - differs * (1.0 - together)))
    shares = 1.0 - differs * (1.0 - together)
    feedback = together * float((differs / shares).sum())
    if feedback > _UNSURE:
        return len(same)
    errors = (1.0 - together) / shares * np.sqrt((1.0 - differs) * differs / len(changed)) / (1.0 - feedback)
    mean = len(same) * together * math.exp(_BEYOND * float(np.linalg.norm(errors)))
    if mean >= len(same):
        return len(same)
    return next(count for count in itertools.count(math.floor(mean)) if _more(count, mean) <= _RARE)


def _more(count: int, mean: float) -> float:
    """Return the probability of more than ``count`` of rare events of which there are ``mean`` (Poisson)."""
    most = count + math.ceil(_MANY + 10.0 * math.sqrt(mean))
    return math.fsum(math.exp(k * math.log(mean) - mean - math.lgamma(k + 1.0)) for k in range(count + 1, most))


def _runs(repeats: NDArray[np.bool_]) -> list[int]:
    """Return the lengths of the runs of equal values; the first and the last run, which are cut off, only if alone."""
    ends = np.flatnonzero(~repeats)
    if ends.size < 2:  # noqa: PLR2004 - between two ends is the first whole run
        return [len(repeats) + 1 - ends.size]
    return [int(length) for length in np.diff(ends)]


def _pattern(runs: list[int]) -> str:
    if len(runs) == 1:
        return "the value never changed"
    if min(runs) == max(runs) > 1:
        return f"each value comes {runs[0]} times: the sensor is {runs[0]} times slower than its publisher"
    return f"values come 1 to {max(runs)} times, irregularly: readings of the sensor get lost"
