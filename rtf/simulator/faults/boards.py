"""Faults of the motor boards: commands, modes, configuration."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

from rtf.robot.control_modes import REQUESTS, ControlMode
from rtf.simulator.faults.base import AxisFault, Layer, Parameter
from rtf.simulator.faults.moments import RandomMoments

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray, Pid


class _LostCommands(AxisFault):
    """A fault in which a board does not take commands of a joint."""

    layer = Layer.BOARD

    def begin(self) -> None:
        self.boards.command_faults.append(self._of_axis)

    def end(self) -> None:
        self.boards.command_faults.remove(self._of_axis)

    def _of_axis(self, what: str, axis: int, now: float) -> bool:
        del now
        return axis == self.axis and self.loses(what)

    def loses(self, what: str) -> bool:
        """Return whether a command is lost."""
        raise NotImplementedError


class MissedCommand(_LostCommands):
    """Loss of some commands of a joint."""

    kind = "missed_command"
    description = "The board loses every n-th command."
    symptom = "Some moves do not begin."
    parameters = (Parameter("every", 2.0, "", "n; 1: all commands are lost", 1.0, 1e6, healthy=None),)
    every: float

    def begin(self) -> None:
        self._count = 0
        super().begin()

    def loses(self, what: str) -> bool:
        del what
        self._count += 1
        return self._count % max(1, round(self.every)) == 0


class StopIgnored(_LostCommands):
    """Commands to stop that do nothing."""

    kind = "stop_ignored"
    description = "The board does not take commands to stop."
    symptom = "A move goes on to its target, although a client, a guard or an operator stops it."

    def loses(self, what: str) -> bool:
        return what == "stop"


class CommandOfAnyMode(AxisFault):
    """Acceptance of commands that the mode of the joint does not take."""

    kind = "command_of_any_mode"
    layer = Layer.BOARD
    description = "As long as the board controls the position of a joint, it takes the commands of all modes."
    symptom = "A joint obeys a command that its mode does not take, so a client that has lost the joint still moves it."

    def begin(self) -> None:
        self.boards.obeying_faults.append(self._obeys)

    def end(self) -> None:
        self.boards.obeying_faults.remove(self._obeys)

    def _obeys(self, axis: int) -> bool:
        return axis == self.axis


class _ModeFault(AxisFault):
    """A fault in the response to mode requests."""

    layer = Layer.BOARD

    def begin(self) -> None:
        self.boards.mode_faults.append(self._of_axis)

    def end(self) -> None:
        self.boards.mode_faults.remove(self._of_axis)

    def _of_axis(self, axis: int, state: ControlMode, wanted: int) -> ControlMode | None:
        return self.decide(state, wanted) if axis == self.axis else None

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        """Return the resulting mode; None: that of a healthy board."""
        raise NotImplementedError


class FaultLeft(_ModeFault):
    """Release of a hardware fault by any mode request."""

    kind = "fault_left"
    description = "The board lets a joint leave its hardware fault for any mode, not only by a forced idle."
    symptom = "A joint in fault obeys at once, although the cause of the fault was not checked."

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        if state is ControlMode.HARDWARE_FAULT and wanted in REQUESTS and wanted != ControlMode.FORCE_IDLE:
            return ControlMode(wanted)
        return None


class ModeIgnored(_ModeFault):
    """Refusal of mode requests that are acknowledged all the same."""

    kind = "mode_ignored"
    description = "The board acknowledges a mode and stays in the present one."
    symptom = "The mode that is read back is not the requested one."

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        del wanted
        return state


class WrongMode(_ModeFault):
    """Position mode instead of torque mode."""

    kind = "wrong_mode"
    description = "The board enters position mode when torque mode is requested."
    symptom = "Torque mode is requested, position mode is read back."

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        allowed = state is not ControlMode.HARDWARE_FAULT
        return ControlMode.POSITION if wanted == ControlMode.TORQUE and allowed else None


class _WrongModeShown(AxisFault):
    """A fault in what a board says of the control mode of a joint."""

    layer = Layer.BOARD

    def begin(self) -> None:
        self.boards.shown_mode_faults.append(self.show)

    def end(self) -> None:
        self.boards.shown_mode_faults.remove(self.show)

    def show(self, shown: NDArray[np.int32], now: float) -> None:
        """Change the shown modes of all axes in place."""
        raise NotImplementedError


class ModeStale(_WrongModeShown):
    """Old control modes in all that the board says of them."""

    kind = "mode_stale"
    description = "The board changes the mode at once, and shows it late: it reads it in a slow loop, or not at all."
    symptom = "For some time after a change the mode that is read back is the one of before."
    parameters = (Parameter("age", 1.0, "s", "how old the shown modes are", 0.0, 1e6),)
    age: float

    def begin(self) -> None:
        self._modes = deque([(-math.inf, int(self.boards.mode[self.axis]))])
        super().begin()

    def show(self, shown: NDArray[np.int32], now: float) -> None:
        known = self._modes
        if shown[self.axis] != known[-1][1]:
            known.append((now, int(shown[self.axis])))
        while len(known) > 1 and known[1][0] <= now - self.age:
            known.popleft()
        shown[self.axis] = known[0][1]


class ModeFlickers(_WrongModeShown):
    """Wrong control modes for moments."""

    kind = "mode_flickers"
    description = "For moments the board says that the joint is idle, although it controls it."
    symptom = "In some states the mode is another one; clients take the joint for lost, and give up."
    parameters = (
        Parameter("length", 0.05, "s", "of a moment", 0.0, 60.0),
        Parameter("rate", 0.5, "1/s", "mean number of moments while the mode is right", 1e-3, 1e3),
    )
    length: float
    rate: float

    def begin(self) -> None:
        self._moments = RandomMoments(self.own_random(self.axis), self.rate, self.length, self.simulation.now)
        super().begin()

    def show(self, shown: NDArray[np.int32], now: float) -> None:
        if self._moments.holds(now):
            shown[self.axis] = int(ControlMode.IDLE)


class _WrongNumber(AxisFault):
    """A wrong number in the configuration of a board."""

    layer = Layer.CONFIGURATION
    restores = True

    @property
    def numbers(self) -> FloatArray:
        """The configured numbers of all axes, to be changed in place."""
        raise NotImplementedError

    def wrong(self, healthy: float) -> float:
        """The wrong number."""
        raise NotImplementedError

    def begin(self) -> None:
        self._healthy = float(self.numbers[self.axis])
        self.numbers[self.axis] = self.wrong(self._healthy)
        self.boards.refresh(self.axis)

    def end(self) -> None:
        self.numbers[self.axis] = self._healthy
        self.boards.refresh(self.axis)


class WrongGearRatio(_WrongNumber):
    """Wrong gearbox ratio in the configuration."""

    kind = "wrong_gear_ratio"
    description = "The gearbox ratio in the configuration is not that of the mechanics."
    symptom = "Joint and motor encoder disagree by the same factor everywhere."
    parameters = (Parameter("factor", 1.5, "", "by which the ratio is wrong", -10.0, 10.0, healthy=1.0),)
    factor: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.configured_gearbox

    def wrong(self, healthy: float) -> float:
        return healthy * self.factor


class WrongUpperLimit(_WrongNumber):
    """Wrong upper limit in the configuration."""

    kind = "wrong_upper_limit"
    description = "The upper limit in the configuration is not that of the mechanics."
    symptom = "The joint meets a stop before its limit, or does not use its range."
    parameters = (Parameter("by", 10.0, "deg", "how much the limit is too high; negative: too low", -360.0, 360.0),)
    by: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.maximum

    def wrong(self, healthy: float) -> float:
        return healthy + self.by


class WrongLowerLimit(WrongUpperLimit):
    """Wrong lower limit in the configuration."""

    kind = "wrong_lower_limit"
    description = "The lower limit in the configuration is not that of the mechanics."
    parameters = (Parameter("by", -10.0, "deg", "how much the limit is too high; negative: too low", -360.0, 360.0),)

    @property
    def numbers(self) -> FloatArray:
        return self.boards.minimum


class LimitsIgnored(_WrongNumber):
    """Limits that the board announces and does not enforce."""

    kind = "limits_ignored"
    layer = Layer.BOARD
    description = "The board announces its limits and does not enforce them."
    symptom = "A command beyond a limit is carried out, up to the mechanical stop."
    parameters = (Parameter("by", 5.0, "deg", "how far the joint can go beyond them", 0.0, 360.0),)
    by: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.limit_slack

    def wrong(self, healthy: float) -> float:
        return healthy + self.by


class WrongSpeed(_WrongNumber):
    """Moves at another speed than the reference speed."""

    kind = "wrong_speed"
    layer = Layer.BOARD
    description = "The board moves its joint at another speed than the reference speed that it reports."
    symptom = "Moves end too early, and joints are faster than they were told to be, or too late."
    parameters = (Parameter("factor", 2.0, "", "of the reference speed", 0.01, 100.0, healthy=1.0),)
    factor: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.speed_factors

    def wrong(self, healthy: float) -> float:
        return healthy * self.factor


class WrongCoupling(AxisFault):
    """Wrong coupling matrix in the configuration."""

    kind = "wrong_coupling"
    layer = Layer.CONFIGURATION
    restores = True
    description = "The coupling matrix in the configuration is not that of the mechanics."
    symptom = "Motor encoders disagree with the joints when a coupled neighbour moves."
    parameters = (Parameter("factor", 0.5, "", "by which the row of the joint is wrong", -10.0, 10.0, healthy=1.0),)
    factor: float

    def begin(self) -> None:
        self._healthy = self.boards.configured_couplings[self.axis].copy()
        self.boards.configured_couplings[self.axis] *= self.factor

    def end(self) -> None:
        self.boards.configured_couplings[self.axis] = self._healthy


class WrongGains(AxisFault):
    """Wrong gains of the position controller."""

    kind = "wrong_gains"
    layer = Layer.CONFIGURATION
    restores = True
    description = "The gains of the position controller are wrong."
    symptom = "Too small: the joint lags and sags. Too large: it swings and buzzes."
    parameters = (Parameter("factor", 0.05, "", "by which all gains are multiplied", 0.0, 100.0, healthy=1.0),)
    factor: float
    _healthy: Pid

    def begin(self) -> None:
        self._healthy = pid = self.boards.pids[self.axis]
        by = self.factor
        self.boards.set_pid(self.axis, pid._replace(kp=pid.kp * by, kd=pid.kd * by, ki=pid.ki * by))

    def end(self) -> None:
        self.boards.set_pid(self.axis, self._healthy)


KINDS = (
    MissedCommand,
    StopIgnored,
    CommandOfAnyMode,
    FaultLeft,
    ModeIgnored,
    WrongMode,
    ModeStale,
    ModeFlickers,
    LimitsIgnored,
    WrongSpeed,
    WrongGearRatio,
    WrongUpperLimit,
    WrongLowerLimit,
    WrongCoupling,
    WrongGains,
)
