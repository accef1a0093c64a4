"""Runs a robot: startup, run, up to three interrupts, shutdown.

::

    startup ──────► run ──────► interrupt1 ──────► shutdown ──► the devices are closed
       │    all is well   a request    │  a further request: interrupt2, then interrupt3,
       └── something failed ────────┘  without waiting for what moves

Whatever a device does is done in threads: one that throws or hangs is named, and the rest is parked, detached and
closed. Nothing helps against a device that takes the whole process with it, or holds Python's lock for ever.
"""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.clock import Deadline
from rtf.robot.interface.actions import job_of
from rtf.robot.interface.device_table import DeviceTable
from rtf.robot.interface.model import INTERRUPTS, ActionKind, Phase
from rtf.robot.interface.tasks import Patience, StopRequests, Task, sentence_of
from rtf.robot.interface.telling import Tell, Weight, say_nothing, seconds

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.network import Network
    from rtf.robot.device import Calibrator
    from rtf.robot.interface.actions import Job
    from rtf.robot.interface.model import Action, Robot


@dataclass(frozen=True, slots=True)
class Outcome:
    """How it went: whether the robot was ready once, what failed, and what still hangs in this process."""

    ready: bool
    failures: tuple[str, ...]
    hanging: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether everything was done that the configuration says."""
        return self.ready and not self.failures


@dataclass(slots=True, eq=False)
class _Going:
    """An action that was begun."""

    action: Action
    task: Task
    deadline: Deadline
    calibrator: Calibrator | None = None
    told: bool = False
    stopped: bool = False

    @property
    def over(self) -> bool:
        """Whether there is nothing more to wait for."""
        return self.task.done or self.deadline.expired


class RobotInterface:
    """A robot that is run by one thread, in ``run``; all else may be called from any.

    ``network`` is where the devices open their ports. With ``autoclose`` it ends as soon as it is ready.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        network: Network | None = None,
        patience: Patience | None = None,
        tell: Tell = say_nothing,
        autoclose: bool = False,
    ) -> None:
        self.robot = robot
        self.phase = Phase.UNKNOWN
        self.level = 0
        self._patience = patience or Patience()
        self._tell = tell
        self._autoclose = autoclose
        self._stop_requests = StopRequests()
        self._heeded = 0
        self._was_ready = False
        self._moves: list[_Going] = []
        self._alone: list[Task] = []
        self._failures: list[str] = []
        self._device_table = DeviceTable(robot, network, self._patience, self._stop_requests, tell)

    @property
    def ready(self) -> bool:
        """Whether all actions of the startup were done, and nobody has asked for the end."""
        return self.phase is Phase.RUN and not self._stop_requests.count

    def interrupt(self) -> None:
        """Ask for the end as a signal does: the first time in order, the second and third time with less patience."""
        self._stop_requests.add()

    def quit(self) -> None:
        """Ask for the end, unless somebody has."""
        self._stop_requests.add(first_only=True)

    def run(self) -> Outcome:
        """Go through all phases; returns when the devices are closed."""
        try:
            self._enter(Phase.STARTUP)
            if self._device_table.open_all():
                self._perform(Phase.STARTUP)
                self._be_ready()
                self._end()
            elif self._device_table.failures:
                self._tell(Weight.ERROR, "not all devices are open, so nothing is done with those that are")
        finally:
            self._close()
        # What was told to stop and not waited for may be about to end.
        self._stop_requests.wait(lambda: all(task.done for task in self._alone), Deadline.after(self._patience.abort))
        hanging = [*self._device_table.hanging, *(task.name for task in self._alone if not task.done)]
        return Outcome(self._was_ready, (*self._device_table.failures, *self._failures), tuple(hanging))

    # Phases ------------------------------------------------------------------------------------------------------

    def _enter(self, phase: Phase, level: int = 0) -> None:
        if phase is not self.phase:
            self._tell(Weight.DEBUG, f"phase {phase}")
        self.level = level
        self.phase = phase

    def _be_ready(self) -> None:
        """Wait for a request for the end; but not if something has failed, or there is one."""
        if self._failures or self._stop_requests.count:
            return
        self._was_ready = True
        self._enter(Phase.RUN)
        self._tell(Weight.INFO, f"{self.robot.name} is ready")
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
        """Do what the interrupts say that have been asked for since."""
        while self._heeded < min(self._stop_requests.count, len(INTERRUPTS)):
            self._heeded += 1
            self._perform(INTERRUPTS[self._heeded - 1])

    def _perform(self, phase: Phase) -> None:
        """Do the actions of a phase level by level, until it has to be left for another one."""
        self._enter(phase)
        for level, actions in self.robot.levels(phase):
            if self._has_to_leave(phase):
                self._tell(Weight.WARNING, f"the rest of the phase {phase} is left out, from level {level} on")
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
        for action in actions:
            if self._has_to_leave(phase):
                break
            one = self._begin(action)
            if one is None:
                continue
            if action.kind.moves:
                moving.append(one)
            else:
                self._device_table.wait_for(one.task, one.deadline.remaining())
                self._judge(one)
        if phase in INTERRUPTS[1:]:
            return  # nobody waits any more; what moves is stopped before the devices are closed
        self._wait_for_moves(moving, heard)
        for one in moving:
            self._judge(one)

    def _begin(self, action: Action) -> _Going | None:
        """Begin an action; None if that is not possible, which has been told."""
        usual = self._patience.move if action.kind.moves else self._patience.action
        deadline = Deadline.after(action.timeout or usual)
        what = str(action)
        try:
            job: Job = job_of(self.robot, action, self._device_table.devices)
            if action.kind.moves or action.kind is ActionKind.ABORT:
                task = self._start_alone(what, job.run)
            else:
                task = self._device_table.submit(action.device, what, job.run)
        except Exception as error:  # noqa: BLE001 - whatever is wrong with one action, the others are still done
            self._fail(action, f"failed: {sentence_of(error)}")
            return None
        one = _Going(action, task, deadline, job.calibrator)
        if action.kind.moves:
            self._moves.append(one)
        return one

    def _start_alone(self, what: str, job: Callable[[], object]) -> Task:
        """Do something in a thread of its own: what moves the robot, and what stops that."""
        self._alone.append(Task(what, job, self._stop_requests).start())
        return self._alone[-1]

    def _wait_for_moves(self, moving: Sequence[_Going], heard: int) -> None:
        """Wait until all have ended. Whoever is out of time, and all when the end is asked for, are told to stop."""

        def settled() -> bool:
            return self._stop_requests.count > heard or all(one.over for one in moving)

        while not settled():
            pending = [one.deadline for one in moving if not one.over]
            self._stop_requests.wait(settled, min(pending, key=lambda deadline: deadline.at, default=Deadline.after(0)))
        patient = self._stop_requests.count <= 1 or self._stop_requests.count == heard
        self._abort([one for one in moving if not one.task.done], self._patience.grace if patient else 0.0)

    def _abort(self, moving: Sequence[_Going], grace: float) -> None:
        """Tell calibrators to stop, each once, and give what they do some time to end."""
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
                self._fail(action, f"could not be stopped: {why}; see to the robot")
            else:
                self._tell(Weight.WARNING, f"{action} was told to stop")
        self._stop_requests.wait(lambda: all(one.task.done for one in moving), Deadline.after(grace if stops else 0.0))

    # Telling -----------------------------------------------------------------------------------------------------

    def _judge(self, one: _Going) -> None:
        """Tell how an action went, once."""
        if one.told:
            return
        one.told = True
        if not one.task.done:
            why = f"hangs since {seconds(one.deadline.limit)}" if one.deadline.expired else "was not waited for"
            self._fail(one.action, why)
        elif one.task.error is not None:
            self._fail(one.action, f"failed: {sentence_of(one.task.error)}")
            self._tell(Weight.DEBUG, "".join(traceback.format_exception(one.task.error)))
        else:
            self._tell(Weight.INFO, f"{one.action} done in {seconds(one.task.duration)}")

    def _fail(self, action: Action, why: str) -> None:
        entry = self.robot.device(action.device)
        kind = f" [{entry.kind}]" if entry is not None else ""
        sentence = f"{action.location}: {action}{kind} {why}"
        self._failures.append(sentence)
        self._tell(Weight.ERROR, sentence)
