"""The base class of robot tests: connects to the robot, guards its parts, and records the states before a failure."""

from __future__ import annotations

# Three that each test would import for itself while it runs: for the names of hosts, for medians, and for the addresses
# of this machine. Imported here, they are loaded once, in the process from which the tests are forked.
import encodings.idna  # noqa: F401
import os
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import numpy.ma
import psutil  # noqa: F401

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, LockstepClock, clock_from_environment
from rtf.middleware.naming.waiting import await_name_server
from rtf.middleware.ports.network import default_network
from rtf.robot.errors import RefusedError, RobotError, StaleStateError
from rtf.robot_testing.failure_recording import FailureRecording
from rtf.robot_testing.guard.contacts import ContactWatch, listen_to_forces
from rtf.robot_testing.guard.heartbeat import Heartbeat
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.motion_record import MotionRecord
from rtf.robot_testing.guard.planned_moves import MoveCheck, read_positions
from rtf.robot_testing.guard.read_only_board import connect_read_only
from rtf.robot_testing.guard.safety import Safety
from rtf.robot_testing.guard.simulated import is_simulated
from rtf.robot_testing.injected_fault import inject_fault, wrong_fault
from rtf.robot_testing.judging.real_time_checks import CpuPressure, overload
from rtf.robot_testing.motion.part import Part
from rtf.robot_testing.parameter_checks import drop_surplus, refuse, wrong_lists
from rtf.robot_testing.robot_name import ROBOT_VARIABLE, robot_model, robot_name
from rtf.robot_testing.slides import as_text, converted, open_board, slides_of
from rtf.robot_testing.stop_judging import StopJudging
from rtf.robot_testing.thresholds import thresholds_for
from rtf.testing import Parameter, Unit
from rtf.testing.permission import has_permission
from rtf.testing.verdict import Inconclusive

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike

    from rtf.clock import Clock
    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel
    from rtf.robot_testing.motion.part import Arrival
    from rtf.testing.measurement import Measurement
    from rtf.testing.parameters import Given
    from rtf.testing.session import Session

_DEFAULT_ROBOT = "icubSim"


class RobotTest(StopJudging):
    """A test of a robot. ``setup`` connects to the robot; an override calls it first.

    ``safety`` declares what the test does to the robot. On a real robot every class above ``STILL`` needs permission
    (``testrunner --allow-motion``) and the consent of the operator. The parts of a ``STILL`` test are read-only.
    """

    safety: ClassVar[Safety] = Safety.STILL
    #: Names of the list parameters whose length has nothing to do with the number of joints.
    not_per_joint: ClassVar[tuple[str, ...]] = ()
    limits: ClassVar[Limits] = Limits()
    #: Whether it leaves out joints without torque control.
    torque_control: ClassVar[bool] = False
    #: The tables of ``[sensors]`` in robot.toml of which it judges all sensors.
    judged_sensors: ClassVar[tuple[str, ...]] = ()

    robot = Parameter(str, "name of the robot; without it --robotname of the suite, or that of the fixture", default="")
    check_moves = Parameter(
        bool,
        "whether the moves of a simulated robot are checked on its model, too, for self-collisions, "
        "as those of a real one always are; it takes about half a second for each test",
        default=False,
    )
    inject = Parameter(
        str, "a fault of the simulated robot to begin with, such as: jam l_elbow torque=400 delay=0.5", default=""
    )

    network: Network
    clock: Clock
    _parts: Mapping[str, Part] = MappingProxyType({})
    _slides: Mapping[str, float] = MappingProxyType({})  # metres a degree of prismatic joints of opened parts
    _may_move = False

    def profile(self, folder: str) -> Iterable[Given]:
        return thresholds_for(type(self), robot_model(self), folder)

    def subjects(self, robot: RobotModel) -> list[str]:
        """Return what the test judges of a robot, by its parameters: names of joints, and keys of sensors."""
        found = [
            key for key in robot.sensor_keys for kind in self.judged_sensors if f"{key}.".startswith(f"sensors.{kind}.")
        ]
        values = self.parameter_values()
        if values.get("part") in robot.parts:
            axes, chosen = robot.parts[values["part"]].axes, values.get("joints")
            wanted = [axis for place, axis in enumerate(axes) if not isinstance(chosen, list) or place in chosen]
            found += [axis.name for axis in wanted or axes if axis.torque_control or not self.torque_control]
        return found

    def check_parameters(self, folder: str) -> None:
        super().check_parameters(folder)
        if "joints" in self.declarations():
            self.parameter_warnings = (*self.parameter_warnings, *drop_surplus(self, self.not_per_joint))
        refuse(self, self.parameter_problems())

    def parameter_problems(self) -> list[str]:
        """Return the errors in the parameters that can be found without a robot. Subclasses may add theirs."""
        lists = wrong_lists(self, self.not_per_joint) if "joints" in self.declarations() else []
        return [*lists, *wrong_fault(self)]

    def implied_fixtures(self) -> Sequence[tuple[str, Mapping[str, str]]]:
        """Name the fixture ``robot`` for tests that move the robot: it restores the robot even if the test crashes.

        Not in lockstep: there the fixture would stop the time, and the simulator belongs to the program that steps it.
        """
        if self.safety is Safety.STILL or os.environ.get(CLOCK_VARIABLE, "").startswith("lockstep:"):
            return ()
        return (("robot", {"robot": self._name_of_robot(), "parts": "*"}),)

    def _name_of_robot(self) -> str:
        return robot_name(self.robot, self, _DEFAULT_ROBOT)

    def _report_other_robot(self) -> None:
        other = os.environ.get(ROBOT_VARIABLE, "").strip("/")
        if other and other != self.robot_name:
            self.report(f"/{self.robot_name} is tested, as parameters or suite say; {ROBOT_VARIABLE} is {other}")

    def attach_to(self, session: Session, environment: str) -> None:
        super().attach_to(session, environment)
        session.explain = self._explain_exception

    def _explain_exception(self, error: Exception) -> Exception:
        """Return what an exception proves: whose fault it is that a joint was stopped, or that a state is overdue.

        It may be that of this machine; in lockstep it never is: the robot's time waits for the test.
        """
        if isinstance(error, GuardError):
            part = self._parts.get(error.part_name.rpartition("/")[2])
            if part is not None and error.joint >= 0:
                return self.judged_stop(part, error)
            excuse = error.excuse
        else:
            excuse = self.busy() if isinstance(error, StaleStateError) else ""
        return Inconclusive(f"{error}; but {excuse}") if excuse else error

    def busy(self) -> str:
        """Return why this machine was overloaded during the test; "" if it was not, and in lockstep, which waits."""
        return "" if isinstance(self.clock, LockstepClock) else overload(self._cpu_pressure.share())

    def setup(self) -> None:
        """Connect to the robot and its clock, and ask for permission to move where it is needed."""
        self._cpu_pressure = CpuPressure()
        self.robot_name = self._name_of_robot()
        self.network = default_network()
        await_name_server(self.network, self.warn)
        if "YARP_FORWARD_LOG_ENABLE" in os.environ:  # imported only then
            from rtf.logs import forward_if_enabled

            forward_if_enabled(type(self).__name__)
        self._report_other_robot()
        if unvalidated := robot_model(self).unvalidated:
            self.report(unvalidated)
        self._parts = {}
        self.clock = clock_from_environment(self.network)
        used = clock.use(self.clock)
        used.__enter__()
        self.add_cleanup(used.__exit__, None, None, None)
        if self.safety is not Safety.STILL and not self.simulated:
            self._ask_for_permission()
        if self.inject:
            inject_fault(self, self.robot_name, self.network)

    @cached_property
    def simulated(self) -> bool:
        """Whether a simulator answers for the robot; checked once. Parts are checked when they are opened."""
        return is_simulated(self.network, self.robot_name)

    def _ask_for_permission(self) -> None:
        """Skip the test, or the sub-result, unless the real robot may move. A consent holds for the whole test."""
        if self._may_move:
            return
        if not has_permission():
            self.skip(
                f"/{self.robot_name} is not simulated, and the test moves it: allow it by testrunner --allow-motion"
            )
        record = MotionRecord()
        record.record_permission(self.robot_name, may_move=False)  # until the answer, for the fixture, too
        idle = record.excluded_joints(self.robot_name)
        warning = f" Joints that were excluded and left idle may get power again: {', '.join(idle)}." if idle else ""
        question = f"/{self.robot_name} is about to move.{warning} Is its workspace clear, and may it move?"
        if not self.confirm(question):
            self.skip("the operator did not permit the robot to move")
        record.record_permission(self.robot_name, may_move=True)
        self._may_move = True

    def has_part(self, name: str) -> bool:
        """Return whether a part of the robot is registered at the name server."""
        return self.network.names.query(f"/{self.robot_name}/{name}/stateExt:o") is not None

    def open_part(self, name: str) -> Part:
        """Return a part of the robot. The first call opens it, the clean-up restores it.

        The test ends with an error if the part cannot be opened.
        """
        if name not in self._parts:
            try:
                self._parts = {**self._parts, name: self._open(name)}
            except RobotError as error:
                where = f" (part: {self.parameter_source('part')})" if name == getattr(self, "part", None) else ""
                self.assert_error(f"/{self.robot_name}/{name} cannot be opened: {error}{where}")
        return self._parts[name]

    @cached_property
    def _move_check(self) -> MoveCheck | None:
        """What checks planned moves; None if they are not checked."""
        if self.simulated and not self.check_moves:
            return None
        try:
            positions = read_positions(
                robot_model(self),
                self.robot_name,
                network=self.network,
                carrier=self._carrier,
                opened=lambda board: self.add_cleanup(board.close),
            )
            self.sleep(_FIRST_STATE)
            return MoveCheck(robot_model(self), positions)
        except RtfError as error:
            self.warn(f"moves are not checked for self-collisions: {error}")
            return None

    @cached_property
    def _heartbeat(self) -> Heartbeat | None:
        """The heartbeat of all guards of this test; None in lockstep, where the robot's time waits for the test."""
        if isinstance(self.clock, LockstepClock):
            return None
        beating = Heartbeat(self.robot_name)
        self.add_cleanup(beating.close)
        return beating

    @property
    def _carrier(self) -> str:
        """In lockstep no message may be under way when the time advances: tcp waits for the acknowledgement."""
        return "tcp" if isinstance(self.clock, LockstepClock) else "fast_tcp"

    def _open(self, name: str) -> Part:
        place = f"/{self.robot_name}/{name}"
        moves = self.safety is not Safety.STILL
        if moves and (reason := MotionRecord().unrestored(place)):
            raise RobotError(f"it could not be restored after an earlier test, and is not moved: {reason}")
        if moves and not is_simulated(self.network, self.robot_name, name):
            self._ask_for_permission()  # a simulator answers for the robot, but does not serve this part
        if moves:
            slides = slides_of(robot_model(self), name)
            board = open_board(place, slides, carrier=self._carrier, network=self.network)
            self._slides = {**self._slides, **slides}
        else:
            board = connect_read_only(place, carrier=self._carrier, network=self.network)
        self.add_cleanup(board.close)
        self._await_state(board)
        guard = forces = None
        if moves:
            forces = listen_to_forces(robot_model(self), place, network=self.network, report=self.report)
            if forces is not None:
                self.add_cleanup(forces.close)
            guard = MotionGuard(
                board,
                place,
                clock=self.clock,
                report=self.report,
                limits=self.limits,
                contacts=None if forces is None else ContactWatch(board, forces, robot_model(self), name),
                robot=robot_model(self),
                heartbeat=self._heartbeat,
                moves=self._move_check if name in robot_model(self).parts else None,
            )
            self.report(guard.coverage())
        robot = robot_model(self)
        part = Part(
            name, board, self.clock, guard, together=robot.together(name), robot=robot, simulated=self.simulated
        )
        recording = FailureRecording(self, part, forces)
        self.add_cleanup(recording.write)
        if guard is not None:
            guard.on_stop = recording.take_stop
            self.add_cleanup(guard.restore)
        self.add_cleanup(recording.take)
        return part

    def _await_state(self, board: RemoteBoard) -> None:
        """Wait for the first state of a board. Raises StaleStateError after ``_LATEST_STATE`` seconds."""
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

    # Values ------------------------------------------------------------------------------------------------------

    def per_joint(self, name: str, values: Sequence[float], joints: Sequence[int]) -> list[float]:
        """Return one value of the parameter ``name`` for each joint; a single value applies to all joints.

        The test ends with an error for any other number of values.
        """
        if len(values) == 1:
            return [float(values[0])] * len(joints)
        if len(values) != len(joints):
            self.assert_error(
                f"{name} has {len(values)} values; give one, or one for each of the {len(joints)} joints "
                f"({self.parameter_source(name)})"
            )
        return [float(value) for value in values]

    def select(self, part: Part, wanted: Sequence[int]) -> list[int]:
        """Return the joints of the parameter ``joints``, or all joints if it is empty.

        The test ends with an error for a joint that the part does not have.
        """
        try:
            return part.select(wanted)
        except RefusedError as error:
            self.assert_error(f"joints: {error} ({self.parameter_source('joints')})")

    def require(
        self, arrival: Arrival, goal: str, part: Part, joints: Sequence[int], targets: Sequence[float] | FloatArray
    ) -> None:
        """End the test with an error unless a move has arrived; ``goal`` and the late joints are in the message."""
        if not arrival.reached:
            late = arrival.late(part, joints, targets)
            self.assert_error(f"{part.name} did not reach {goal} within {arrival.seconds:.1f} s: {late}")

    # Units of prismatic joints -----------------------------------------------------------------------------------

    def _metres(self) -> float | None:
        """Return the metres that stand for a degree, in the sub-result of a prismatic joint; else None."""
        if not self._slides:
            return None
        named = [f"{word} " for word in self._session.subject.split("/")]  # such as "lift" and "lift single"
        return next((size for name, size in self._slides.items() if any(w.startswith(f"{name} ") for w in named)), None)

    def shown(self, degrees: float, spec: str = ".2f", rate: str = "") -> str:
        """Return a position, distance or speed (``rate`` "/s") of the sub-result's joint as text, in its unit."""
        return self.as_text(degrees, f"deg{rate}", spec)

    def as_text(self, value: float, symbol: str, spec: str = ".2f") -> str:
        """Return a value of the sub-result's joint in ``symbol``, such as ``Nm``, as text, in its unit."""
        return as_text(self._metres(), value, symbol, spec)

    def measure(
        self,
        name: str,
        value: float,
        symbol: str | Unit = Unit.NONE,
        low: float | None = None,
        high: float | None = None,
        marginal: float | None = None,
        hint: str = "",
    ) -> Measurement:
        """See TestCase. Values in degrees or Nm of a prismatic joint, in its sub-result, are reported in m or N."""
        factor, symbol = converted(self._metres(), str(symbol))
        low, high, marginal = (None if one is None else one * factor for one in (low, high, marginal))
        return super().measure(name, value * factor, symbol, low, high, marginal, hint)

    def record(self, name: str, /, **columns: tuple[ArrayLike, str | Unit]) -> Path:
        """See TestCase. Likewise."""
        metres, given = self._metres(), dict(columns)
        if metres is not None:
            for column, (data, unit) in columns.items():
                factor, symbol = converted(metres, str(unit))
                given[column] = np.asarray(data) * factor, symbol
        return super().record(name, **given)

    # Time --------------------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Return the time of the robot's clock, in s."""
        return self.clock.now()

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of the robot's time."""
        self.clock.sleep(seconds)


#: Time for the first state of a board, s of the robot's clock: usually, and at most on a busy machine.
_FIRST_STATE, _LATEST_STATE = 0.1, 2.0
