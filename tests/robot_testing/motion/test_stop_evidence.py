"""Evidence from the states of a part before a motion was stopped."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from rtf.robot.control_modes import ControlMode
from rtf.robot.errors import RefusedError
from rtf.robot_testing import GuardError
from rtf.robot_testing.judging.blame import Strength
from rtf.robot_testing.motion.stop_evidence import stop_evidence

from ..part_bench import PartBench

if TYPE_CHECKING:
    from collections.abc import Iterator

STOP = GuardError("joint1 turns too fast; it was stopped", 1, "", "runs away")


@pytest.fixture
def bench() -> Iterator[PartBench]:
    """The bench: of its three joints the last two are coupled."""
    with ExitStack() as stack:
        yield PartBench(stack)


def swing(bench: PartBench, shown: dict[int, float] | None = None) -> None:
    """Move the first joint while the encoders show these positions, if given."""
    bench.board.set_reference_speeds([100.0] * 3)
    bench.board.position_move([20.0, 0.0, 0.0])
    bench.device.shown = shown or {}
    for _ in range(40):
        bench.time.sleep(0.02)


def test_a_healthy_motion_leaves_the_word_of_the_guard(bench: PartBench):
    """It is uncertain, and has the causes of the guard."""
    swing(bench)
    (found,) = stop_evidence(bench.part, STOP)
    assert (found.joints, found.strength, found.text) == ({1}, Strength.UNCERTAIN, str(STOP))
    assert found.findings == ("runs away",)
    assert stop_evidence(bench.part) == []


def test_encoders_that_disagree_come_before_the_word_of_the_guard(bench: PartBench):
    """The encoder of another joint than the stopped one was frozen."""
    swing(bench, {0: 0.0})
    certain, uncertain = stop_evidence(bench.part, STOP)
    assert (certain.joints, certain.strength) == ({0}, Strength.CERTAIN)
    assert "joint0: its motor moves it by 20.0 deg by its encoder, and the joint's encoder shows 0.0" in certain.text
    assert uncertain.joints == {1}


@pytest.mark.parametrize("mode", [ControlMode.HARDWARE_FAULT, ControlMode.IDLE])
def test_a_joint_that_lost_its_power_is_named(bench: PartBench, mode: ControlMode):
    """By itself: it comes before the word of the guard. What a test leaves without power on purpose does not count."""
    swing(bench)
    board = bench.device._board
    with board.lock:
        board.enter(2, mode)
    for _ in range(10):
        bench.time.sleep(0.02)
    certain, uncertain = stop_evidence(bench.part, STOP)
    assert (certain.joints, certain.strength) == ({2}, Strength.CERTAIN)
    assert certain.text == f"joint2 left pos for {mode.word} by itself"
    assert "an emergency button" in certain.sentence
    assert uncertain.joints == {1}
    for _ in range(300):
        bench.time.sleep(0.02)
    assert [one.joints for one in stop_evidence(bench.part, STOP)] == [{1}], "nobody asked for it for a long time"
    (late,) = stop_evidence(bench.part, late=[2])
    assert late.text == f"joint2 is in {mode.word}, without power"
    bench.part.let_go.add(2)
    assert stop_evidence(bench.part, late=[2]) == []


def test_states_after_a_stop_are_no_evidence(bench: PartBench):
    """What happens to a joint that was released says nothing of before."""
    swing(bench)
    error = GuardError(str(STOP), 1, time=bench.time.now())
    bench.device.shown = {0: -20.0}
    bench.time.sleep(0.5)
    assert [one.joints for one in stop_evidence(bench.part, error)] == [{1}]
    assert [one.joints for one in stop_evidence(bench.part)] == [{0}]


def test_without_ratios_the_word_of_the_guard_counts(bench: PartBench, monkeypatch: pytest.MonkeyPatch):
    """A board need not report them."""

    def refuse(motor: int) -> float:
        raise RefusedError(f"motor {motor}: unknown")

    monkeypatch.setattr(bench.board, "gearbox_ratio", refuse)
    swing(bench, {0: 0.0})
    assert [one.joints for one in stop_evidence(bench.part, STOP)] == [{1}]


@pytest.mark.parametrize(
    ("finding", "moved", "duty", "named"),
    [("blocked", 2, 60.0, 2), ("blocked", 0, 60.0, 1), ("runs away", 2, 60.0, 1), ("blocked", 2, 10.0, 1)],
)
def test_a_held_joint_that_presses_is_pulled_by_the_one_that_moves(
    bench: PartBench, finding: str, moved: int, duty: float, named: int
):
    """If they share motors: one that is only held does not press by itself, but may shake, run away, or be too weak."""
    bench.device.duties = {1: duty, 2: duty}
    swing(bench)
    *_, found = stop_evidence(bench.part, GuardError("joint1 draws 5 A; it was released", 1, "", finding), moved=moved)
    assert found.joints == {named}
    assert "joint1 draws 5 A; it was released" in found.text
