"""The ledger of a run: its records, and snapshots, are read unchanged by later processes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.interfaces import Pid
from rtf.robot_testing.ledger import FILE_NAME, MotionLedger
from rtf.robot_testing.snapshot import Snapshot

if TYPE_CHECKING:
    from pathlib import Path

_NUMBERS = st.floats(allow_nan=False)
_PAIRS = st.tuples(_NUMBERS, _NUMBERS)


@st.composite
def snapshots(draw: st.DrawFn) -> Snapshot:
    """Parts with as many joints as one likes, of which some know less than others."""
    count = draw(st.integers(1, 4))

    def each(what: st.SearchStrategy) -> list:
        return draw(st.lists(what, min_size=count, max_size=count))

    def numbers() -> np.ndarray:
        return np.array(each(_NUMBERS))

    return Snapshot(
        positions=numbers(),
        modes=tuple(each(st.sampled_from(ControlMode))),
        interactions=tuple(each(st.sampled_from(InteractionMode))) if draw(st.booleans()) else (),
        speeds=numbers() if draw(st.booleans()) else None,
        accelerations=numbers() if draw(st.booleans()) else None,
        limits=each(_PAIRS) if draw(st.booleans()) else [],
        max_currents=each(st.none() | _NUMBERS),
        pids=each(st.none() | st.builds(Pid, *[_NUMBERS] * len(Pid._fields))),
        impedances=each(st.none() | _PAIRS),
    )


@given(snapshots())
def test_a_snapshot_is_the_same_after_its_journey(snapshot: Snapshot):
    """Through JSON, to the last bit."""
    back = Snapshot.from_record(json.loads(json.dumps(snapshot.to_record())))
    for name in Snapshot.__dataclass_fields__:
        before, after = getattr(snapshot, name), getattr(back, name)
        assert type(before) is type(after), name
        assert np.array_equal(before, after) if isinstance(before, np.ndarray) else before == after, name


def test_what_was_said_last_counts(tmp_path: Path):
    """Of each robot on its own; one that nobody was asked about may not move."""
    ledger = MotionLedger(tmp_path)
    assert not ledger.may_move("icub")
    ledger.record_permission("icub", may_move=True)
    ledger.record_permission("other", may_move=False)
    assert MotionLedger(tmp_path).may_move("icub")
    assert not MotionLedger(tmp_path).may_move("other")
    ledger.record_permission("icub", may_move=False)
    assert not MotionLedger(tmp_path).may_move("icub")


def test_what_was_excluded_and_kept_is_of_one_part(tmp_path: Path):
    """And the first snapshot is the one from before any test."""
    ledger = MotionLedger(tmp_path)
    ledger.record_excluded("/icub/head", 2)
    ledger.record_excluded("/icub/head", 0)
    assert ledger.excluded("/icub/head") == {0, 2}
    assert ledger.excluded("/icub/torso") == set()
    for position in (1.0, 2.0):
        ledger.save_snapshot("/icub/head", Snapshot(np.array([position]), (ControlMode.POSITION,)))
    kept = MotionLedger(tmp_path).snapshot("/icub/head")
    assert kept is not None
    assert kept.positions.tolist() == [1.0]
    assert ledger.snapshot("/icub/torso") is None


def test_what_was_put_back_is_done_with(tmp_path: Path):
    """Then the next one keeps how the part is; as long as nobody has put it back, the first counts."""
    ledger = MotionLedger(tmp_path)
    ledger.save_snapshot("/icub/head", Snapshot(np.array([1.0]), (ControlMode.POSITION,)))
    ledger.discard_snapshot("/icub/torso")
    assert ledger.snapshot("/icub/head") is not None
    ledger.discard_snapshot("/icub/head")
    assert ledger.snapshot("/icub/head") is None
    ledger.save_snapshot("/icub/head", Snapshot(np.array([2.0]), (ControlMode.POSITION,)))
    kept = ledger.snapshot("/icub/head")
    assert kept is not None
    assert kept.positions.tolist() == [2.0]


def test_what_was_allowed_before_a_run_was_resumed_is_of_the_past(tmp_path: Path):
    """So is where robots were; what did not obey still does not."""
    ledger = MotionLedger(tmp_path)
    ledger.record_permission("icub", may_move=True)
    ledger.record_excluded("/icub/head", 2)
    ledger.save_snapshot("/icub/head", Snapshot(np.array([1.0]), (ControlMode.POSITION,)))
    ledger.record_resume()
    assert not ledger.may_move("icub")
    assert ledger.snapshot("/icub/head") is None
    assert ledger.excluded("/icub/head") == {2}
    assert ledger.excluded_joints("icub") == ["/icub/head joint 2"]
    assert ledger.excluded_joints("icu") == []


def test_a_run_that_moved_nothing_gets_no_ledger_when_it_is_resumed(tmp_path: Path):
    """Its folder stays as it is."""
    MotionLedger(tmp_path).record_resume()
    assert not list(tmp_path.iterdir())


def test_what_was_in_the_way_is_until_somebody_lets_the_robot_move(tmp_path: Path):
    """Of that robot, and of that part."""
    ledger = MotionLedger(tmp_path)
    ledger.record_permission("icub", may_move=True)
    ledger.record_obstacle("/icub/left_arm")
    assert ledger.is_blocked("/icub/left_arm")
    assert not ledger.is_blocked("/icub/head")
    ledger.record_permission("other", may_move=True)
    ledger.record_permission("icub", may_move=False)
    assert ledger.is_blocked("/icub/left_arm")
    ledger.record_permission("icub", may_move=True)
    assert not ledger.is_blocked("/icub/left_arm")


@pytest.mark.parametrize("torn", ['{"robot": "icub", "may_mo', '{"place": "/icub/head", "given_up": 1}\n{"pla'])
def test_a_line_that_was_torn_is_left_out(tmp_path: Path, torn: str):
    """Its writer was killed meanwhile; all others count."""
    (tmp_path / FILE_NAME).write_text('{"robot": "icub", "may_move": true}\n' + torn)
    assert MotionLedger(tmp_path).may_move("icub")
    MotionLedger(tmp_path).record_permission("icub", may_move=False)
    assert not MotionLedger(tmp_path).may_move("icub")


def test_without_a_run_nothing_is_kept(monkeypatch: pytest.MonkeyPatch):
    """And nobody minds."""
    monkeypatch.delenv("RTF_RUN_FOLDER", raising=False)
    ledger = MotionLedger()
    ledger.record_permission("icub", may_move=True)
    assert not ledger.may_move("icub")
