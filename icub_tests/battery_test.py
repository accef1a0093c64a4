"""Battery: its readings are within bounds, and its charge falls by what its current draws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.interfaces import BatteryStatus
from rtf.robot.sensors.battery import BATTERY_READING, DATA, FULL
from rtf.robot_testing import likely_causes
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.stream_test import StreamTest
from rtf.robot_testing.streams.stream_statistics import stream_of
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model.file import Battery

#: The least expected change of the charge, in steps of the gauge: less is lost in the rounding of both ends.
_STEPS = 5.0


class BatteryTest(StreamTest):
    """Compares the charge that a battery loses with the charge that its current draws, and checks its readings.

    Capacity, voltages and greatest current are those of ``[sensors.battery]`` in the robot's robot.toml. The battery
    may be discharged or charged, but its charge has to change: while it is at rest, or if the test is too short for
    the steps in which the charge is shown, the test is inconclusive, and says how long it has to last.
    """

    aliases = ("batteryTest", "battery-test")
    tags = ("sensors", "battery")
    judged_sensors = ("battery",)

    port = Parameter(str, "the port of the readings; none: that of the model", default="", aliases=("portname",))
    time = Parameter(float, "how long it is read", unit="s", default=10.0, low=1.0)
    # A battery with 80 % of its capacity, the usual end of its life, loses 25 % more than a new one.
    tolerance = Parameter(
        float, "tolerance of the lost charge, of the charge drawn", unit="%", default=20.0, low=0.0, high=100.0
    )
    voltage_tolerance = Parameter(float, "tolerance of the voltage limits", unit="%", default=2.0, low=0.0)
    # The range in which the makers of lithium-ion cells allow them to be discharged.
    coldest = Parameter(float, "lowest temperature", unit="degC", default=-20.0)
    hottest = Parameter(float, "highest temperature", unit="degC", default=60.0)

    def setup(self) -> None:
        """Find the battery."""
        super().setup()
        model = robot_model(self)
        battery = model.sensors.battery
        if battery is None:
            self.assert_error(f"{model.name} has no battery; if it does, write [sensors.battery] into {model.folder}")
        self.battery: Battery = battery
        self.port_name = self.port or f"/{self.robot_name}/{battery.port}/{DATA}"

    def run(self) -> None:
        """Read it for some time, and judge the readings."""
        if self.open_stream(self.port_name, keep=True):
            self.listen(self.time, arrivals=False)
            with self.subresult(self.port_name):
                self._judge()

    def _judge(self) -> None:
        found = self.judged(self.listener.recorders[self.port_name].messages, self.time, self.port_name)
        stream = stream_of(found)
        readings = [BATTERY_READING.decode(one.data, one.dialect) for one in stream.messages]
        numbers = np.array([reading[:-1] for reading in readings])
        self.assert_true(np.isfinite(numbers).all(), "the readings have values that are not finite")
        steps = np.diff(stream.times)
        self.assert_fail_if_true((steps <= 0.0).any(), "the stamps go back, or stand still between two messages")
        charge, voltage, current, temperature = numbers.T
        self.record(
            "battery",
            time=(stream.times - stream.times[0], "s"),
            charge=(charge, "%"),
            voltage=(voltage, "V"),
            current=(current, "A"),
            temperature=(temperature, "degC"),
        )
        self._judge_bounds(charge, voltage, current, temperature)
        self._judge_status({reading.status for reading in readings})
        drawn = float(((current[1:] + current[:-1]) / 2.0 * steps).sum())  # As
        self._judge_charge(numbers, FULL * drawn / self.battery.ampere_seconds)

    def _judge_bounds(
        self, charge: FloatArray, voltage: FloatArray, current: FloatArray, temperature: FloatArray
    ) -> None:
        battery, share = self.battery, self.voltage_tolerance / 100.0
        self.measure("lowest charge", float(charge.min()), "%", low=0.0)
        self.measure("highest charge", float(charge.max()), "%", high=FULL)
        low, high = battery.empty * (1.0 - share), battery.full * (1.0 + share)
        causes = likely_causes("battery voltage")
        self.measure("lowest voltage", float(voltage.min()), "V", low=low, hint=f"an empty battery has more; {causes}")
        self.measure("highest voltage", float(voltage.max()), "V", high=high, hint=f"a full one has less; {causes}")
        greatest = float(np.abs(current).max())
        self.measure("greatest current", greatest, "A", high=battery.max_current, hint="more than the battery may give")
        self.measure("lowest temperature", float(temperature.min()), "degC", low=self.coldest)
        self.measure("highest temperature", float(temperature.max()), "degC", high=self.hottest)

    def _judge_status(self, shown: set[BatteryStatus]) -> None:
        for status in sorted(shown):
            name = status.name.lower()
            self.check_fail_if_true(
                status in (BatteryStatus.ERROR, BatteryStatus.TIMEOUT), f"the status of the battery was {name}"
            )
            if status in (BatteryStatus.LOW, BatteryStatus.CRITICAL):
                self.warn(f"the charge of the battery is {name}")

    def _judge_charge(self, numbers: FloatArray, expected: float) -> None:
        """Compare the lost charge with the ``expected`` one, in per cent of a full battery."""
        lost, step = float(numbers[0, 0] - numbers[-1, 0]), self.battery.charge_step
        least = _STEPS * step
        self.measure("charge drawn", expected, "%")
        self.measure("charge lost", lost, "%")
        if abs(expected) < least:
            needed = f"{self.time * least / abs(expected):.0f} s would be enough" if expected else "it is at rest"
            self.inconclusive(
                f"the battery gave {expected:.3g} % of its charge, less than {_STEPS:g} steps of {step:g} %: {needed}"
            )
        self.assert_fail_if_true(
            (np.ptp(numbers, axis=0) == 0.0).all(),
            f"the battery repeats one reading while it gives {expected:.3g} % of its charge; "
            f"{likely_causes('sensor frozen')}",
        )
        rounding, causes = FULL * step / abs(expected), likely_causes("battery charge")
        self.measure(
            "charge lost, of the charge drawn",
            100.0 * lost / expected,
            "%",
            low=100.0 - self.tolerance - rounding,
            high=100.0 + self.tolerance + rounding,
            hint=f"the battery lost {lost:.3g} % while its current drew {expected:.3g} %; {causes}",
        )
