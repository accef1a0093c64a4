"""A bench with two joints on a CAN bus, and a host that knows the protocol only."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.codec import Decoded, decode
from rtf.robot.errors import MessageError
from rtf.robot.model import load_robot
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.parameters import FULL_OUTPUT
from rtf.simulator.plant import Options, build
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from rtf.robot.devices.can.messages import Frame, Message, Question, Setting

ADDRESS = 1


class CanBench:
    """The bench with two joints, its board, and a host on the bus."""

    address = None

    def __init__(self) -> None:
        self.simulation = Simulation(build(load_robot("bench"), Options()))
        self.firmware = Firmware(self.simulation)
        (self.wire,) = self.firmware.wires.values()
        (self.board,) = self.firmware.boards
        self.connection = self.wire.attach(self)
        self.got: list[tuple[float, Decoded]] = []
        self.damaged: list[MessageError] = []

    def receive(self, frame: Frame, time: float) -> None:
        """Keep a message."""
        try:
            self.got.append((time, decode(frame.identifier, frame.data)))
        except MessageError as error:  # only with faults
            self.damaged.append(error)

    def run(self, seconds: float) -> None:
        """Simulate."""
        self.simulation.advance(self.simulation.now + seconds)

    def send(self, message: Message, *values: float | bytes, axis: int = 0) -> None:
        """Send a command, which has arrived afterwards."""
        self.connection.send(message.frame(ADDRESS, *values, axis=axis))
        self.run(0.002)

    def ask(self, question: Question | Setting, *values: float | bytes, axis: int = 0) -> tuple[float | bytes, ...]:
        """Return the one answer to a question."""
        self.got.clear()
        self.send(question.get, *values, axis=axis)
        self.run(0.002)
        answers = [one for _, one in self.got if one.message.name == question.value.name]
        assert [one.axis for one in answers] == [axis]
        assert not self.damaged
        return answers[0].values

    def messages(self, message: Message) -> list[tuple[float, tuple[float | bytes, ...]]]:
        """Return times and values of all messages of a kind."""
        return [(time, one.values) for time, one in self.got if one.message.name == message.name]

    def configure(self) -> None:
        """Give both axes gains and limits."""
        for axis in (0, 1):
            own = self.simulation.boards.pids[axis]
            ticks = self.ticks(axis)
            per_tick = FULL_OUTPUT / 100.0 / ticks
            scaled = [round(gain * per_tick * 2**4) for gain in (own.kp, own.ki / 1e3, own.kd * 1e3)]
            self.send(m.POSITION_PID.set, *scaled, 4, axis=axis)
            self.send(m.POSITION_LIMITS.set, 0, FULL_OUTPUT, FULL_OUTPUT, axis=axis)
            minimum, maximum = self.simulation.boards.minimum[axis], self.simulation.boards.maximum[axis]
            self.send(m.MIN_POSITION.set, round(minimum * ticks), axis=axis)
            self.send(m.MAX_POSITION.set, round(maximum * ticks), axis=axis)

    def ticks(self, axis: int) -> float:
        """The ticks of the encoder of a joint a degree."""
        return float(self.simulation.boards.resolution[axis])

    def mode(self, axis: int = 0) -> int:
        """The mode that the board shows."""
        (mode,) = self.ask(m.CONTROL_MODE, axis=axis)
        return int(mode)
