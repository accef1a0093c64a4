"""The emulated boards of a simulated robot, on its buses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.devices.can.codes import BoardType
from rtf.simulator.errors import SimulatorError
from rtf.simulator.firmware.joint_board import JointBoard
from rtf.simulator.firmware.joint_state import AXES
from rtf.simulator.firmware.readings import Readings
from rtf.simulator.firmware.sensors_on_buses import SensorOnBus, SensorPlan
from rtf.simulator.firmware.wire import Wire

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.model import RobotModel
    from rtf.simulator.firmware.board import Board
    from rtf.simulator.robot_sensors import RobotSensors
    from rtf.simulator.simulation import Simulation

#: Joint boards on one bus at most: with all their broadcasts, more would fill it.
BOARDS_ON_A_BUS = 4
_FOUR = 4


class Firmware:
    """The boards of some parts of a simulated robot, which run in its steps from the construction on.

    ``wires`` has the buses by name: those of a part are PART0, PART1 … Each has up to four boards of two axes, with
    addresses from 1 on. An electronics of more axes answers as several boards. Without ``parts`` there are those of all
    parts. ``sensors`` on the links of these parts have boards, too: see :mod:`rtf.simulator.firmware.sensors_on_buses`.
    Raises SimulatorError for a part that the robot does not have.
    """

    def __init__(
        self, simulation: Simulation, parts: Sequence[str] | None = None, sensors: RobotSensors | None = None
    ) -> None:
        self.simulation = simulation
        self.wires: dict[str, Wire] = {}
        self.part_wires: dict[str, list[Wire]] = {}
        self.boards: list[JointBoard] = []
        self._readings = Readings(simulation.boards)
        robot = simulation.plant.robot
        for part in robot.parts if parts is None else parts:
            if part not in robot.parts:
                raise SimulatorError(f"the robot {robot.name} has no part {part}")
            self._populate(robot, part)
        plan = SensorPlan(simulation, self.wires, self.part_wires)
        self.sensors: list[SensorOnBus] = [] if sensors is None else list(plan.place(sensors))
        simulation.boards.each_step.append(self.step)

    def _populate(self, robot: RobotModel, part: str) -> None:
        """Make the boards of a part, and its buses."""
        start = robot.part_slice(part).start
        pairs = [
            (block.size, range(start + first, min(start + first + AXES, start + block.first + block.size)))
            for block in robot.part(part).couplings
            for first in range(block.first, block.first + block.size, AXES)
        ]
        for number, (electronics, axes) in enumerate(pairs):
            name, address = f"{part}{number // BOARDS_ON_A_BUS}", number % BOARDS_ON_A_BUS + 1
            if name not in self.wires:
                self.wires[name] = Wire(name)
                self.part_wires.setdefault(part, []).append(self.wires[name])
            wire = self.wires[name]
            kind = BoardType.MC_4DC if electronics == _FOUR else BoardType.BLL
            board = JointBoard(wire, address, self.simulation.boards, axes, self._readings, board_type=kind)
            self.boards.append(board)

    @property
    def all_boards(self) -> list[Board]:
        """The boards of joints and of sensors."""
        return [*self.boards, *(board for sensor in self.sensors for board in sensor.boards)]

    def boards_of(self, part: str) -> list[JointBoard]:
        """Return the boards of a part, in the order of its axes."""
        axes = self.simulation.plant.robot.part_slice(part)
        return [board for board in self.boards if axes.start <= board.axes[0] < axes.stop]

    def wires_of(self, part: str) -> list[str]:
        """Return the names of the buses of a part."""
        return [wire.name for wire in self.part_wires.get(part, [])]

    def step(self, now: float) -> None:
        """Run all boards, then all buses, for a millisecond."""
        tick = self.simulation.boards.tick
        for board in self.boards:
            board.step(tick)
        for wire in self.wires.values():
            wire.step(now)
