"""The test case of robots: finds the robot and its time, opens parts, guards them, keeps what led to a failure."""

from __future__ import annotations

import math
import os
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, NoReturn

from rtf import clock
from rtf.middleware.network import default_network
from rtf.middleware.time import CLOCK_VARIABLE, LockstepClock, clock_from_environment
from rtf.robot.client.control_board import connect
from rtf.robot.errors import RefusedError, RobotError, StaleStateError
from rtf.robot_testing.causes import likely_causes
from rtf.robot_testing.contacts import ContactWatch, listen_to_forces
from rtf.robot_testing.guard import GuardError, Limits, MotionGuard
from rtf.robot_testing.last_seconds import LastSeconds
from rtf.robot_testing.lateness import Waiting, busyness
from rtf.robot_testing.ledger import MotionLedger
from rtf.robot_testing.listening_board import listen_to
from rtf.robot_testing.parameter_checks import refuse, wrong_fault, wrong_lists
from rtf.robot_testing.part import Part
from rtf.robot_testing.robot_name import ROBOT_VARIABLE, robot_name
from rtf.robot_testing.safety import Safety
from rtf.robot_testing.simulated import is_simulated
from rtf.simulator.control import SimulatorControl
from rtf.testing import Parameter, TestCase
from rtf.testing.parameters import ParameterError
from rtf.testing.permission import has_permission

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rtf.clock import Clock
    from rtf.middleware.network import Network
    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing.part import Arrival
    from rtf.testing.session import Session

_DEFAULT_ROBOT = "icubSim"


class RobotTest(TestCase):
    """A test of a robot. ``setup`` opens the robot; whoever overrides it calls it first.

    ``safety`` says what the test does to the robot. On a real one everything but listening has to be allowed
    (``testrunner --allow-motion``), and the operator is asked whether the robot may move. Without it the boards of its
    parts can only be asked.
    """

    safety: ClassVar[Safety] = Safety.STILL
    #: Parameters that are lists of numbers, and yet have not one value for all joints, or one for each.
    apart: ClassVar[tuple[str, ...]] = ()
    limits: ClassVar[Limits] = Limits()

    robot = Parameter(str, "name of the robot; without it --robotname of the suite, or that of the fixture", default="")
    inject = Parameter(
        str, "a fault of the simulated robot to begin with, such as: jam l_elbow torque=400 delay=0.5", default=""
    )

    network: Network
    clock: Clock
    _parts: dict[str, Part]
    _may_move = False

    def check_parameters(self, folder: str) -> None:
        super().check_parameters(folder)
        refuse(self, self.parameter_problems())

    def parameter_problems(self) -> list[str]:
        """What is wrong with the parameters, whatever the robot is; who derives may know more."""
        lists = wrong_lists(self, self.apart) if "joints" in self.declarations() else []
        return [*lists, *wrong_fault(self)]

    def implied_fixtures(self) -> Sequence[tuple[str, Mapping[str, str]]]:
        """See TestCase: whoever moves a robot stands on the fixture that puts it back, whatever becomes of the test.

        In lockstep that one would hold the time. There the simulator belongs to whoever has set it up so.
        """
        if self.safety is Safety.STILL or os.environ.get(CLOCK_VARIABLE, "").startswith("lockstep:"):
            return ()
        return (("robot", {"robot": self._name_of_robot(), "parts": "*"}),)

    def _name_of_robot(self) -> str:
        return robot_name(self.robot, self, _DEFAULT_ROBOT)

    def _tell_of_other_robot(self) -> None:
        other = os.environ.get(ROBOT_VARIABLE, "").strip("/")
        if other and other != self.robot_name:
            self.report(f"/{self.robot_name} is tested, as parameters or suite say; {ROBOT_VARIABLE} is {other}")

    def attach_to(self, session: Session, environment: str) -> None:
        super().attach_to(session, environment)
        session.excuse = self._excuse

    def _excuse(self, error: Exception) -> str:
        """Why a state that was too old, or a joint that was stopped, says nothing of the robot.

        In lockstep nothing excuses them.
        """
        if isinstance(error, GuardError):
            return error.excuse
        if not isinstance(error, StaleStateError) or isinstance(self.clock, LockstepClock):
            return ""
        return busyness(self._waiting.share())

    def setup(self) -> None:
        """Find the robot and its time, and ask whether it may move."""
        self._waiting = Waiting()
        self.robot_name = self._name_of_robot()
        self.network = default_network()
        self._tell_of_other_robot()
        self._parts = {}
        self.clock = clock_from_environment(self.network)
        used = clock.use(self.clock)
        used.__enter__()
        self.add_cleanup(used.__exit__, None, None, None)
        if self.safety is not Safety.STILL and not self.simulated:
            self._ask_for_leave()
        if self.inject:
            self._inject()

    def _inject(self) -> None:
        """Break the simulated robot; afterwards it is put back to its home, healthy."""
        control = SimulatorControl(self.robot_name, network=self.network)
        self.add_cleanup(control.close)
        kind, target, values = parse_injection(self.inject)
        delay, duration = values.pop("delay", 0.0), values.pop("duration", math.inf)
        self.add_cleanup(control.reset)
        try:
            control.inject(kind, target, values, delay=delay, duration=duration)
        except RobotError as error:
            self.assert_error(f"inject: {error}")

    @cached_property
    def simulated(self) -> bool:
        """Whether the robot is a simulated one: its simulator answers, when first asked. Its parts are asked apart."""
        return is_simulated(self.network, self.robot_name)

    def _ask_for_leave(self) -> None:
        """Skip the test, or the sub-result, unless a real robot may move. Whoever said yes is not asked again."""
        if self._may_move:
            return
        if not has_permission():
            self.skip(f"/{self.robot_name} is no simulated robot, and it would move: testrunner --allow-motion lets it")
        ledger = MotionLedger()
        ledger.decided(self.robot_name, may_move=False)  # nor may who puts it back move it while nobody has answered
        idle = ledger.left_idle(self.robot_name)
        warning = f" It may power again what was left idle, as it did not obey: {', '.join(idle)}." if idle else ""
        question = f"/{self.robot_name} is about to move.{warning} Is nobody within its reach, and may it?"
        if not self.confirm(question):
            self.skip("the operator does not want the robot to move")
        ledger.decided(self.robot_name, may_move=True)
        self._may_move = True

    def open_part(self, name: str) -> Part:
        """A part of the robot, opened when first asked for and put back at the end. Ends as an error without it."""
        if name not in self._parts:
            try:
                self._parts[name] = self._open(name)
            except RobotError as error:
                where = f" (part: {self.parameter_source('part')})" if name == getattr(self, "part", None) else ""
                self.assert_error(f"/{self.robot_name}/{name} cannot be worked with: {error}{where}")
        return self._parts[name]

    def _open(self, name: str) -> Part:
        # In step with a simulator nothing may still be on its way when the time goes on.
        carrier = "tcp" if isinstance(self.clock, LockstepClock) else "fast_tcp"
        place = f"/{self.robot_name}/{name}"
        moves = self.safety is not Safety.STILL
        if moves and not is_simulated(self.network, self.robot_name, name):
            self._ask_for_leave()  # a simulator answers, and this part is served by somebody else
        board = (connect if moves else listen_to)(place, carrier=carrier, network=self.network)
        self.add_cleanup(board.close)
        self._await_state(board)
        guard = forces = None
        if moves:
            forces = listen_to_forces(place, network=self.network, report=self.report)
            if forces is not None:
                self.add_cleanup(forces.close)
            guard = MotionGuard(
                board,
                place,
                clock=self.clock,
                report=self.report,
                limits=self.limits,
                contacts=None if forces is None else ContactWatch(board, forces),
            )
        part = Part(name, board, self.clock, guard)
        last = LastSeconds(self, part, forces)
        self.add_cleanup(last.write)
        if guard is not None:
            guard.on_stop = last.take_stop
            self.add_cleanup(guard.restore)
        self.add_cleanup(last.take)
        return part

    def _await_state(self, board: RemoteControlBoard) -> None:
        """Give a board the time that its first state takes, and more where it has not come. Raises StaleStateError."""
        end = self.now() + _LATEST_STATE
        while True:
            self.sleep(_FIRST_STATE)
            try:
                board.encoders()
            except StaleStateError:
                if self.now() >= end:
                    raise
            else:
                return

    # Judging -----------------------------------------------------------------------------------------------------

    def blame(self, error: GuardError, *findings: str, during: str = "") -> NoReturn:
        """End the test, or the sub-result, with what the guard has stopped: as failed, with the likely causes.

        It is inconclusive where this machine was too busy to control joints.
        """
        text = f"{during}: {error}" if during else str(error)
        if error.excuse:
            self.inconclusive(f"{text}; but {error.excuse}")
        self.assert_fail(f"{text}; {likely_causes(*findings)}")

    # Values ------------------------------------------------------------------------------------------------------

    def per_joint(self, name: str, values: Sequence[float], joints: Sequence[int]) -> list[float]:
        """The values of a parameter, one for each joint; a single one stands for all. Ends as an error for others."""
        if len(values) == 1:
            return [float(values[0])] * len(joints)
        if len(values) != len(joints):
            self.assert_error(
                f"{name} has {len(values)} values; give one, or one for each of the {len(joints)} joints "
                f"({self.parameter_source(name)})"
            )
        return [float(value) for value in values]

    def select(self, part: Part, wanted: Sequence[int]) -> list[int]:
        """The joints that the parameter ``joints`` says, or all. Ends as an error for one that is not there."""
        try:
            return part.select(wanted)
        except RefusedError as error:
            self.assert_error(f"joints: {error} ({self.parameter_source('joints')})")

    def require(
        self, arrival: Arrival, goal: str, part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray
    ) -> None:
        """End as an error unless a move that the test stands on has arrived, naming the joints that have not."""
        if arrival.reached:
            return
        late = [
            f"{part.names[joint]} is at {where:.2f} deg, not {target:.2f}"
            for joint, where, target in zip(joints, arrival.positions, targets, strict=True)
            if not abs(where - target) <= arrival.tolerance
        ]
        self.assert_error(f"{part.name} did not come {goal} within {arrival.seconds:.1f} s: {'; '.join(late)}")

    # Time --------------------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Seconds of the robot's clock."""
        return self.clock.now()

    def sleep(self, seconds: float) -> None:
        """Let the robot's time pass."""
        self.clock.sleep(seconds)


#: What a board may take to send its state, s of the robot's clock; and on a machine that is too busy.
_FIRST_STATE, _LATEST_STATE = 0.1, 2.0


def parse_injection(text: str) -> tuple[str, str, dict[str, float]]:
    """Kind, target and numbers of a fault, as the parameter ``inject`` has them. Raises ParameterError."""
    kind, *words = text.split()
    target = words.pop(0) if words and "=" not in words[0] else "-"
    values: dict[str, float] = {}
    for word in words:
        name, equals, number = word.partition("=")
        try:
            values[name] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise ParameterError("inject", [f"{word!r} is no number with a name, such as torque=400"])
    return kind, "" if target == "-" else target, values
