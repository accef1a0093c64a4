"""The battery of a simulated robot, which its motors and its electronics discharge.

A motor with the duty cycle *d* and the current *i* draws *d i* from the battery, as its bridge connects it for that
share of the time; the electronics draw a constant power. The voltage is that of a source behind a resistance, and the
voltage of the source falls in proportion to the charge. Braking motors do not charge the battery; self-discharge and
the influence of the temperature are not modelled.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.device import Device
from rtf.robot.interfaces import BatteryStatus, IBattery
from rtf.robot.sensors.battery import FULL, BatteryReading, status_of
from rtf.simulator.board_state import AMBIENT
from rtf.simulator.position_gains import FULL as FULL_DUTY

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Property
    from rtf.robot.model.file import Battery
    from rtf.simulator.simulation import Simulation

#: Seconds between two measurements, and between two messages: with one period, each message has a new measurement.
BATTERY_PERIOD = 0.05
_SEED = 0xBA77


class SimulatedBattery(Device, IBattery):
    """The battery. The simulation calls ``publish`` regularly; reading it in between gives the last measurement.

    It has random numbers of its own, so the noise of the other sensors does not depend on it.
    """

    period = BATTERY_PERIOD

    def __init__(self, settings: Battery, simulation: Simulation) -> None:
        super().__init__("battery")
        self.settings = settings
        self.simulation = simulation
        self.capacity = settings.ampere_seconds
        #: Faults: shares of the capacity that are left, and functions that change a reading at a time (s).
        self.weaknesses: list[float] = []
        self.faults: list[Callable[[BatteryReading, float], BatteryReading]] = []
        self._begin_anew()
        simulation.on_reset.append(self._begin_anew)

    def _begin_anew(self) -> None:
        """Replace the battery by a charged one, from which the motors draw nothing yet."""
        self._random = np.random.default_rng([self.simulation.seed, _SEED])
        self.left = self.settings.charge / FULL  # a share
        self._measured_at = self.simulation.now
        self.reading = self._measured(*self._electrical(0.0))

    def publish(self, now: float) -> None:
        """Discharge the battery by the present current since the last call, and measure."""
        seconds, self._measured_at = now - self._measured_at, now
        boards = self.simulation.boards
        drawn = boards.motor_duties() * boards.motors.drawn() / FULL_DUTY
        voltage, current = self._electrical(float(np.maximum(drawn, 0.0).sum()))
        self.left = max(0.0, self.left - current * seconds / (self.capacity * math.prod(self.weaknesses)))
        reading = self._measured(voltage, current)
        for fault in self.faults:
            reading = fault(reading, now)
        self.reading = reading

    def _electrical(self, motors: float) -> tuple[float, float]:
        """Return the voltage at the terminals (V) and the current (A), of which the motors draw ``motors``."""
        settings = self.settings
        source = settings.empty + (settings.full - settings.empty) * self.left
        # The voltage v under a constant power p and a constant current i: v = source - resistance * (i + p / v).
        loaded = source - settings.resistance * motors
        root = loaded * loaded - 4.0 * settings.resistance * settings.idle_power
        voltage = max((loaded + math.sqrt(max(root, 0.0))) / 2.0, settings.empty / 2.0)
        return voltage, motors + settings.idle_power / voltage

    def _measured(self, voltage: float, current: float) -> BatteryReading:
        settings = self.settings
        noise = self._random.standard_normal(2)
        charge = min(round(FULL * self.left / settings.charge_step) * settings.charge_step, FULL)
        return BatteryReading(
            charge=charge,
            voltage=voltage + settings.voltage_noise * float(noise[0]),
            current=current + settings.current_noise * float(noise[1]),
            temperature=AMBIENT,
            status=status_of(charge, current),
        )

    def open(self, configuration: Property) -> None:
        """Do nothing: it is open from its construction."""

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def voltage(self) -> float:
        return self.reading.voltage

    def current(self) -> float:
        return self.reading.current

    def charge(self) -> float:
        return self.reading.charge

    def temperature(self) -> float:
        return self.reading.temperature

    def battery_status(self) -> BatteryStatus:
        return self.reading.status

    def battery_info(self) -> str:
        one = self.settings
        return f"a simulated battery of {one.capacity:g} Wh, {one.empty:g} to {one.full:g} V"
