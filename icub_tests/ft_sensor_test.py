"""Force-torque sensors: they show what hangs at them, with the noise that a living sensor has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing import likely_causes
from rtf.robot_testing.sensor_streams import readings_of
from rtf.robot_testing.stream_test import RateTest
from rtf.robot_testing.weights import WeightModel, parts_above
from rtf.simulator.errors import MissingPackageError
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

_CHANNELS = 6
_NAMES = ("force x", "force y", "force z", "torque x", "torque y", "torque z")
_UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")
_ENDING = "/analog:o"


class FtSensorTest(RateTest):
    """Reads a sensor for a while; its mean is compared with a known load, its noise with what is usual.

    The known load is given, or it is what the model of the robot says of the weight beyond the sensor in the posture
    that the robot is in. The robot should stand still and touch nothing there.
    """

    aliases = ("ftSensorTest", "FtSensor", "ftsensor", "ftSensorTests", "ftsensor-tests")
    tags = ("sensors", "force-torque")

    port = Parameter(str, "the sensor's port; none: all of the robot", default="", key="portname", aliases=("port",))
    time = Parameter(float, "how long it is read", unit="s", default=1.0, low=0.1)
    frequency = Parameter(float, "its rate", unit="Hz", default=100.0, low=0.01)
    frequency_tolerance = Parameter(float, "how far off the rate may be", unit="Hz", default=5.0, low=0.0)
    expected = Parameter(
        list[float], "three forces (N) and three torques (Nm) that it should show; none: by the model", default=[]
    )
    use_model = Parameter(bool, "ask the model of the robot where nothing is given", default=True)
    # Strain-gauge sensors of this kind drift by a few N with temperature and mounting.
    force_tolerance = Parameter(float, "how far off a force may be", unit="N", default=5.0, low=0.0)
    torque_tolerance = Parameter(float, "how far off a torque may be", unit="Nm", default=1.0, low=0.0)
    least_noise = Parameter(float, "standard deviation of each axis that a living sensor has", default=1e-6, low=0.0)
    force_noise = Parameter(float, "greatest standard deviation of a force", unit="N", default=0.5, low=0.0)
    torque_noise = Parameter(float, "greatest standard deviation of a torque", unit="Nm", default=0.05, low=0.0)
    saturation = Parameter(float, "a force of this size is beyond what it measures", unit="N", default=1000.0, low=0.0)

    def setup(self) -> None:
        """Find the sensors."""
        super().setup()
        self.assert_error_if_false(
            len(self.expected) in (0, _CHANNELS), f"expected has {len(self.expected)} values; give six, or none"
        )
        self.ports = [self.port] if self.port else self._sensors()
        self.assert_error_if_false(
            self.ports, f"the name server knows no force-torque sensor of /{self.robot_name}; give its port as portname"
        )

    def _sensors(self) -> list[str]:
        """The ports of which the robot's structure says that they are force-torque sensors'."""
        return [name for name in self.known_ports(_ENDING) if parts_above(self._place(name))]

    def _place(self, port: str) -> str:
        return port.removesuffix(_ENDING).rpartition("/")[2]

    def run(self) -> None:
        """Read all of them at the same time, and judge each."""
        there = [name for name in self.ports if self.open_stream(name, keep=True)]
        if there:
            self.listen(self.time)
        for name in there:
            with self.subresult(name):
                self._judge(name)

    def _judge(self, name: str) -> None:
        found = self.judged(self.listener.recorders[name].messages, self.time, name)
        stream = self.judge(found, self.frequency, self.frequency_tolerance)
        values = readings_of(name, [message.data for message in stream.messages], self.network.dialect)
        self.assert_equal(values.shape[1], _CHANNELS, f"numbers in a message of {name}")
        self.assert_true(np.isfinite(values).all(), f"{name} tells of {_not_finite(values)} values that are no numbers")
        times = stream.times - stream.times[0]
        self.record(
            "force and torque",
            time=(times, "s"),
            **{axis.replace(" ", "_"): (values[:, k], _UNITS[k]) for k, axis in enumerate(_NAMES)},
        )
        self._judge_noise(name, values)
        self._judge_load(name, values.mean(axis=0))

    def _judge_noise(self, name: str, values: FloatArray) -> None:
        self.measure("greatest force", float(np.abs(values[:, :3]).max()), "N", high=self.saturation)
        for axis, (what, symbol) in enumerate(zip(_NAMES, _UNITS, strict=True)):
            high = self.force_noise if symbol == "N" else self.torque_noise
            deviation = float(values[:, axis].std(ddof=1))
            dead = f"does not change at all; {likely_causes('sensor frozen')}"
            loud = f"is noisy; {likely_causes('noise')}"
            hint = f"{name}: {what} {dead if deviation < self.least_noise else loud}"
            self.measure(f"noise of {what}", deviation, symbol, low=self.least_noise, high=high, hint=hint)

    def _judge_load(self, name: str, mean: FloatArray) -> None:
        expected = self._expected(name)
        for axis, (what, symbol) in enumerate(zip(_NAMES, _UNITS, strict=True)):
            tolerance = self.force_tolerance if symbol == "N" else self.torque_tolerance
            if expected is None:
                self.measure(what, mean[axis], symbol)
                continue
            low, high = expected[axis] - tolerance, expected[axis] + tolerance
            hint = (
                f"{name} does not show the weight that hangs at it: {what} by {mean[axis] - expected[axis]:+.2f} "
                f"{symbol}; {likely_causes('offset')}"
            )
            self.measure(what, mean[axis], symbol, low, high, hint=hint)

    def _expected(self, name: str) -> FloatArray | None:
        """The load; None where nobody knows it."""
        if self.expected:
            return np.array(self.expected)
        place = self._place(name)
        if not self.use_model or not parts_above(place):
            self.report(f"no load is known for {name}: its mean is not judged")
            return None
        try:
            model = WeightModel()
        except MissingPackageError as error:
            self.report(f"no load is known for {name}, its mean is not judged: {error}")
            return None
        for part_name in parts_above(place):
            part = self.open_part(part_name)
            model.set(part.names, part.board.encoders())
        return model.load(place)


def _not_finite(values: FloatArray) -> int:
    return int((~np.isfinite(values)).sum())
