"""A simulated robot in lockstep in this process, with a guarded part, and what its motors really do."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from rtf import clock
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.client import connect
from rtf.robot.control_modes import ControlMode
from rtf.robot.model import load_robot
from rtf.robot.model.engine import mujoco
from rtf.robot_testing.guard.contacts import ContactWatch, listen_to_forces
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.planned_moves import MoveCheck, read_positions
from rtf.robot_testing.motion.part import PACE, Part
from rtf.simulator.faults.injection import FaultInjector
from rtf.simulator.robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import TracebackType

    from rtf.robot.interfaces import FloatArray

_SUPPLY = 40.0  # V


class Sample(NamedTuple):
    """What motors and links do at a moment."""

    time: float  # s
    torques: FloatArray  # Nm
    gravity: FloatArray  # Nm, what holds the joints
    currents: FloatArray  # A
    duties: FloatArray  # per cent
    contact: float  # the greatest force between two links, N


class Truth:
    """Samples of the motors every 5 ms, from inside the simulator."""

    period = 0.005

    def __init__(self, robot: SimulatedRobot) -> None:
        self._simulation = robot.simulation
        self._copy = robot.simulation.plant.data()
        self.samples: list[Sample] = []

    def publish(self, now: float) -> None:
        """See Publisher."""
        boards, data = self._simulation.boards, self._simulation.data
        self.samples.append(
            Sample(
                now,
                data.actuator_force.copy(),
                boards.gravity().copy(),
                boards.motor_currents(),
                boards.motor_duties(),
                self._contact(),
            )
        )

    def _contact(self) -> float:
        """Return the greatest force between two links, computed anew: the simulator is in the middle of a step."""
        engine, model, data, copy = mujoco(), self._simulation.plant.model, self._simulation.data, self._copy
        if not data.ncon:
            return 0.0
        for field in ("qpos", "qvel", "ctrl", "qfrc_applied"):
            getattr(copy, field)[:] = getattr(data, field)
        engine.mj_forward(model, copy)
        force, most = np.zeros(6), 0.0
        for number in range(copy.ncon):
            engine.mj_contactForce(model, copy, number, force)
            most = max(most, float(np.linalg.norm(force[:3])))
        return most


class GuardedRobot:
    """The robot of a model, from its construction to ``close``."""

    def __init__(self, name: str = "icub", *, seed: int = 0) -> None:
        self.model = load_robot(name)
        self.network = Network(LocalNames())
        self._opened = ExitStack()
        self.robot = self._opened.enter_context(
            SimulatedRobot(self.model, network=self.network, lockstep=True, seed=seed)
        )
        self.clock = LockstepClock("/clock", "benchmark", network=self.network)
        self._opened.callback(self.clock.close)
        self._opened.enter_context(clock.use(self.clock))
        self.truth = Truth(self.robot)
        self.robot.simulation.publish_regularly(self.truth)
        self.faults = FaultInjector(self.robot)
        self.said: list[str] = []
        self._parts: dict[str, ExitStack] = {}

    def part(self, name: str, *, check_moves: bool = False) -> Part:
        """Open a part with its guard, as a test does."""
        place = f"/{self.robot.name}/{name}"
        opened = ExitStack()
        board = opened.enter_context(connect(place, carrier="tcp", network=self.network))
        self.clock.sleep(0.1)
        contacts = moves = None
        forces = listen_to_forces(self.model, place, network=self.network, report=self.said.append)
        if forces is not None:
            opened.callback(forces.close)
            contacts = ContactWatch(board, forces, self.model, name)
        if check_moves:
            positions = read_positions(
                self.model, self.robot.name, network=self.network, carrier="tcp",
                opened=lambda one: opened.callback(one.close),
            )  # fmt: skip
            self.clock.sleep(0.1)
            moves = MoveCheck(self.model, positions)
        guard = MotionGuard(
            board, place, clock=self.clock, report=self.said.append, contacts=contacts, robot=self.model, moves=moves
        )
        self._parts[name] = opened
        return Part(name, board, self.clock, guard, together=self.model.together(name))

    def leave(self, part: Part) -> None:
        """Close a part."""
        self._parts.pop(part.name).close()

    def place(self, part: Part, positions: Mapping[str, float]) -> None:
        """Put axes of a part to positions (deg), at once, held there."""
        joints = [part.joint(name) for name in positions]
        part.board.set_control_modes([ControlMode.IDLE] * len(joints), joints)
        simulation = self.robot.simulation
        with simulation.lock:
            axes = simulation.boards.position / simulation.boards.scale
            for name, degrees in positions.items():
                axes[self.model.index[name]] = degrees * self.model.axis(name).internal
            simulation.data.qpos[:] = simulation.plant.pose(axes)
            simulation.data.qvel[:] = 0.0
        self.clock.sleep(0.002)
        part.board.set_control_modes([ControlMode.POSITION] * len(joints), joints)

    def watch(self, part: Part, seconds: float, command: Callable[[float], None] | None = None) -> GuardError | None:
        """Let time pass as in a test; ``command`` is called at every tick until the guard stops a joint."""
        begin, stopped = self.clock.now(), None
        while self.clock.now() < begin + seconds:
            if command is not None and stopped is None:
                command(self.clock.now() - begin)
            self.clock.sleep(PACE)
            try:
                if part.guard is not None and stopped is None:
                    part.guard.watch()
            except GuardError as error:
                stopped = error
        return stopped

    def reset(self) -> None:
        """Bring the robot home, healthy, with all joints in position mode."""
        self.faults.clear()
        self.robot.simulation.reset()
        self.clock.sleep(0.1)

    def close(self) -> None:
        """Close all ports."""
        for opened in self._parts.values():
            opened.close()
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def energy(samples: list[Sample], axis: int) -> float:
    """Return the electrical energy of a motor over samples (J)."""
    power = [abs(one.duties[axis] / 100.0 * one.currents[axis]) * _SUPPLY for one in samples]
    return float(np.sum(power) * Truth.period)
