"""A board of three joints behind its ports, and a part with a guard. Each sleep publishes the state at its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import RefusedError
from rtf.robot.network.client_settings import unique_local
from rtf.robot.network.outlets import PipelinedOutlets
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.robot_testing import MotionGuard, Part
from rtf.robot_testing.guard.transmission import COUPLING_VARIABLE
from rtf.robot_testing.joints_test import JointsTest

from ..robot.sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import ExitStack

    from rtf.robot.control_modes import InteractionMode
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection, FloatArray

#: The first joint has a motor of its own, the two others share theirs.
COUPLING = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, -0.5], [0.0, 0.5, 0.5]])


class Joints(JointsTest):
    """A test of a part that is already open."""

    plugin_name = "joints"


class CoupledBoard(FakeBoard):
    """A board with couplings, given measurements, modes that it may refuse, and a clock that may be ahead (s)."""

    def __init__(self, name: str, *, network: Network, coupling: FloatArray) -> None:
        super().__init__(name, network=network)
        self.coupling = coupling
        self.shown: dict[int, float] = {}
        self.speeds: dict[int, float] = {}
        self.duties: dict[int, float] = {}
        self.refuses = False
        self.ahead = 0.0
        self.duty_step = 1e-9
        self.asked: list[tuple[object, list[int]]] = []

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource."""
        time = super().fill_state(state)
        state.motor_positions[:] = 100.0 * (self.coupling @ state.joint_positions)
        for joint, position in self.shown.items():
            state.joint_positions[joint] = position
        for joint, speed in self.speeds.items():
            state.joint_velocities[joint] = speed
        for motor, duty in self.duties.items():
            state.duty_cycles[motor] = duty
        return time + self.ahead

    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl."""
        reported: FloatArray = np.trunc(super().reference_duty_cycles(motors) / self.duty_step) * self.duty_step
        return reported

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """See IControlMode."""
        self.asked.append((modes, self._chosen(joints)))
        if self.refuses:
            raise RefusedError("a joint has not taken the mode in time")
        super().set_control_modes(modes, joints)

    def set_interaction_modes(
        self, modes: InteractionMode | Sequence[InteractionMode], joints: AxisSelection = None
    ) -> None:
        """See IInteractionMode."""
        if self.refuses:
            raise RefusedError("there are no interaction modes")
        super().set_interaction_modes(modes, joints)


class _Time(ManualClock):
    """A clock that publishes a state after each sleep."""

    publish: Callable[[], None]

    def sleep(self, seconds: float) -> None:
        """See Clock."""
        super().sleep(seconds)
        self.publish()


class LocalTime(_Time, clock.SystemClock):
    """The same clock as a machine's own, so that stamps may be of another clock."""


class PartBench:
    """The device, its server, and the part of a test. ``said`` has the reports of the guard."""

    def __init__(
        self,
        stack: ExitStack,
        board: type[RemoteControlBoard] = RemoteControlBoard,
        *,
        coupling: FloatArray = COUPLING,
        local: bool = False,
    ) -> None:
        self.network = Network(LocalNames())
        self.time = LocalTime() if local else _Time()
        stack.enter_context(clock.use(self.time))
        self.device = CoupledBoard("fake", network=self.network, coupling=coupling)
        variables = Bottle([COUPLING_VARIABLE, Bottle(coupling.ravel().tolist())]).to_text()
        limits = "(LIMITS (Min (-50 -50 -50)) (Max (50 50 50)))"
        self.device.open(Property.parse(f"(GENERAL (Joints 3)) {limits} (VARIABLES ({variables}))"))
        stack.callback(self.device.close)
        self.server = ControlBoardServer(self.device, "/fake", network=self.network, outlets=PipelinedOutlets())
        stack.callback(self.server.close)
        self.board = stack.enter_context(board("/fake", network=self.network))
        self.board.open(Property({"remote": "/fake", "local": unique_local("/fake"), "carrier": "tcp"}))
        self.time.publish = self.publish
        self.publish()
        self.said: list[str] = []
        self.guard = MotionGuard(self.board, "/fake", clock=self.time, report=self.said.append)
        self.part = Part("fake", self.board, self.time, self.guard)

    def publish(self) -> None:
        """Publish the present state to the client."""
        self.server.publish(self.time.now())
        self.server.settle()
