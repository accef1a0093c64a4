"""The supervisor of a robot: it watches all parts, and stops the robot when the guard of a test does not watch.

It runs in the fixture ``robot``, in a process that outlives the tests: what a test process does that is killed, or
hangs, is no matter. It does not watch in lockstep, where the time of the robot waits for the tests.
"""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING

from rtf import clock
from rtf.robot.errors import RobotError, StaleStateError
from rtf.robot_testing.guard.heartbeat import heartbeats
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.motion_record import MotionRecord

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from rtf.robot_testing.guard.heartbeat import Heard
    from rtf.robot_testing.guard.motion_guard import MotionGuard

#: Period of the checks, s.
PERIOD = 0.05
#: A guard that has not watched for so long is taken for dead, s: fifteen of its periods. With a period of this and the
#: requests to all boards, the robot is stopped within half a second.
SILENCE = 0.3
#: Seconds after a stop until the next look at what goes on: joints come to rest meanwhile.
_PAUSE = 0.5


class Supervisor:
    """The supervisor of a robot's parts, by their guards, from its construction to ``close``.

    ``using`` is held while it talks to the boards. ``may_move`` returns whether the parts may be commanded: never on a
    real robot that no test was permitted to move.
    """

    def __init__(
        self,
        robot: str,
        guards: Collection[MotionGuard],
        *,
        using: threading.Lock,
        may_move: Callable[[], bool],
        report: Callable[[str], None],
    ) -> None:
        self._robot, self._guards = robot, tuple(guards)
        self._using, self._may_move, self._report = using, may_move, report
        self._folder = os.environ.get("RTF_RUN_FOLDER")
        self._pause = clock.Deadline.after(0.0)  # until then, what was stopped may come to rest
        self._stopped: set[str] = set()  # joints that were stopped, since a guard has watched
        self._said = ""
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor of the robot", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(PERIOD):
            with self._using:
                if not self._end.is_set():
                    self._check_surely()

    def _check_surely(self) -> None:
        try:
            self.check()
        except Exception as error:  # noqa: BLE001 - the next look may succeed, and the error is reported
            self._say(f"the robot was not watched: {type(error).__name__}: {error}")

    def check(self) -> None:
        """Look at the heartbeats and at all joints once."""
        if self._folder is None:
            return
        for heard in heartbeats(self._folder, self._robot):
            if heard.is_orphaned():
                if self._stop("the process of the test that moved the robot has died"):
                    heard.forget()
            elif heard.silence() > SILENCE:
                self._stop(f"the guard of the test did not watch for {SILENCE:g} s", heard)
            else:
                self._pause = clock.Deadline.after(0.0)
                self._stopped.clear()
                if pressed := self._watch():
                    heard.answer(pressed)

    def _watch(self) -> str:
        """Release joints that press, of any part; return the texts."""
        if not self._may_move():
            return ""
        said, failed = list[str](), list[str]()
        for guard in self._guards:
            try:
                guard.watch_pressing()
            except GuardError as error:
                said.append(str(error))
            except RobotError as error:
                failed.append(f"{guard.name} is not watched: {error}")
        self._say("; ".join(failed))
        return "; ".join(said)

    def _stop(self, why: str, silent: Heard | None = None) -> bool:
        """Stop what goes on without the test's process, such as a long move; notify the guard that is ``silent``.

        Return whether nothing is left to be done: a part that could not be stopped is tried again after a pause, as is
        a joint that moves again.
        """
        if not self._may_move():
            return True
        if not self._pause.expired:
            return False
        began, stopped, failed = clock.monotonic(), list[str](), list[str]()
        for guard in self._guards:
            try:
                stopped += self._halt(guard)
            except RobotError as error:
                failed.append(f"{guard.name} could not be stopped: {error}")
        if stopped or failed:
            self._pause = clock.Deadline.after(_PAUSE)
        self._say("; ".join(failed))
        if not self._stopped.issuperset(stopped):
            self._stopped.update(stopped)
            self._report(f"{why}: {', '.join(stopped)} stopped within {clock.monotonic() - began:.2f} s")
            if silent is not None:
                silent.answer(f"the robot was stopped: {why}")
        return not failed

    def _say(self, sentence: str) -> None:
        """Report a problem that lasts once; "" says that there is none any more."""
        if sentence and sentence != self._said:
            self._report(sentence)
        self._said = sentence

    @staticmethod
    def _halt(guard: MotionGuard) -> list[str]:
        """Stop the joints of a part that go on, all of them if its states have stopped; return their names."""
        guard.adopt_exclusions(MotionRecord().excluded(guard.name))  # by the test: they get no power
        try:
            going = guard.going()
        except StaleStateError:
            guard.reactions.hold_without_states()
            return [*guard.names]
        if going:
            guard.halt(going)
        return [guard.names[joint] for joint in going]

    def close(self) -> None:
        """End the checks."""
        self._end.set()
        self._thread.join()
