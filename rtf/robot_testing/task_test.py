"""Base class of tests of controllers in space: their client, their settings, and what they do not answer."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from rtf.bottle import Property, as_list, as_string
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.robot.device import make_device
from rtf.robot.errors import NoAnswerError, RefusedError, RobotError, StaleStateError
from rtf.robot.interfaces import ITaskControl
from rtf.robot_testing.guard.safety import Safety
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.motion.limb import LimbGuardError, encoder_disagreement
from rtf.robot_testing.motion.part import PACE
from rtf.robot_testing.motion.start_position import late_evidence
from rtf.robot_testing.robot_test import RobotTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.robot.device import Device
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part, Trace
    from rtf.robot_testing.motion.limb import JointGroup

C = TypeVar("C", bound=ITaskControl)

#: Time in which joints come to rest after a stop, s, and the least way that is left to all of them then, deg.
_RESTS, _FAR = 1.0, 3.0


class TaskTest(RobotTest, Generic[C]):
    """A test of a controller that moves ``limb``; ``remote`` is the beginning of its ports.

    The controller has the settings of its start meanwhile; its own are restored afterwards.
    """

    safety = Safety.MOTION

    # Joints of a healthy robot go on by a tenth.
    after_stop = Parameter(
        float, "greatest share of their way that joints still go after a stop of the controller", unit="%",
        default=30.0, low=0.1,
    )  # fmt: skip

    control: C
    limb: JointGroup
    remote: str
    _answers = True

    def look_for(self, end: str, what: str, todo: str) -> None:
        """Check that the controller has its port of requests. The test cannot be done without one."""
        found = self.network.names.query(f"{self.remote}{end}")
        self.assert_error_if_false(found, f"there is no {what} {self.remote}; {todo}")

    def connect(self, client: str) -> Device:
        """Return an open client of a type; the test fails if the controller cannot be used."""
        carrier = "tcp" if isinstance(self.clock, LockstepClock) else "udp"
        where = Property({"remote": self.remote, "carrier": carrier})
        try:
            made = make_device(client, where, network=self.network)
        except RobotError as error:
            self.assert_fail(f"{self.remote} cannot be used: {error}")
        self.add_cleanup(made.close)
        return made

    def controller_info(self) -> dict[str, str]:
        """Return what the controller says of itself, by keys such as ``arm_version``."""
        with self.asking():
            pairs = [as_list(one) for one in self.control.info()]
        return {as_string(pair[0]): as_string(pair[1]) for pair in pairs if pair is not None and len(pair) > 1}

    def begin_settings(self) -> None:
        """Store the settings of the controller, which are restored at the end, and begin with those of its start."""
        context = self.control.store_context()
        self.add_cleanup(self._restore, context)
        self.control.restore_context(0)

    def _restore(self, context: int) -> None:
        """End a motion, and restore the settings that the controller had; one that does not answer is left as it is."""
        if not self._answers:
            self.warn(f"the settings of {self.remote} could not be restored: it does not answer")
            return
        self.control.stop()
        self.control.restore_context(context)
        self.control.delete_contexts([context])

    def stop_controller(self) -> None:
        """Stop the controller, so that it does not move what the guard has stopped."""
        try:
            self.control.stop()
        except RobotError as error:
            self._answers = False
            self.warn(f"{self.remote} could not be stopped: {error}")

    def judge_encoders(
        self, late: dict[tuple[str, int], str], traces: list[tuple[Part, Trace]], unfinished: str, arrived: str
    ) -> None:
        """Fail joints that are not where the controller wants them, or whose encoders do not agree with their motors'.

        ``late`` has a sentence for each such joint, by part and number. The test ends with the first part that has one,
        or with ``unfinished``, unless it is empty: it says that a motion was not done, and ``arrived`` that no joint is
        late.
        """
        for part, trace in traces:
            wrong = {place: text for (owner, place), text in late.items() if owner == part.name}
            evidence = encoder_disagreement(part, trace, Transmission.read(part.board))
            for joint in sorted({joint for one in evidence for joint in one.joints} | set(wrong)):
                text = wrong.get(joint, f"{part.names[joint]} has arrived by its encoder")
                complaint = Evidence.uncertain(joint, text, "does not move")
                self.judge_evidence(part, joint, complaint, [*evidence, *(late_evidence(part, wrong) if wrong else [])])
        self.assert_fail_if_true(
            unfinished, f"{unfinished}{': ' + '; '.join(late.values()) if late else f'; {arrived}'}"
        )

    def judge_controller_stop(
        self, begin: Callable[[], None], wanted: Callable[[], FloatArray], seconds: float
    ) -> None:
        """Begin a motion, stop it after some seconds, and judge how much of their way the joints still go.

        ``wanted`` returns where the controller wants the last joints of the limb to be (deg).
        """
        try:
            with self.asking():
                begin()
                self._watch_for(seconds)
                target = wanted()
                here = self.limb.positions()[-len(target) :]
                self.control.stop()
            self._watch_for(_RESTS)
        except LimbGuardError as error:
            self.stop_controller()
            self.blame(error.part, error, "does not move", during=f"a motion that {self.remote} was to stop")
        left, gone = target - here, self.limb.positions()[-len(target) :] - here
        way = float(np.linalg.norm(left))
        with self.subresult("stopped"):
            if way < _FAR:
                self.report(f"the stop of {self.remote} is not judged: it had arrived already")
                return
            share = 100.0 * float(np.linalg.norm(gone)) / way
            hint = f"{self.remote} goes on after it was stopped; {likely_causes('controller stop')}"
            self.measure("way after a stop", share, "%", high=self.after_stop, hint=hint)

    def _watch_for(self, seconds: float) -> None:
        """Let time pass while the guards watch. Raises LimbGuardError."""
        end = self.now() + seconds
        while self.now() < end:
            self.sleep(PACE)
            self.limb.watch()

    def judge_word(self, late: dict[tuple[str, int], str]) -> None:
        """Fail the controller for joints that were ``late`` when it said that its motion was done.

        It reads the same encoders, so it knows that they were not there. Joints that are late only afterwards have gone
        away by themselves.
        """
        self.assert_fail_if_true(
            late,
            f"{self.remote} says that its motion is done, and it is not: {'; '.join(late.values())}; "
            f"{likely_causes('done too early')}",
        )

    @contextmanager
    def asking(self) -> Iterator[None]:
        """Turn what a controller answers wrongly, or not at all, into a failure of the test."""
        try:
            yield
        except NoAnswerError as error:
            self._answers = False
            self.assert_fail(f"{self.remote} does not answer: {error}; {likely_causes('controller silent')}")
        except StaleStateError as error:
            self.assert_fail(f"{self.remote} sends its state late: {error}; {likely_causes('controller late')}")
        except RefusedError as error:
            self.assert_fail(f"{error}{self._broken_joints()}")

    def _broken_joints(self) -> str:
        """Return which joints cannot move, for the reason of a refusal."""
        broken = [
            f"{joint} is in {mode.word}"
            for joint, (part, number) in zip(self.limb.joints, self.limb.places, strict=True)
            for mode in part.board.control_modes([number])
            if mode.word in ("hwfa", "idl", "cfgn")
        ]
        return f"; {', '.join(broken)}" if broken else ""
