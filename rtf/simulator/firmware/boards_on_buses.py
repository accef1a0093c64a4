"""The emulated boards of a simulated robot, on its buses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.devices.can.codes import BoardType
from rtf.simulator.errors import SimulatorError
from rtf.simulator.firmware.foc_board import FocBoard
from rtf.simulator.firmware.joint_board import JointBoard
from rtf.simulator.firmware.joint_state import AXES
from rtf.simulator.firmware.readings import Readings
from rtf.simulator.firmware.rotors import Rotors
from rtf.simulator.firmware.sensors_on_buses import SensorOnBus, SensorPlan
from rtf.simulator.firmware.wire import Wire

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from rtf.robot.model import RobotModel
    from rtf.simulator.firmware.board import Board
    from rtf.simulator.robot_sensors import RobotSensors
    from rtf.simulator.simulation import Simulation

#: Boards of motors on one bus at most: with all their broadcasts, more would fill it; setpoints are for four drives.
BOARDS_ON_A_BUS = 4
_FOUR = 4


class Firmware:
    """The boards of some parts of a simulated robot, which run in its steps from the construction on.

    ``wires`` has the buses by name: those of a part are PART0, PART1 … Each has up to four boards of two axes, with
    addresses from 1 on. An electronics of more axes answers as several boards. Without ``parts`` there are those of all
    parts. Those of ``drives`` have a board for each motor instead, which drives it. ``sensors`` on the links of these
    parts have boards, too: see :mod:`rtf.simulator.firmware.sensors_on_buses`.
    Raises SimulatorError for a part that the robot does not have, and for drives of motors that are coupled.
    """

    def __init__(
        self,
        simulation: Simulation,
        parts: Sequence[str] | None = None,
        sensors: RobotSensors | None = None,
        drives: Collection[str] = (),
    ) -> None:
        self.simulation = simulation
        self.wires: dict[str, Wire] = {}
        self.part_wires: dict[str, list[Wire]] = {}
        self.boards: list[JointBoard] = []
        self.drives: list[FocBoard] = []
        self._readings, self._rotors = Readings(simulation.boards), Rotors(simulation.boards)
        robot = simulation.plant.robot
        chosen = tuple(robot.parts) if parts is None else tuple(parts)
        for part in (*chosen, *drives):
            if part not in robot.parts:
                raise SimulatorError(f"the robot {robot.name} has no part {part}")
        for part in chosen:
            if part in drives:
                self._populate_drives(robot, part)
            else:
                self._populate(robot, part)
        plan = SensorPlan(simulation, self.wires, self.part_wires)
        self.sensors: list[SensorOnBus] = [] if sensors is None else list(plan.place(sensors))
        simulation.boards.each_step.append(self.step)
        simulation.on_reset.append(self.reset)

    def _populate(self, robot: RobotModel, part: str) -> None:
        """Make the boards of a part, and its buses."""
        start = robot.part_slice(part).start
        pairs = [
            (block.size, range(start + first, min(start + first + AXES, start + block.first + block.size)))
            for block in robot.part(part).couplings
            for first in range(block.first, block.first + block.size, AXES)
        ]
        for number, (electronics, axes) in enumerate(pairs):
            wire, address = self._place(part, number)
            kind = BoardType.MC_4DC if electronics == _FOUR else BoardType.BLL
            board = JointBoard(wire, address, self.simulation.boards, axes, self._readings, board_type=kind)
            self.boards.append(board)

    def _populate_drives(self, robot: RobotModel, part: str) -> None:
        """Make a board for each motor of a part, and its buses."""
        own = robot.part_slice(part)
        couplings = robot.joint_to_motor[own, own]
        if (couplings != np.eye(len(couplings))).any():
            raise SimulatorError(
                f"the motors of {part} are coupled: boards that drive one motor cannot have its joints"
            )
        for number, axis in enumerate(range(own.start, own.stop)):
            wire, address = self._place(part, number)
            self.drives.append(FocBoard(wire, address, self.simulation.boards, axis, self._rotors))

    def _place(self, part: str, number: int) -> tuple[Wire, int]:
        """Return the bus and the address of a board of a part, counted from 0."""
        name = f"{part}{number // BOARDS_ON_A_BUS}"
        if name not in self.wires:
            self.wires[name] = Wire(name)
            self.part_wires.setdefault(part, []).append(self.wires[name])
        return self.wires[name], number % BOARDS_ON_A_BUS + 1

    @property
    def motor_boards(self) -> list[JointBoard | FocBoard]:
        """The boards of joints, and those that drive motors."""
        return [*self.boards, *self.drives]

    @property
    def all_boards(self) -> list[Board]:
        """The boards of motors and of sensors."""
        return [*self.motor_boards, *(board for sensor in self.sensors for board in sensor.boards)]

    def boards_of(self, part: str) -> list[JointBoard | FocBoard]:
        """Return the boards of a part, in the order of its axes."""
        axes = self.simulation.plant.robot.part_slice(part)
        return [board for board in self.motor_boards if axes.start <= board.axes[0] < axes.stop]

    def wires_of(self, part: str) -> list[str]:
        """Return the names of the buses of a part."""
        return [wire.name for wire in self.part_wires.get(part, [])]

    def reset(self) -> None:
        """Return all nodes to their buses, and have the boards forget faults and commands, as the robot is reset."""
        for wire in self.wires.values():
            wire.recover()
        for board in self.all_boards:
            board.clear()

    def step(self, now: float) -> None:
        """Run all boards, then all buses, for a millisecond."""
        tick = self.simulation.boards.tick
        for board in self.boards:
            board.step(tick)
        for drive in self.drives:
            drive.step(tick)
        for wire in self.wires.values():
            wire.step(now)
