"""The control board: all interfaces of a board, over a driver of its hardware."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, ClassVar

from rtf.robot.devices.board_motion import BoardMotion
from rtf.robot.devices.board_motors import BoardMotors
from rtf.robot.devices.board_settings import BoardSettings
from rtf.robot.devices.calibrated_board import Calibrated
from rtf.robot.devices.motor_board import MotorBoard
from rtf.robot.errors import DeviceError
from rtf.robot.extended_state import ExtendedState, IStateSource
from rtf.robot.publishing import PeriodicPublishing

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.devices.board_driver import BoardDriver


class ControlBoard(BoardMotion, BoardMotors, BoardSettings, IStateSource, Calibrated):
    """A control board. Opening it connects its driver, and starts the thread of its cycles if it has a period.

    A device type of a driver is a subclass with its ``driver_class``; ``ControlBoard.over`` makes one.
    """

    driver_class: ClassVar[type[BoardDriver]]

    def __init__(self, name: str = "", *, driver: BoardDriver | None = None, network: Network | None = None) -> None:
        super().__init__(name, network=network)
        self._board = MotorBoard(driver or self.driver_class())
        self._thread: PeriodicPublishing | None = None

    @classmethod
    def over(cls, driver_class: type[BoardDriver]) -> type[ControlBoard]:
        """Return the device type of a driver."""
        return type(driver_class.__name__, (cls,), {"driver_class": driver_class, "__doc__": driver_class.__doc__})

    @property
    def board(self) -> MotorBoard:
        if not self.size:
            raise DeviceError(f"{self.name} is not open")
        return self._board

    def open(self, configuration: Property) -> None:
        self.close()
        board, driver = self._board, self._board.driver
        board.lock = threading.RLock()
        driver.report = self._report
        axes = driver.connect(configuration)
        try:
            driver.board = board
            with board.lock:
                board.start(axes)
        except BaseException:
            driver.disconnect()
            raise
        self.own, self.size = slice(0, board.count), board.count
        self._begin_cycles()

    def _begin_cycles(self) -> None:
        period = self._board.driver.period
        if period is not None:
            self._board.lock = self._board.driver.lock or self._board.lock
            self._thread = PeriodicPublishing(_Cycles(self._board, period), name=self.name, report=self._report)

    def _report(self, said: str) -> None:
        self.network.report(f"{self.name}: {said}")

    def close(self) -> None:
        """End the cycles and disconnect the driver."""
        if self._thread is not None:
            self._thread.stop()
            self._thread = None
        self.size = 0
        with self._board.lock:
            self._board.driver.disconnect()

    def fill_state(self, state: ExtendedState) -> float:
        self._update()
        board, own = self.board, self.own
        shot = board.snapshot()
        state.floats[...] = shot.floats[:, own]
        state.modes[...] = board.shown_modes()[:, own]
        state.temperatures[...] = shot.temperatures[own]
        state.valid[...] = shot.valid
        return board.measured_at


class _Cycles:
    """The cycles of a motor board, for a thread."""

    def __init__(self, board: MotorBoard, period: float) -> None:
        self.period = period
        self._board = board

    def publish(self, now: float) -> None:
        """Read the hardware, supervise and write."""
        with self._board.lock:
            self._board.cycle(now)
