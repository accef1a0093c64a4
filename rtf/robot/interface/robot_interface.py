"""The state machine of a robot: startup, run, up to three interrupts, shutdown.

::

    startup ──────► run ──────► interrupt1 ──────► shutdown ──► the devices are closed
       │    all is well   a request    │  a further request: interrupt2, then interrupt3,
       └── something failed ────────┘  without waiting for what moves

All calls of devices run in threads. A device that raises or hangs is named in a message; the others are still parked,
detached and closed. There is no remedy against a device that crashes the process, or holds Python's interpreter lock.
"""

from __future__ import annotations

import itertools
import traceback
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf import clock
from rtf.clock import Deadline
from rtf.robot.interface.actions import job_of
from rtf.robot.interface.device_table import DeviceTable
from rtf.robot.interface.device_thread import Patience, StopRequests, Task, sentence_of
from rtf.robot.interface.log import Level, Log, discard, seconds
from rtf.robot.interface.model import INTERRUPTS, ActionKind, Phase

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Calibrator
    from rtf.robot.interface.actions import Job
    from rtf.robot.interface.model import Action, Robot


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a run: whether the robot was ready once, what failed, and which calls still hang."""

    ready: bool
    failures: tuple[str, ...]
    hanging: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether everything in the configuration was done."""
        return self.ready and not self.failures


@dataclass(slots=True, eq=False)
class _Going:
    """An action in progress."""

    action: Action
    task: Task
    deadline: Deadline
    calibrator: Calibrator | None = None
    logged: bool = False
    stopped: bool = False

    @property
    def over(self) -> bool:
        """Whether it is finished or its time is up."""
        return self.task.done or self.deadline.expired


class RobotInterface:
    """Runs a robot in the thread of ``run``; all other methods may be called from any thread.

    ``network`` is the network of the devices' ports. With ``autoclose`` the run ends as soon as the robot is ready.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        network: Network | None = None,
        patience: Patience | None = None,
        log: Log = discard,
        autoclose: bool = False,
    ) -> None:
        self.robot = robot
        self.phase = Phase.UNKNOWN
        self.level = 0
        self._patience = patience or Patience()
        self._log = log
        self._autoclose = autoclose
        self._stop_requests = StopRequests()
        self._heeded = 0
        self._was_ready = False
        self._moves: list[_Going] = []
        self._alone: list[Task] = []
        self._failures: list[str] = []
        self._device_table = DeviceTable(robot, network, self._patience, self._stop_requests, log)

    @property
    def ready(self) -> bool:
        """Whether all startup actions are done, and there is no stop request."""
        return self.phase is Phase.RUN and not self._stop_requests.count

    def interrupt(self) -> None:
        """Request a stop like a signal: the first in order, the second and third with shorter timeouts."""
        self._stop_requests.add()

    def quit(self) -> None:
        """Request a stop, unless there is a request already."""
        self._stop_requests.add(first_only=True)

    def run(self) -> Outcome:
        """Run all phases. Return when the devices are closed."""
        try:
            self._enter(Phase.STARTUP)
            if self._device_table.open_all():
                self._perform(Phase.STARTUP)
                self._be_ready()
                self._end()
            elif self._device_table.failures:
                self._log(Level.ERROR, "not all devices are open, so no action is executed")
        finally:
            self._close()
        # Aborted actions that were not awaited may be about to end.
        self._stop_requests.wait(lambda: all(task.done for task in self._alone), Deadline.after(self._patience.abort))
        hanging = [*self._device_table.hanging, *(task.name for task in self._alone if not task.done)]
        return Outcome(self._was_ready, (*self._device_table.failures, *self._failures), tuple(hanging))

    # Phases ------------------------------------------------------------------------------------------------------

    def _enter(self, phase: Phase, level: int = 0) -> None:
        if phase is not self.phase:
            self._log(Level.DEBUG, f"phase {phase}")
        self.level = level
        self.phase = phase

    def _be_ready(self) -> None:
        """Enter the phase run and wait for a stop request, unless something failed or there is one already."""
        if self._failures or self._stop_requests.count:
            return
        self._was_ready = True
        self._enter(Phase.RUN)
        self._log(Level.INFO, f"{self.robot.name} is ready")
        if self._autoclose:
            self.quit()
        self._stop_requests.wait(lambda: self._stop_requests.count > 0, Deadline())

    def _end(self) -> None:
        self.quit()
        self._heed_stop_requests()
        self._perform(Phase.SHUTDOWN)
        self._enter(Phase.SHUTDOWN)

    def _close(self) -> None:
        self._enter(Phase.SHUTDOWN)
        self._abort([one for one in self._moves if not one.task.done], self._patience.grace)
        for one in self._moves:
            self._judge(one)
        self._device_table.close_all()
        self._enter(Phase.UNKNOWN)

    def _heed_stop_requests(self) -> None:
        """Run the interrupt phases that were requested meanwhile."""
        while self._heeded < min(self._stop_requests.count, len(INTERRUPTS)):
            self._heeded += 1
            self._perform(INTERRUPTS[self._heeded - 1])

    def _perform(self, phase: Phase) -> None:
        """Run the actions of a phase, level by level, until the phase has to be left."""
        self._enter(phase)
        for level, actions in self.robot.levels(phase):
            if self._has_to_leave(phase):
                self._log(Level.WARNING, f"the rest of the phase {phase} is skipped, from level {level} on")
                return
            self._enter(phase, level)
            self._perform_level(phase, actions)
            if phase is Phase.SHUTDOWN:
                self._heed_stop_requests()

    def _has_to_leave(self, phase: Phase) -> bool:
        if phase is Phase.STARTUP:
            return self._stop_requests.count > 0
        return phase in INTERRUPTS and self._stop_requests.count > INTERRUPTS.index(phase) + 1

    # Actions -----------------------------------------------------------------------------------------------------

    def _perform_level(self, phase: Phase, actions: Sequence[Action]) -> None:
        heard = self._stop_requests.count
        moving: list[_Going] = []
        for moves, together in itertools.groupby(actions, key=lambda action: action.kind.moves):
            if moves:
                with clock.current().taking_part(self.robot.name):  # so that all begin at the same time
                    moving += self._begin_all(phase, together)
            else:
                for one in self._begin_all(phase, together):
                    self._device_table.wait_for(one.task, one.deadline.remaining())
                    self._judge(one)
        if phase in INTERRUPTS[1:]:
            return  # not awaited any more; what moves is stopped
        self._wait_for_moves(moving, heard)
        for one in moving:
            self._judge(one)

    def _begin_all(self, phase: Phase, actions: Iterable[Action]) -> Iterator[_Going]:
        """Start actions, until the phase has to be left; those that cannot start are reported."""
        for action in actions:
            if self._has_to_leave(phase):
                return
            one = self._begin(action)
            if one is not None:
                yield one

    def _begin(self, action: Action) -> _Going | None:
        """Start an action. Return None if that fails; the failure is reported."""
        usual = self._patience.move if action.kind.moves else self._patience.action
        deadline = Deadline.after(action.timeout or usual)
        what = str(action)
        try:
            job: Job = job_of(self.robot, action, self._device_table.devices)
            if action.kind.moves or action.kind is ActionKind.ABORT:
                task = self._start_alone(what, job.run)
            else:
                task = self._device_table.submit(action.device, what, job.run)
        except Exception as error:  # noqa: BLE001 - the other actions are still executed
            self._fail(action, f"failed: {sentence_of(error)}")
            return None
        one = _Going(action, task, deadline, job.calibrator)
        if action.kind.moves:
            self._moves.append(one)
        return one

    def _start_alone(self, what: str, job: Callable[[], object]) -> Task:
        """Run a call in a thread of its own: movements, and their aborts."""
        part = clock.current().taking_part(what)

        def run() -> object:
            with part:
                return job()

        self._alone.append(Task(what, run, self._stop_requests).start())
        return self._alone[-1]

    def _wait_for_moves(self, moving: Sequence[_Going], heard: int) -> None:
        """Wait for movements. Those that time out are aborted, and all of them at a stop request."""

        def settled() -> bool:
            return self._stop_requests.count > heard or all(one.over for one in moving)

        while not settled():
            pending = [one.deadline for one in moving if not one.over]
            self._stop_requests.wait(settled, min(pending, key=lambda deadline: deadline.at, default=Deadline.after(0)))
        patient = self._stop_requests.count <= 1 or self._stop_requests.count == heard
        self._abort([one for one in moving if not one.task.done], self._patience.grace if patient else 0.0)

    def _abort(self, moving: Sequence[_Going], grace: float) -> None:
        """Abort calibrators, each once, and give their movements some time to end."""
        calibrators = {id(one.calibrator): one for one in moving if one.calibrator is not None and not one.stopped}
        for one in moving:
            one.stopped = True
        stops = [
            (one.action, self._start_alone(f"the stopping of {one.action.device}", one.calibrator.abort))
            for one in calibrators.values()
            if one.calibrator is not None
        ]
        patience = Deadline.after(self._patience.abort)
        self._stop_requests.wait(lambda: all(task.done for _, task in stops), patience)
        for action, task in stops:
            if task.error is not None or not task.done:
                why = sentence_of(task.error) if task.error is not None else "it hangs in abort"
                self._fail(action, f"could not be stopped: {why}; check the robot")
            else:
                self._log(Level.WARNING, f"{action} was aborted")
        self._stop_requests.wait(lambda: all(one.task.done for one in moving), Deadline.after(grace if stops else 0.0))

    # Results -----------------------------------------------------------------------------------------------------

    def _judge(self, one: _Going) -> None:
        """Log the result of an action, once."""
        if one.logged:
            return
        one.logged = True
        if not one.task.done:
            why = f"hangs since {seconds(one.deadline.limit)}" if one.deadline.expired else "was not waited for"
            self._fail(one.action, why)
        elif one.task.error is not None:
            self._fail(one.action, f"failed: {sentence_of(one.task.error)}")
            self._log(Level.DEBUG, "".join(traceback.format_exception(one.task.error)))
        else:
            self._log(Level.INFO, f"{one.action} done in {seconds(one.task.duration)}")

    def _fail(self, action: Action, why: str) -> None:
        entry = self.robot.device(action.device)
        kind = f" [{entry.kind}]" if entry is not None else ""
        sentence = f"{action.location}: {action}{kind} {why}"
        self._failures.append(sentence)
        self._log(Level.ERROR, sentence)
