"""Failures are attributed to the joint that caused them, with its likely causes, and to no other."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import pytest

from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RobotError
from rtf.robot_testing import GuardError
from rtf.robot_testing.joints_test import command_at
from rtf.robot_testing.judging.real_time_checks import RecentCpuPressure
from rtf.testing.events import Event, Message, SubResultEnded
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import find
from rtf.testing.session import Session
from rtf.testing.verdict import Severity, TestFailure, TestProblem, Verdict

from .part_bench import Joints, PartBench

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

POSITION, IDLE = ControlMode.POSITION, ControlMode.IDLE
#: Where a joint stands that does not come home, and where one is far beyond its limits, deg.
AWAY, BEYOND = 20.0, 200.0


@pytest.fixture
def bench() -> Iterator[PartBench]:
    """The bench: of its three joints the last two are coupled."""
    with ExitStack() as stack:
        yield PartBench(stack)


@pytest.fixture
def said() -> list[Event]:
    """The reports of the tests."""
    return []


@pytest.fixture
def made(bench: PartBench, said: list[Event], tmp_path: Path) -> Callable[..., Any]:
    """Make a test of the joints of the bench with these attributes; without a name one with an empty ``run``."""

    def make(name: str = "", **attributes: Any) -> Any:
        test = load_test(find("test", name)) if name else Joints()
        test.attach_to(Session("t", said.append, folder=tmp_path, run_folder=tmp_path), "")
        for key, value in {"robot_part": bench.part, "clock": bench.time, "chosen": [0, 1, 2], **attributes}.items():
            setattr(test, key, value)
        return test

    return make


def show(bench: PartBench, positions: dict[int, float]) -> None:
    """Publish these positions, whatever is commanded."""
    bench.device.shown = positions
    bench.publish()


def failures(said: list[Event]) -> dict[str, str]:
    """Return the failures of the sub-results."""
    return {one.subject: one.detail for one in said if isinstance(one, Message) and one.severity is Severity.FAILURE}


def verdicts(said: list[Event]) -> dict[str, Verdict]:
    """Return the ends of the sub-results."""
    return {one.subject: one.verdict for one in said if isinstance(one, SubResultEnded)}


def test_a_joint_that_does_not_return_fails_alone(
    bench: PartBench, said: list[Event], made: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
):
    """With likely causes. It is held where it is, and the others are tested."""
    test, stopped = made(), list[object]()
    show(bench, {0: AWAY})
    monkeypatch.setattr(bench.board, "stop", stopped.append)
    test.bring_home()
    assert test.chosen == [1, 2]
    assert {*failures(said)} == {"joint0"}
    assert "joint0 is at 20.00 deg, not at 0.00" in failures(said)["joint0"]
    assert "likely: a broken motor cable" in failures(said)["joint0"]
    assert bench.board.control_modes() == (POSITION, POSITION, POSITION)
    assert bench.part.held() == [0, 1, 2]
    assert stopped == [[0]]


def test_joints_coupled_with_it_are_not_judged(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):  # fmt: skip
    """They are not tested, and do not fail."""
    test = made()
    show(bench, {1: AWAY})
    test.bring_home()
    assert test.chosen == [0]
    assert verdicts(said) == {"joint1": Verdict.FAILED, "joint2": Verdict.INCONCLUSIVE}


def test_each_joint_that_does_not_return_is_named(bench: PartBench, said: list[Event], made: Callable[..., Any]):
    """Also coupled ones; without any joint left the test ends."""
    test = made()
    show(bench, {0: AWAY, 1: AWAY, 2: -AWAY})
    with pytest.raises(TestFailure, match="no joint is left"):
        test.bring_home()
    assert verdicts(said) == dict.fromkeys(["joint0", "joint1", "joint2"], Verdict.FAILED)


def test_an_untested_joint_that_does_not_return_ends_the_test(bench: PartBench, made: Callable[..., Any]):
    """The others cannot be tested in their posture then."""
    test = made(chosen=[0])
    show(bench, {2: AWAY})
    with pytest.raises(TestProblem, match="joint2 is at 20"):
        test.bring_home()


def test_a_joint_that_is_stopped_on_its_way_is_excluded(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):  # fmt: skip
    """It gets no power, and the others are moved."""
    test = made()
    show(bench, {0: BEYOND})
    test.bring_home()
    assert test.chosen == [1, 2]
    assert (
        "joint0 (/fake joint 0) is at 200.0 deg, beyond its limits; it was stopped; likely: "
        in (failures(said)["joint0"])
    )
    assert bench.part.held() == [1, 2]


@pytest.mark.parametrize(("name", "more"), [("JointLimits", {}), ("position-stress", {"_done": 0})])
def test_the_stopped_joint_fails_and_not_the_tested_one(
    bench: PartBench, said: list[Event], made: Callable[..., Any], name: str, more: dict[str, Any]
):
    """The tested joint is not judged; it is held where it is, and the next one is tested."""
    every = np.full(3, 10.0)
    test = made(name, speeds=every, beyond=every, near=every, bottom=-every, top=every, _spans={}, **more)
    test._commanded, test._heading = {0: []}, {}
    routine = test._routine(0)
    next(routine)
    bench.time.sleep(0.1)
    assert not bench.board.motion_done(0)
    with pytest.raises(StopIteration):
        routine.throw(GuardError("joint2 (/fake joint 2) turns at 153 deg/s, too fast; it was stopped", 2))
    assert verdicts(said) == {"joint2": Verdict.FAILED, "joint0": Verdict.INCONCLUSIVE}
    assert "likely: a joint without torque" in failures(said)["joint2"]
    assert bench.board.motion_done(0)


BUSY = "this machine is too busy: for 97% of the time a task waited for a CPU"


@pytest.mark.parametrize("name", ["JointLimits", "position-stress"])
def test_a_stop_on_a_busy_machine_is_inconclusive(
    bench: PartBench, said: list[Event], made: Callable[..., Any], name: str, monkeypatch: pytest.MonkeyPatch
):
    """At the beginning and later: the joint is stopped and excluded as usual, and does not fail."""
    monkeypatch.setattr(bench.guard, "excuse", lambda: BUSY)
    test = made(name)
    show(bench, {0: BEYOND})
    test.bring_home()
    assert test.chosen == [1, 2]
    assert bench.part.held() == [1, 2]
    test.judge_own_stop(1, GuardError("joint1 turns at 153 deg/s, too fast; it was stopped", 1, BUSY))
    assert verdicts(said) == {"joint0": Verdict.INCONCLUSIVE, "joint1": Verdict.INCONCLUSIVE}
    reasons = [one.reason for one in said if isinstance(one, SubResultEnded)]
    assert all(reason.endswith(f"; but {BUSY}") for reason in reasons)
    assert "beyond its limits; it was stopped" in reasons[0]


@pytest.mark.parametrize(("excuse", "verdict"), [("", Verdict.FAILED), (BUSY, Verdict.INCONCLUSIVE)])
def test_a_stop_ends_the_sub_result(
    bench: PartBench, said: list[Event], made: Callable[..., Any], excuse: str, verdict: Verdict
):
    """Whether the test handles the error or not."""
    test, error = made(), GuardError("joint1 turns too fast; it was stopped", 1, excuse)
    with test.subresult("reported"):
        test.blame(bench.part, error, "runs away", during="group")
    with test.subresult("unreported"):
        raise error
    assert verdicts(said) == {"reported": verdict, "unreported": verdict}
    text = [one.reason for one in said if isinstance(one, SubResultEnded)] if excuse else [*failures(said).values()]
    assert text[0].startswith("group: joint1 turns too fast; it was stopped; ")
    assert ("likely: gains far too large" in text[0]) is not bool(excuse)


def test_a_stop_for_which_a_test_is_not_prepared_is_judged_by_the_evidence(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):
    """The motor that is driven hard and stands still is named; the one that was stopped is shaken by its joint."""
    test = made(_parts={"fake": bench.part})
    bench.device.duties = {0: 100.0}
    for _ in range(50):
        bench.time.sleep(0.01)
    with test.subresult("move"):
        raise GuardError("joint1 turns too fast; it was stopped", 1, part_name="/fake")
    assert failures(said)["move"].startswith("the motor of joint0 does not turn at a duty cycle of +100 %; likely: ")
    assert "joint1 turns too fast" in failures(said)["move"]


def test_a_stop_counts_as_it_is_if_its_part_reports_no_more(
    bench: PartBench, said: list[Event], made: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
):
    """Such as a board that was lost."""

    def lost(*_: object) -> NoReturn:
        raise RobotError("no answer")

    monkeypatch.setattr("rtf.robot_testing.stop_judging.stop_evidence", lost)
    test = made(_parts={"fake": bench.part})
    with test.subresult("move"):
        raise GuardError("joint1 turns too fast; it was stopped", 1, part_name="/fake")
    assert failures(said) == {"move": "joint1 turns too fast; it was stopped"}
    warnings = [one.detail for one in said if isinstance(one, Message) and one.severity is Severity.WARNING]
    assert warnings == ["fake does not tell whose fault a stop was: no answer"]


@pytest.mark.parametrize(("joints", "verdict"), [((1,), Verdict.FAILED), ((0,), Verdict.INCONCLUSIVE)])
def test_a_stop_of_a_joint_that_did_not_belong_to_a_motion_is_no_failure_of_it(
    bench: PartBench, said: list[Event], made: Callable[..., Any], joints: tuple[int, ...], verdict: Verdict
):
    """It is named; a motion of the joint itself fails."""
    test, error = made(), GuardError("joint1 turns too fast; it was stopped", 1)
    with test.subresult("group"):
        test.blame(bench.part, error, "runs away", joints=joints)
    assert verdicts(said) == {"group": verdict}


def test_a_stop_during_the_turn_of_another_joint_fails_the_stopped_one(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):
    """In a sub-result of its own; the joint whose turn it was is inconclusive, and names it."""
    test = made()
    test.judge_stop(bench.part, 0, GuardError("joint1 turns too fast; it was stopped", 1))
    assert verdicts(said) == {"joint0": Verdict.INCONCLUSIVE, "joint1": Verdict.FAILED}
    assert "joint1 turns too fast" in next(one.reason for one in said if isinstance(one, SubResultEnded))


def test_errors_of_the_guard_have_an_excuse_on_a_busy_machine(bench: PartBench, monkeypatch: pytest.MonkeyPatch):
    """Not in lockstep, where the time waits for the test."""
    monkeypatch.setattr(RecentCpuPressure, "overload", lambda _: BUSY)
    show(bench, {0: BEYOND})
    with pytest.raises(GuardError) as caught:
        bench.guard.watch()
    assert caught.value.excuse == BUSY
    monkeypatch.setattr(bench.guard, "clock", object.__new__(LockstepClock))
    assert bench.guard.excuse() == ""


def test_an_excluded_joint_is_no_failure_of_later_ones(bench: PartBench, said: list[Event], made: Callable[..., Any]):
    """A joint that becomes idle by itself is a failure."""
    test = made("position-stress")
    bench.guard.exclude(1, "it does not obey")
    test._judge_modes(0, np.array([[POSITION, IDLE, POSITION]]))
    assert failures(said) == {}
    test._judge_modes(0, np.array([[POSITION, IDLE, IDLE]]))
    assert failures(said) == {"joint2": "joint2 went into idl while joint0 moved"}


def test_limits_without_a_range_are_a_failure_of_their_joint(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):
    """Before anything moves; the joint is excluded, as it cannot be watched, and the others are tested."""
    test = made("JointLimits")
    bench.part.low[0], bench.part.high[0] = 50.0, -50.0
    test._exclude_joints_without_range()
    assert test.chosen == [1, 2]
    assert failures(said) == {
        "joint0": "joint0: the limits 50 deg and -50 deg leave no range; "
        "likely: swapped or missing limits in the configuration"
    }
    assert [joints for _, joints in bench.device.asked] == [[0]]
    assert bench.device.control_modes() == (IDLE, POSITION, POSITION)


def test_a_joint_that_does_not_arrive_has_not_lost_its_command(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):  # fmt: skip
    """As the board reports the target."""
    test = made("MovementReferencesTest", targets=np.full(3, 5.0), speeds=np.full(3, 20.0))
    show(bench, {0: 0.0})
    test._position()
    assert {*failures(said)} == {"joint0"}
    assert "arrival is 0 deg, not 5; likely: a broken motor cable" in failures(said)["joint0"]
    assert "lost" not in failures(said)["joint0"]


def test_a_wrong_amplitude_has_causes(made: Callable[..., Any]):
    """The causes at the joint are others than those at the board."""
    direct = made("PositionDirect")
    assert "likely: a weak motor" in direct._gain("joint0", "amplitude", 0.5, "weak").hint
    assert "likely: a loaded network" in direct._gain("joint0", "amplitude", 0.5, "lost commands").hint


def test_the_recorded_command_is_the_last_one():
    """Before the first command it is the first one, so that the plot has a line."""
    commands = [(1.0, 10.0), (2.0, -10.0)]
    assert command_at(np.array([0.5, 1.0, 1.9, 2.0, 9.0]), commands).tolist() == [10.0, 10.0, 10.0, -10.0, -10.0]


def test_a_joint_that_shares_motors_with_a_culprit_is_not_judged(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):
    """What a stop has shown with certainty explains values of its neighbour in the coupling, and of no other joint."""
    test = made()
    bench.board.set_reference_speeds([100.0] * 3)
    bench.board.position_move([0.0, 20.0, 0.0])
    bench.device.shown = {1: 0.0}
    for _ in range(40):
        bench.time.sleep(0.02)
    test.judge_stop(bench.part, 1, GuardError("joint1 turns too fast; it was stopped", 1))
    assert verdicts(said) == {"joint1": Verdict.FAILED}
    assert [bool(test.explained(bench.part, joint)) for joint in range(3)] == [False, False, True]
    with test.subresult("joint2"):
        test.end_if_explained(2)
    assert verdicts(said)["joint2"] is Verdict.INCONCLUSIVE


def test_a_joint_that_shares_motors_with_one_without_power_is_not_judged(bench: PartBench, made: Callable[..., Any]):
    """Boards leave such joints idle together; nothing more has to be known of the one that had to be stopped."""
    test = made()
    bench.guard.exclude(1, "it had to be stopped again")
    explained = [test.explained(bench.part, joint) for joint in range(3)]
    assert explained == ["", "", "it shares motors: joint1 had to be left without power"]


def hard_to_move() -> SimpleNamespace:
    """The friction of a joint that needs 12 % of duty cycle more in one place."""
    place, line = SimpleNamespace(more=12.0, position=21.0), np.zeros(3)
    return SimpleNamespace(
        friction=2.0, sticky=place, blocked=place, time=line, positions=line, duties=line, model=line
    )


@pytest.mark.parametrize(
    ("broken", "jerking", "shaking", "doubt"),
    [
        (None, None, "", False),
        (0, 0, "", False),
        (1, None, "", True),
        (2, None, "", False),
        (None, 1, "", True),
        (None, 2, "", True),
        (None, None, "joint2 is shaken by its controller", True),
    ],
)
def test_effort_is_not_judged_while_another_joint_is_broken(
    bench: PartBench,
    said: list[Event],
    made: Callable[..., Any],
    broken: int | None,
    jerking: int | None,
    shaking: str,
    doubt: bool,
):
    """What its sensors say disturbs those that share its motors, and no others; one that jerks or shakes, all."""
    test = made("JointSweep")
    test.transmission = SimpleNamespace(sharing=lambda joint: {joint, 1})
    test._sweeps, test._states = {0: None, 1: None, 2: None}, SimpleNamespace(time=np.arange(3.0))
    test._broken = {broken: "joint and motor encoder of a joint disagree"}.get
    test._interrupted = {jerking: "the motor of a joint has no current in 5 of 100 states"}.get
    test._shaking = lambda joint: shaking
    with test.subresult("joint0"):
        test._judge_friction("joint0", 0, hard_to_move())
    assert verdicts(said) == {"joint0": Verdict.INCONCLUSIVE if doubt else Verdict.FAILED}


@pytest.mark.parametrize(
    ("jumps", "swept", "shaking"),
    [
        ([1.0, 0.3, 0.1], [0], ""),  # as healthy ones do
        ([5.0, 60.0, 40.0], [0], "joint1 is shaken by its controller: its duty cycle jumps by "),
        ([5.0, 60.0, 40.0], [0, 1], "joint2 is shaken by its controller: its duty cycle jumps by "),  # 1 moves, too
        ([30.0, 60.0, 40.0], [0], ""),  # the one that moves shakes them
        ([5.0, np.nan, 0.1], [0], ""),
    ],
)
def test_a_joint_that_is_shaken_while_another_moves_disturbs_it(made: Callable[..., Any], jumps, swept, shaking):
    """Its duty cycle jumps from state to state, although it is only held; joints are swept in turn."""
    test, time = made("JointSweep"), np.arange(0.0, 4.0, 0.01)
    noise = np.random.default_rng(1).standard_normal((len(time), 3)) * jumps
    empty = np.zeros((len(time), 3))
    test._states = sys.modules[type(test).__module__]._States(time, time, *[empty] * 3, noise, *[empty] * 3)
    test._sweeps = {
        one: SimpleNamespace(moves=((0.0, 2.0), (2.0, 4.0)) if one in swept else ((4.0, 5.0),)) for one in range(3)
    }
    assert test._shaking(0).startswith(shaking)
    assert bool(test._shaking(0)) is bool(shaking)


@pytest.mark.parametrize("limp", [None, 0, 1])
def test_effort_is_not_judged_while_another_joint_hangs_limp(
    bench: PartBench, said: list[Event], made: Callable[..., Any], limp: int | None
):
    """A limp joint changes the load of those that it carries, or that carry it; it is no excuse for itself."""
    test = made("JointSweep")
    test.transmission, test._sweeps = SimpleNamespace(sharing=lambda joint: {joint}), {}
    test._shaking, test._states = (lambda joint: ""), SimpleNamespace(time=np.arange(3.0))
    if limp is not None:
        bench.guard.exclude(limp, "it does not obey its commands")
    with test.subresult("joint0"):
        test._judge_friction("joint0", 0, hard_to_move())
    assert verdicts(said) == {"joint0": Verdict.INCONCLUSIVE if limp == 1 else Verdict.FAILED}


def test_a_culprit_is_left_without_power_when_it_disturbs_another_joint(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):
    """In its own turn it is held; what shares its motors is idle with it, and its verdict names the culprit."""
    test = made()
    bench.board.set_reference_speeds([100.0] * 3)
    bench.board.position_move([0.0, 20.0, 0.0])
    bench.device.shown = {1: 0.0}
    for _ in range(40):
        bench.time.sleep(0.02)
    error = GuardError("joint1 turns too fast; it was stopped", 1)
    test.judge_stop(bench.part, 1, error)
    assert bench.part.held() == [0, 1, 2]
    test.judge_stop(bench.part, 0, error)
    assert bench.part.held() == [0]
    assert [test.judge_if_lost(bench.part, joint) for joint in range(3)] == [False, True, True]
    assert verdicts(said) == {
        "joint0": Verdict.INCONCLUSIVE,
        "joint1": Verdict.FAILED,
        "joint2": Verdict.INCONCLUSIVE,
    }
    assert "joint1: its motor moves it" in failures(said)["joint1"]


def test_an_excluded_joint_without_evidence_of_its_own_is_not_failed_again(
    bench: PartBench, said: list[Event], made: Callable[..., Any]
):
    """Its stops were judged when they happened; now it cannot be tested."""
    test = made()
    bench.guard.exclude(0, "it had to be stopped again")
    assert test.judge_if_lost(bench.part, 0)
    assert verdicts(said) == {"joint0": Verdict.INCONCLUSIVE}
