"""Faults of the boards: what they do with commands and modes, and what they are configured with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.control_modes import REQUESTS, ControlMode
from rtf.simulator.faults.base import AxisFault, Layer, Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray, Pid


class MissedCommand(AxisFault):
    """See ``meaning``."""

    kind = "missed_command"
    layer = Layer.BOARD
    meaning = "The board loses commands: one of so many gets lost."
    shows = "Some moves do not begin."
    parameters = (Parameter("every", 2.0, "", "one of so many is lost; 1: all", 1.0, 1e6),)
    every: float

    def begin(self) -> None:
        self._count = 0
        self.boards.command_faults.append(self._lost)

    def end(self) -> None:
        self.boards.command_faults.remove(self._lost)

    def _lost(self, what: str, axis: int, now: float) -> bool:
        del what, now
        if axis != self.axis:
            return False
        self._count += 1
        return self._count % max(1, round(self.every)) == 0


class CommandOfAnyMode(AxisFault):
    """See ``meaning``."""

    kind = "command_of_any_mode"
    layer = Layer.BOARD
    meaning = "As long as the board controls the position of a joint, it takes the commands of all modes."
    shows = "A joint moves by a command that its mode does not take, so whoever has lost it still drives it."

    def begin(self) -> None:
        self.boards.obeying_faults.append(self._obeys)

    def end(self) -> None:
        self.boards.obeying_faults.remove(self._obeys)

    def _obeys(self, axis: int) -> bool:
        return axis == self.axis


class _ModeFault(AxisFault):
    """Changes what a board does with a request for a mode."""

    layer = Layer.BOARD

    def begin(self) -> None:
        self.boards.mode_faults.append(self._of_axis)

    def end(self) -> None:
        self.boards.mode_faults.remove(self._of_axis)

    def _of_axis(self, axis: int, state: ControlMode, wanted: int) -> ControlMode | None:
        return self.decide(state, wanted) if axis == self.axis else None

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        """The mode that follows, None for what a healthy board would do."""
        raise NotImplementedError


class FaultLeft(_ModeFault):
    """See ``meaning``."""

    kind = "fault_left"
    meaning = "The board lets a joint leave its hardware fault for any mode, not only by a forced idle."
    shows = "A joint in fault obeys at once: dangerous, for nobody has looked at it."

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        if state is ControlMode.HARDWARE_FAULT and wanted in REQUESTS and wanted != ControlMode.FORCE_IDLE:
            return ControlMode(wanted)
        return None


class ModeIgnored(_ModeFault):
    """See ``meaning``."""

    kind = "mode_ignored"
    meaning = "The board says yes to a mode and stays in the one it is in."
    shows = "The mode that is read back is not the one that was asked for."

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        del wanted
        return state


class WrongMode(_ModeFault):
    """See ``meaning``."""

    kind = "wrong_mode"
    meaning = "The board takes torque mode for position mode."
    shows = "Torque is asked for, position is read back."

    def decide(self, state: ControlMode, wanted: int) -> ControlMode | None:
        allowed = state is not ControlMode.HARDWARE_FAULT
        return ControlMode.POSITION if wanted == ControlMode.TORQUE and allowed else None


class _WrongNumber(AxisFault):
    """Changes a number that the board goes by."""

    layer = Layer.CONFIGURATION
    keeps = True

    @property
    def numbers(self) -> FloatArray:
        """The numbers of all axes, of which one is wrong."""
        raise NotImplementedError

    def wrong(self, healthy: float) -> float:
        """What stands there instead."""
        raise NotImplementedError

    def begin(self) -> None:
        self._healthy = float(self.numbers[self.axis])
        self.numbers[self.axis] = self.wrong(self._healthy)
        self.boards.refresh(self.axis)

    def end(self) -> None:
        self.numbers[self.axis] = self._healthy
        self.boards.refresh(self.axis)


class WrongGearRatio(_WrongNumber):
    """See ``meaning``."""

    kind = "wrong_gear_ratio"
    meaning = "The gearbox ratio in the configuration is not the one that is built in."
    shows = "Joint and motor encoder disagree by the same factor everywhere."
    parameters = (Parameter("factor", 1.5, "", "by which it is wrong", -10.0, 10.0),)
    factor: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.configured_gearbox

    def wrong(self, healthy: float) -> float:
        return healthy * self.factor


class WrongUpperLimit(_WrongNumber):
    """See ``meaning``."""

    kind = "wrong_upper_limit"
    meaning = "The upper limit in the configuration is not where the joint can go."
    shows = "The joint stops before its limit, or never comes near what it could reach."
    parameters = (Parameter("by", 10.0, "deg", "how much too high; negative: too low", -360.0, 360.0),)
    by: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.maximum

    def wrong(self, healthy: float) -> float:
        return healthy + self.by


class WrongLowerLimit(WrongUpperLimit):
    """See ``meaning``."""

    kind = "wrong_lower_limit"
    meaning = "The lower limit in the configuration is not where the joint can go."
    parameters = (Parameter("by", -10.0, "deg", "how much too high; negative: too low", -360.0, 360.0),)

    @property
    def numbers(self) -> FloatArray:
        return self.boards.minimum


class LimitsIgnored(_WrongNumber):
    """See ``meaning``."""

    kind = "limits_ignored"
    layer = Layer.BOARD
    meaning = "The board tells its limits and does not keep them."
    shows = "A command beyond a limit is carried out, up to the mechanical stop."
    parameters = (Parameter("by", 5.0, "deg", "how far it goes beyond", 0.0, 360.0),)
    by: float

    @property
    def numbers(self) -> FloatArray:
        return self.boards.limit_slack

    def wrong(self, healthy: float) -> float:
        return healthy + self.by


class WrongCoupling(AxisFault):
    """See ``meaning``."""

    kind = "wrong_coupling"
    layer = Layer.CONFIGURATION
    keeps = True
    meaning = "The coupling matrix in the configuration is not the one of the mechanics."
    shows = "Motor encoders disagree with the joints when a coupled neighbour moves."
    parameters = (Parameter("factor", 0.5, "", "by which its row is wrong", -10.0, 10.0),)
    factor: float

    def begin(self) -> None:
        self._healthy = self.boards.configured_couplings[self.axis].copy()
        self.boards.configured_couplings[self.axis] *= self.factor

    def end(self) -> None:
        self.boards.configured_couplings[self.axis] = self._healthy


class WrongGains(AxisFault):
    """See ``meaning``."""

    kind = "wrong_gains"
    layer = Layer.CONFIGURATION
    keeps = True
    meaning = "The gains of the position controller are wrong."
    shows = "Too small: the joint lags and sags. Too large: it swings and buzzes."
    parameters = (Parameter("factor", 0.05, "", "what all gains are multiplied by", 0.0, 100.0),)
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
    CommandOfAnyMode,
    FaultLeft,
    ModeIgnored,
    WrongMode,
    LimitsIgnored,
    WrongGearRatio,
    WrongUpperLimit,
    WrongLowerLimit,
    WrongCoupling,
    WrongGains,
)
