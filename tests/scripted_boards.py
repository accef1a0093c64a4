"""Boards at the other end of a virtual bus, which answer by the table of messages and do what a test says.

They have no motors: a test sets positions and faults, and looks at what was commanded.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.codec import decode, dialect_of
from rtf.robot.devices.can.codes import BoardMode, BoardType
from rtf.robot.devices.can.messages import HOST, Dialect, Message, Setting
from rtf.robot.devices.can.sensor_messages import DISCOVER

if TYPE_CHECKING:
    from rtf.robot.devices.can.bus_settings import BusSettings
    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Frame

#: Seconds between two broadcasts.
PERIOD = 0.005
SETTINGS = [one for one in vars(motor).values() if isinstance(one, Setting)]


class ScriptedBoard:
    """A board with two axes, or of the FOC type with one."""

    def __init__(self, settings: BusSettings, address: int, kind: BoardType = BoardType.MC_4DC) -> None:
        self.address, self.kind, self.dialect = address, kind, dialect_of(kind)
        self.acknowledged = 1
        self.silent = False
        self.twins = 1  # how many boards have this address, and answer questions for the version
        self.deaf: set[str] = set()  # names of commands that are ignored
        self.mode = [BoardMode.IDLE, BoardMode.IDLE]
        self.faults = [0, 0]
        self.positions, self.speeds, self.duties, self.currents = [0, 0], [0, 0], [0, 0], [0, 0]
        self.mask = 0
        self.values: dict[tuple[str, int], tuple[float | bytes, ...]] = {}
        self.commands: list[tuple[str, int, tuple[float | bytes, ...]]] = []
        self.words: tuple[float | bytes, ...] = ()
        self.bus = CanBus(settings)
        self.bus.subscribe(self._take, [address, 0x10F, 0x70F])
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._broadcast, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the bus."""
        self._ended.set()
        self._thread.join()
        self.bus.close()

    def send(self, message: Message, *values: float | bytes, axis: int = 0) -> None:
        """Send a message."""
        if not self.silent:
            self.bus.send(message.frame(self.address, *values, axis=axis))

    def latest(self, name: str, axis: int = 0) -> tuple[float | bytes, ...] | None:
        """Return the values of the last command with a name."""
        return next((values for what, of, values in reversed(self.commands) if (what, of) == (name, axis)), None)

    def count(self, name: str) -> int:
        """Return how many commands with a name have come."""
        return sum(what == name for what, _, _ in list(self.commands))

    def fail(self, axis: int, faults: int) -> None:
        """Enter hardware fault."""
        self.faults[axis], self.mode[axis] = faults, BoardMode.HARDWARE_FAULT
        self.status()

    def reset(self) -> None:
        """Start anew, as after a loss of power."""
        self.mode[:] = [BoardMode.NOT_CONFIGURED] * 2
        self.mask = 0
        self.values.clear()
        self.commands.clear()

    def _take(self, frame: Frame, stamp: float) -> None:
        del stamp
        got = decode(*frame, self.dialect)
        if got.source != HOST:
            return
        if got.message in motor.SETPOINTS:
            self.words = got.values
            if self.dialect is Dialect.FOC:
                self.feedback()
            return
        if got.message.name in self.deaf or self.silent:
            return
        self.commands.append((got.message.name, got.axis, got.values))
        self._obey(got)

    def _obey(self, got: Decoded) -> None:
        message, axis, values = got.message, got.axis, got.values
        question = motor.CONTROL_MODE if self.dialect is Dialect.JOINT else motor.FOC_CONTROL_MODE
        if message == DISCOVER.get:
            self.send(DISCOVER.value, self.kind, 1, 2, 3)
        elif message == motor.VERSION.get:
            for _ in range(self.twins):
                self.send(motor.VERSION.value, self.kind, 1, 2, 3, 1, 6, self.acknowledged)
        elif message == question.get:
            self.send(question.value, self.mode[axis], axis=axis)
        elif message == motor.SET_CONTROL_MODE:
            self._enter(axis, BoardMode(int(values[0])))
        elif message == motor.CALIBRATE:
            self.mode[axis] = BoardMode.CALIBRATING
            self.status()
        elif message == motor.BROADCASTS:
            self.mask = int(values[0])
        for setting in SETTINGS:
            if message == setting.set:
                self.values[setting.value.name, axis] = values
            elif message == setting.get and setting.value.dialect & self.dialect:
                empty = tuple(0 for _ in setting.value.fields)
                self.send(setting.value, *self.values.get((setting.value.name, axis), empty), axis=axis)

    def _enter(self, axis: int, mode: BoardMode) -> None:
        if mode is BoardMode.FORCE_IDLE:
            self.faults[axis], mode = 0, BoardMode.IDLE
        elif self.mode[axis] is BoardMode.HARDWARE_FAULT:
            return
        self.mode[axis] = mode
        self.status()

    def status(self) -> None:
        """Send the status, as on a change."""
        if self.dialect is Dialect.FOC:
            self.send(motor.FOC_STATUS, self.mode[0], 0, self.duties[0], self.faults[0])
        else:
            self.send(motor.STATUS, self.faults[0], self.mode[0], self.faults[1], self.mode[1], 0, 0, 0, 0)

    def feedback(self) -> None:
        """Send what a FOC board answers to a setpoint."""
        self.send(motor.FOC_FEEDBACK, self.currents[0], self.speeds[0], self.positions[0])
        self.status()

    def _broadcast(self) -> None:
        while not self._ended.wait(PERIOD):
            if self.dialect is Dialect.JOINT and self.mask:
                self.send(motor.BROADCAST_POSITION, *self.positions)
                self.send(motor.BROADCAST_PID, 0, 0, *self.duties)
                self.send(motor.BROADCAST_CURRENT, *self.currents)
                self.send(motor.BROADCAST_VELOCITY, *self.speeds, 0, 0)
