"""The calibrator of a board: it makes the board calibrate its joints, group by group, and homes and parks them.

:mod:`rtf.robot.devices.calibrator_settings` lists its parameters.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from rtf import clock
from rtf.robot.devices.calibrated_board import JointCalibrator
from rtf.robot.devices.calibrator_settings import CalibratorSettings
from rtf.robot.devices.movement import Movement
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.interfaces import IAxisInfo, IControlCalibration, IPidControl, PidType

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.devices.calibrator_settings import Pose

#: Seconds of real time that an aborted movement has to end before a parking.
_GIVING_WAY = 5.0
_POLL = 0.05


class BoardCalibrator(JointCalibrator):
    """``icubCalibrator``. Times are by the robot's clock. It does one movement at a time, and refuses a second one.

    Only parking aborts another movement: a robot that shall come to rest does not wait for a calibration. If a group of
    joints cannot be calibrated, or does not reach its startup position, the calibration fails: its joints are stopped,
    those that are not calibrated lose power, and the controllers get their former gains.
    """

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        super().__init__(name, network=network)
        self._settings: CalibratorSettings | None = None
        self._busy = threading.Lock()
        self._movement: Movement | None = None

    def open(self, configuration: Property) -> None:
        self._settings = CalibratorSettings.read(configuration)

    def close(self) -> None:
        """Abort the movement in progress."""
        self.abort()

    # All joints --------------------------------------------------------------------------------------------------

    def calibrate(self, target: Device) -> None:
        with self._moving(target, "the calibration") as (movement, settings):
            self._calibrate(target, movement, settings, settings.order)

    def home(self, target: Device) -> None:
        with self._moving(target, "the homing") as (movement, settings):
            self._rest(movement, settings, settings.rested, settings.home)

    def park(self, target: Device) -> None:
        """Park all joints. If some do not arrive, a DeviceError at the end names them."""
        with self._moving(target, "the parking", ending_others=True) as (movement, settings):
            self._rest(movement, settings, settings.rested, settings.park, power_off=settings.power_off)

    # One joint ---------------------------------------------------------------------------------------------------

    def calibrate_joint(self, target: Device, joint: int) -> None:
        with self._moving(target, "the calibration", joint) as (movement, settings):
            self._calibrate(target, movement, settings, [[joint]])

    def home_joint(self, target: Device, joint: int) -> None:
        with self._moving(target, "the homing", joint) as (movement, settings):
            self._rest(movement, settings, [joint], settings.home)

    def park_joint(self, target: Device, joint: int) -> None:
        with self._moving(target, "the parking", joint) as (movement, settings):
            self._rest(movement, settings, [joint], settings.park, power_off=settings.power_off)

    def abort(self) -> None:
        """Abort the movement in progress, if there is one."""
        movement = self._movement
        if movement is not None:
            movement.abort()

    # Steps -------------------------------------------------------------------------------------------------------

    @contextmanager
    def _moving(
        self, target: Device, what: str, joint: int | None = None, *, ending_others: bool = False
    ) -> Iterator[tuple[Movement, CalibratorSettings]]:
        """Run the block as the only movement of this calibrator."""
        settings = self._settings_for(target, joint)
        if not self._begin(ending_others=ending_others):
            raise RefusedError(f"{self.name} is busy; {what} of {target.name} can begin when it has finished")
        try:
            self._movement = movement = Movement(target, f"{what} of {target.name} by {self.name}")
            yield movement, settings
        finally:
            self._movement = None
            self._busy.release()

    def _begin(self, *, ending_others: bool) -> bool:
        if not ending_others:
            return self._busy.acquire(blocking=False)
        deadline = clock.Deadline.after(_GIVING_WAY)
        while not self._busy.acquire(timeout=_POLL):
            self.abort()
            if deadline.expired:
                return False
        return True

    def _settings_for(self, target: Device, joint: int | None) -> CalibratorSettings:
        settings = self._settings
        if settings is None:
            raise DeviceError(f"{self.name} is not open; open it before it calibrates {target.name}")
        axes = target.view(IAxisInfo).axes()  # type: ignore[type-abstract]  # an abstract type is allowed here
        if axes != settings.joints:
            raise DeviceError(f"{self.name} is for {settings.joints} joints; {target.name} has {axes}")
        if joint is not None and not 0 <= joint < axes:
            raise RefusedError(f"{target.name} has {axes} joints, counted from 0, and no {joint}")
        return settings

    def _rest(
        self,
        movement: Movement,
        settings: CalibratorSettings,
        joints: Sequence[int],
        pose: Pose,
        *,
        power_off: bool = False,
    ) -> None:
        if not joints:
            return
        with _stopped_on_error(movement, joints):
            missing = movement.go(joints, pose, settings.thresholds)
        if missing:
            movement.stop([*missing])
        if power_off:
            movement.power_off([joint for joint in joints if joint not in missing])
        _raise_for_missing(movement, missing)

    def _calibrate(
        self,
        target: Device,
        movement: Movement,
        settings: CalibratorSettings,
        order: Sequence[Sequence[int]],
    ) -> None:
        if settings.clear_faults:
            movement.leave_faults([joint for joints in order for joint in joints])
        if settings.skip_calibration:
            self.network.report(f"{self.name}: skipCalibration is set; {target.name} keeps its current zeros")
        controllers = target.view(IPidControl)  # type: ignore[type-abstract]  # an abstract type is allowed here
        board = target.view(IControlCalibration)  # type: ignore[type-abstract]  # likewise
        for joints in order:
            with _weakened(controllers, joints, settings), _stopped_on_error(movement, joints):
                if not settings.skip_calibration:
                    _find_zeros(board, movement, settings, joints)
                _raise_for_missing(movement, movement.go(joints, settings.startup, settings.thresholds, wake=True))


def _find_zeros(
    board: IControlCalibration, movement: Movement, settings: CalibratorSettings, joints: Sequence[int]
) -> None:
    """Let the board calibrate joints, all at the same time. Those that fail lose power."""
    try:
        for joint in joints:
            board.calibrate_axis(joint, settings.parameters[joint])
        limit = float(settings.calibration_timeouts[list(joints)].max())
        movement.wait(lambda: all(board.calibration_done(joint) for joint in joints), limit)
    finally:
        missing = [joint for joint in joints if not board.calibration_done(joint)]
        movement.power_off(missing)
    if missing:
        raise DeviceError(f"{movement.what}: {movement.named(missing)} not calibrated within {limit:g} s")


def _raise_for_missing(movement: Movement, missing: dict[int, str]) -> None:
    if missing:
        raise DeviceError(f"{movement.what}: {'; '.join(missing.values())}")


@contextmanager
def _stopped_on_error(movement: Movement, joints: Sequence[int]) -> Iterator[None]:
    """Stop joints if the block raises an error."""
    with ExitStack() as wrong:
        wrong.callback(movement.stop, joints)
        yield
        wrong.pop_all()


@contextmanager
def _weakened(controllers: IPidControl, joints: Sequence[int], settings: CalibratorSettings) -> Iterator[None]:
    """Limit the output of the joints' position controllers to the startup limits, within the block."""
    with ExitStack() as restored:
        for joint in joints:
            limit = float(settings.duty_limits[joint])
            pid = controllers.pid(PidType.POSITION, joint)
            if not 0 < limit < pid.max_output:
                continue
            restored.callback(controllers.set_pid, PidType.POSITION, joint, pid)
            weak = pid._replace(max_output=limit, max_integral=min(limit, pid.max_integral))
            controllers.set_pid(PidType.POSITION, joint, weak)
        yield
