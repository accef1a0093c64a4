"""The motors of a simulated robot: from what the controllers want to currents in windings, and from these to torques.

The controllers write the torques that they want at the axes (``Motors.wanted``). The amplifier of each motor turns its
share of them into a current, or into the voltage that drives that current at rest, and the winding obeys
:mod:`rtf.robot.model.drives`: a turning motor induces a voltage against its amplifier. So one that is fed with a
voltage has less current the faster it turns, and none beyond the speed at which it induces as much; one whose current
is controlled keeps its current as long as the supply has room for it. A motor that is turned faster than its supply
allows generates a current that brakes it.

Axes and motors are two things: the rows of most matrices are motors, their columns axes. With the coupling *C*, the
torque constants *k* and the turns *n* of the gears, ``(k n)[:, None] * C`` times the speeds of the axes are the induced
voltages, and its transpose times the currents the torques at the axes: what the one takes from a circuit, the other
gives to the mechanics.

Left out: inductance, cogging, the losses of gears and amplifiers, resistance that grows with the temperature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import maximum, minimum, subtract

from rtf.simulator.gears import Gears
from rtf.simulator.position_gains import FULL

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.plant import Plant

#: Steps between two computations of the bounds of the currents, which follow the speeds.
_BOUND = 4
#: Random numbers of the current sensors; a prime, so that it takes as many steps until they come again.
_DRAWN = 8191
_SEED = 0xC0_11


@dataclass(slots=True)
class Windings:
    """The circuits as they are, to be changed in place by faults; a column for each motor."""

    constants: FloatArray  # Nm/A behind the gear
    conductances: FloatArray  # 1/Ohm, 0 of an open circuit
    connected: NDArray[np.intp]  # the motor that each amplifier feeds
    upwards: FloatArray  # the share of its voltage that each amplifier gives, to either side
    downwards: FloatArray


class Motors:
    """All motors. ``step`` is called in every step of the simulation; faults call ``refresh`` when they change."""

    def __init__(self, plant: Plant, data: Any, seed: int = 0) -> None:
        axes = plant.robot.axes
        count = len(axes)
        drives = [axis.drive for axis in axes]
        self.supply = np.array([drive.supply for drive in drives])  # V
        self.resistance = np.array([drive.resistance for drive in drives])  # Ohm
        self.by_voltage = np.array([drive.kind == "voltage" for drive in drives])
        self.current_step = np.array([drive.current_step for drive in drives])  # A
        self._couplings = plant.robot.joint_to_motor
        constants = np.array([drive.output_constant for drive in drives])
        #: Torques at the axes, a column for each ampere of a motor, as the boards know them; and the inverse.
        self._nominal_torques = self._couplings.T * constants
        self._demands = np.linalg.inv(self._nominal_torques)
        self._constants = constants * plant.unit.factors("torque constant", count)
        self._noise = np.random.default_rng([seed, _SEED]).standard_normal(_DRAWN + count)
        self._noise_size = np.array([drive.current_noise for drive in drives])  # A
        #: Active faults: functions that change their argument. Empty in a healthy robot.
        self.faults: list[Callable[[Windings], None]] = []
        self.short_circuits = np.zeros(count)  # A, beside the windings
        plant.model.actuator_ctrllimited[:] = 0  # amplifiers limit currents, and supplies voltages
        self.gears = Gears(plant, data)
        self._speeds: FloatArray = data.actuator_velocity
        self._ctrl: FloatArray = data.ctrl
        self._inputs = np.zeros(2 * count)
        self.wanted, self._turning = self._inputs[:count], self._inputs[count:]  # Nm, rad/s of the axes
        self.current = np.zeros(count)  # A
        self._least, self._most = np.zeros(count), np.zeros(count)  # A
        self._induced, self._lowest, self._highest = np.zeros(count), np.zeros(count), np.zeros(count)
        self._fed = np.zeros(count, dtype=bool)  # by a voltage, now
        self._duty = np.full(count, FULL)  # the greatest duty cycles, per cent
        self._peak = np.array([axis.peak_current for axis in axes])  # A, of those whose currents are controlled
        self.refresh()

    # What boards know of them -------------------------------------------------------------------------------------

    def damping(self) -> FloatArray:
        """Return the damping of each axis by motors that are fed with a voltage, Nm s/rad."""
        found: FloatArray = self._nominal_torques**2 @ (self.by_voltage / self.resistance)
        return found

    def torques_of(self, currents: FloatArray) -> FloatArray:
        """Return the torques at the axes (Nm) for currents of the motors (A), as the boards compute them."""
        torques: FloatArray = self._nominal_torques @ currents
        return torques

    def blocked_currents(self, duties: FloatArray) -> FloatArray:
        """Return the currents (A) that duty cycles (per cent) drive through motors at rest."""
        currents: FloatArray = duties * self.supply / (FULL * self.resistance)
        return currents

    # How they are fed, and what is broken -------------------------------------------------------------------------

    def feed(self, motor: int, *, voltage: bool, duty: float, peak: float) -> bool:
        """Feed a motor with a voltage from now on, or with a current of at most ``peak`` (A).

        ``duty`` is its greatest duty cycle (per cent). Return whether that is a change, which needs a :meth:`refresh`;
        most calls change nothing, as boards apply all settings of an axis together.
        """
        changed = (self._fed[motor], self._duty[motor], self._peak[motor]) != (voltage, duty, peak)
        self._fed[motor], self._duty[motor], self._peak[motor] = voltage, duty, peak
        return changed

    def refresh(self) -> None:
        """Compute the matrices anew: a fault of a motor has begun or ended, or one is fed otherwise."""
        count = len(self._fed)
        one = Windings(self._constants.copy(), 1.0 / self.resistance, np.arange(count), np.ones(count), np.ones(count))
        for fault in self.faults:
            fault(one)
        self._conductance = one.conductances[one.connected]
        self._to_voltages = np.ascontiguousarray((one.constants[:, None] * self._couplings)[one.connected])
        self._to_torques = np.ascontiguousarray(self._to_voltages.T)
        braking = self._conductance[:, None] * self._to_voltages
        shares = np.where(self._fed, self.resistance * self._conductance, 1.0)
        self._to_currents = np.hstack([shares[:, None] * self._demands, -(self._fed[:, None] * braking)])
        self._braking = braking
        #: The voltages that amplifiers which control their currents add to what a motor at rest needs.
        self._compensated = ~self._fed[:, None] * self._to_voltages
        controlled, whole = ~self._fed, self._conductance > 0.0
        self._open = np.flatnonzero(controlled & ~whole)  # their currents cannot be controlled
        #: What amplifiers need for a current, Ohm: those that control it see the circuit as it is.
        self._ohms = np.divide(1.0, self._conductance, out=self.resistance.copy(), where=controlled & whole)
        self._upwards, self._downwards = one.upwards, one.downwards
        self._uneven = bool((one.upwards != 1.0).any() or (one.downwards != 1.0).any())
        blocked = self.supply * self._duty / FULL * self._conductance  # A
        self._blocked = -blocked * self._downwards, blocked * self._upwards
        most = np.where(self._fed, np.inf, self._peak)
        self._controlled = -most, most
        self._bound()

    # A step -------------------------------------------------------------------------------------------------------

    def step(self, tick: int) -> None:
        """Drive the axes by the wanted torques. Without allocations: it is called a thousand times a second."""
        current = self.current
        self._turning[:] = self._speeds
        if len(self.gears.flexible):
            self.gears.turn(self._turning)
        np.dot(self._to_currents, self._inputs, out=current)
        if not tick % _BOUND:
            self._bound()
        if self._uneven:
            self._weaken()
        minimum(current, self._most, out=current)
        maximum(current, self._least, out=current)
        np.dot(self._to_torques, current, out=self._ctrl)
        if len(self.gears.flexible):
            self.gears.step(self._ctrl)

    def _bound(self) -> None:
        """Compute the bounds of the currents from the supply, and of controlled ones from the peak currents, too.

        A motor that induces more than its supply has a current that nothing but its winding limits.
        """
        induced, lowest, highest = self._induced, self._lowest, self._highest
        np.dot(self._braking, self._turning, out=induced)
        subtract(self._blocked[0], induced, out=lowest)
        subtract(self._blocked[1], induced, out=highest)
        minimum(highest, self._controlled[1], out=self._most)
        maximum(lowest, self._most, out=self._most)
        maximum(lowest, self._controlled[0], out=self._least)
        minimum(highest, self._least, out=self._least)

    def _weaken(self) -> None:
        """Take from the currents of motors that are fed with a voltage what uneven amplifiers do not give."""
        asked = self.resistance * (self._demands @ self.wanted)  # V
        given = asked * np.where(asked > 0.0, self._upwards, self._downwards)
        self.current += self._fed * (given - asked) * self._conductance

    def rest(self, torques: FloatArray) -> None:
        """Exert torques at axes at rest, before the first step (Nm)."""
        self.wanted[:] = torques
        self.step(0)
        if len(self.gears.flexible):
            self.gears.rest(torques)

    # What the boards measure --------------------------------------------------------------------------------------

    def duties(self, powered: FloatArray) -> FloatArray:
        """Return the commanded duty cycles of the amplifiers in the last step (per cent); 0 of those without power.

        One that controls its current raises it until the current flows, and to the limit if none can.
        """
        demanded = self._demands @ self.wanted
        minimum(demanded, self._controlled[1], out=demanded)
        maximum(demanded, self._controlled[0], out=demanded)
        volts: FloatArray = self._ohms * demanded + self._compensated @ self._turning
        if self._uneven:
            shares = np.where(volts > 0.0, self._upwards, self._downwards)
            volts /= np.where(self._fed, 1.0, np.maximum(shares, 1.0 / FULL))
        if len(self._open):
            volts[self._open] = np.sign(demanded[self._open]) * self.supply[self._open]
        duties = volts * (FULL / self.supply)
        minimum(duties, self._duty, out=duties)
        maximum(duties, -self._duty, out=duties)
        duties *= powered
        return duties

    def drawn(self) -> FloatArray:
        """Return the currents that the motors draw, with those of short circuits (A)."""
        currents: FloatArray = self.current + self.short_circuits
        return currents

    def sensed(self, tick: int) -> FloatArray:
        """Return what healthy current sensors measure at a step (A): with noise, and before they count in steps.

        The noise of a step is the same for every caller, however often it is asked for.
        """
        count = len(self.current)
        first = tick * count % _DRAWN
        found: FloatArray = self.drawn()
        found += self._noise[first : first + count] * self._noise_size
        return found
