"""The client of a control board: its controllers, calibration, and what it tells of itself by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Value, Vocab
from rtf.robot.client.questions import (
    CALIBRATE,
    CALIBRATION_DONE,
    ENABLE_PID,
    GETTING,
    KEEP_CALIBRATION,
    PID_ENABLED,
    SETTING,
)
from rtf.robot.client.stub import BoardStub
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IControlCalibration, IPidControl, IRemoteCalibrator, IRemoteVariables
from rtf.robot.vocabulary import Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import AxisSelection, CalibrationParameters, FloatArray, Pid, PidType, Values

#: Of the parameters of a calibration these many travel.
_CALIBRATE, _KEEP = 3, 4


class ControllersStub(BoardStub, IPidControl, IControlCalibration, IRemoteCalibrator, IRemoteVariables):
    """All of it is asked for. Errors as the interfaces say."""

    # Controllers -------------------------------------------------------------------------------------------------

    def pid(self, kind: PidType, joint: int) -> Pid:
        """See IPidControl."""
        pid: Pid = self._get_of("pid", joint, _word(kind))
        return pid

    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        """See IPidControl."""
        question = SETTING["set_pid"][Shape.SINGLE]
        self._link.rpc.tell(question, _word(kind), self._axis(joint), Bottle.adopt(self._finite(*pid)))

    def pids(self, kind: PidType) -> tuple[Pid, ...]:
        """See IPidControl."""
        question, rpc = GETTING["pids"][Shape.NONE], self._link.rpc
        pids: tuple[Pid, ...] = rpc.read(question, _word(kind))
        if len(pids) != self._link.axes:
            raise rpc.nonsense(question, (_word(kind),), [str(pids)], f"{self._link.axes} are needed")
        return pids

    def set_pids(self, kind: PidType, pids: Sequence[Pid]) -> None:
        """See IPidControl."""
        if len(pids) != self._link.axes:
            raise RefusedError(f"{self._link.settings.remote}: {self._link.axes} are needed, {len(pids)} were given")
        gains: list[Value] = [Bottle.adopt(self._finite(*pid)) for pid in pids]
        self._link.rpc.tell(SETTING["set_pids"][Shape.NONE], _word(kind), Bottle.adopt(gains))

    def pid_count(self) -> int:
        """See IPidControl: every joint has them, or none has."""
        return self._link.axes

    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._floats("pid_references", joints, _word(kind))

    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """See IPidControl."""
        self._set("set_pid_references", values, joints, _word(kind))

    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._floats("pid_errors", joints, _word(kind))

    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._floats("pid_outputs", joints, _word(kind))

    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        """See IPidControl."""
        return self._floats("pid_error_limits", joints, _word(kind))

    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """See IPidControl."""
        self._set("set_pid_error_limits", values, joints, _word(kind))

    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        """See IPidControl."""
        question = SETTING["set_pid_offset"][Shape.SINGLE]
        self._link.rpc.tell(question, _word(kind), self._axis(joint), *self._finite(offset))

    def reset_pid(self, kind: PidType, joint: int) -> None:
        """See IPidControl."""
        self._link.rpc.tell(SETTING["reset_pid"][Shape.SINGLE], _word(kind), self._axis(joint))

    def enable_pid(self, kind: PidType, joint: int) -> None:
        """See IPidControl."""
        self._link.rpc.tell(ENABLE_PID, _word(kind), self._axis(joint))

    def disable_pid(self, kind: PidType, joint: int) -> None:
        """See IPidControl."""
        self._link.rpc.tell(SETTING["disable_pid"][Shape.SINGLE], _word(kind), self._axis(joint))

    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        """See IPidControl."""
        return bool(self._link.rpc.read(PID_ENABLED, _word(kind), self._axis(joint)))

    # Calibration by the board ------------------------------------------------------------------------------------

    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """See IControlCalibration. The protocol carries the type and three parameters."""
        numbers = self._finite(*parameters[1 : 1 + _CALIBRATE])
        self._link.rpc.tell(CALIBRATE, self._axis(joint), int(parameters.kind), *numbers)

    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        """See IControlCalibration. The protocol carries the type and four parameters."""
        numbers = self._finite(*parameters[1 : 1 + _KEEP])
        self._link.rpc.tell(KEEP_CALIBRATION, self._axis(joint), int(parameters.kind), *numbers)

    def calibration_done(self, joint: int) -> bool:
        """See IControlCalibration. A board that cannot calibrate says no, too."""
        axis = self._axis(joint)
        try:
            self._link.rpc.tell(CALIBRATION_DONE, axis)
        except RefusedError:
            return False
        return True

    # The calibrator behind it ------------------------------------------------------------------------------------

    def has_calibrator(self) -> bool:
        """See IRemoteCalibrator; a board that knows nothing of calibrators has none."""
        try:
            return bool(self._get("has_calibrator"))
        except RefusedError:
            return False

    def calibrate_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.act(SETTING["calibrate_joint"][Shape.SINGLE], self._axis(joint))

    def calibrate_part(self) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.act(SETTING["calibrate_part"][Shape.NONE])

    def home_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.act(SETTING["home_joint"][Shape.SINGLE], self._axis(joint))

    def home_part(self) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.act(SETTING["home_part"][Shape.NONE])

    def park_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.act(SETTING["park_joint"][Shape.SINGLE], self._axis(joint))

    def park_part(self) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.act(SETTING["park_part"][Shape.NONE])

    def quit_calibrate(self) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.tell(SETTING["quit_calibrate"][Shape.NONE])

    def quit_park(self) -> None:
        """See IRemoteCalibrator."""
        self._link.rpc.tell(SETTING["quit_park"][Shape.NONE])

    # Variables ---------------------------------------------------------------------------------------------------

    def variable(self, key: str) -> Bottle:
        """See IRemoteVariables."""
        question, rpc = GETTING["variable"][Shape.NAMED], self._link.rpc
        data = rpc.get(question, key)
        if len(data) == 1 and isinstance(data[0], Bottle):
            return data[0]
        raise rpc.nonsense(question, (key,), data, "a list is needed")

    def set_variable(self, key: str, value: Bottle) -> None:
        """See IRemoteVariables."""
        self._link.rpc.tell(SETTING["set_variable"][Shape.NAMED], key, *value)

    def variables(self) -> tuple[str, ...]:
        """See IRemoteVariables."""
        names: tuple[str, ...] = self._get("variables")
        return names


def _word(kind: PidType) -> Vocab:
    return Vocab(int(kind))
