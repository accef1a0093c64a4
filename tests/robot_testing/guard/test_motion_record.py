"""The record of motion of a run: its entries, and snapshots, are read unchanged by later processes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.interfaces import Pid
from rtf.robot_testing.guard.motion_record import FILE_NAME, MotionRecord
from rtf.robot_testing.guard.snapshot import Snapshot

if TYPE_CHECKING:
    from pathlib import Path

_NUMBERS = st.floats(allow_nan=False)
_PAIRS = st.tuples(_NUMBERS, _NUMBERS)


@st.composite
def snapshots(draw: st.DrawFn) -> Snapshot:
    """Snapshots of parts with any number of joints, of which some lack settings."""
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
def test_a_snapshot_is_read_as_it_was_written(snapshot: Snapshot):
    """Through JSON, to the last bit."""
    back = Snapshot.from_record(json.loads(json.dumps(snapshot.to_record())))
    for name in Snapshot.__dataclass_fields__:
        before, after = getattr(snapshot, name), getattr(back, name)
        assert type(before) is type(after), name
        assert np.array_equal(before, after) if isinstance(before, np.ndarray) else before == after, name


def test_the_last_permission_counts(tmp_path: Path):
    """For each robot on its own; without an answer a robot may not move."""
    record = MotionRecord(tmp_path)
    assert not record.may_move("icub")
    record.record_permission("icub", may_move=True)
    record.record_permission("other", may_move=False)
    assert MotionRecord(tmp_path).may_move("icub")
    assert not MotionRecord(tmp_path).may_move("other")
    record.record_permission("icub", may_move=False)
    assert not MotionRecord(tmp_path).may_move("icub")


def test_exclusions_and_snapshots_belong_to_a_part(tmp_path: Path):
    """The first snapshot counts, from before any test."""
    record = MotionRecord(tmp_path)
    record.record_excluded("/icub/head", 2)
    record.record_excluded("/icub/head", 0)
    assert record.excluded("/icub/head") == {0, 2}
    assert record.excluded("/icub/torso") == set()
    for position in (1.0, 2.0):
        record.save_snapshot("/icub/head", Snapshot(np.array([position]), (ControlMode.POSITION,)))
    kept = MotionRecord(tmp_path).snapshot("/icub/head")
    assert kept is not None
    assert kept.positions.tolist() == [1.0]
    assert record.snapshot("/icub/torso") is None


def test_a_restored_part_gets_a_new_snapshot(tmp_path: Path):
    """Until it is restored the first snapshot counts."""
    record = MotionRecord(tmp_path)
    record.save_snapshot("/icub/head", Snapshot(np.array([1.0]), (ControlMode.POSITION,)))
    record.discard_snapshot("/icub/torso")
    assert record.snapshot("/icub/head") is not None
    record.discard_snapshot("/icub/head")
    assert record.snapshot("/icub/head") is None
    record.save_snapshot("/icub/head", Snapshot(np.array([2.0]), (ControlMode.POSITION,)))
    kept = record.snapshot("/icub/head")
    assert kept is not None
    assert kept.positions.tolist() == [2.0]


def test_a_resumed_run_has_no_permissions_and_snapshots(tmp_path: Path):
    """Joints that were excluded before stay excluded."""
    record = MotionRecord(tmp_path)
    record.record_permission("icub", may_move=True)
    record.record_excluded("/icub/head", 2)
    record.save_snapshot("/icub/head", Snapshot(np.array([1.0]), (ControlMode.POSITION,)))
    record.record_resume()
    assert not record.may_move("icub")
    assert record.snapshot("/icub/head") is None
    assert record.excluded("/icub/head") == {2}
    assert record.excluded_joints("icub") == ["/icub/head joint 2"]
    assert record.excluded_joints("icu") == []


def test_a_resumed_run_without_a_record_gets_none(tmp_path: Path):
    """Its folder does not change."""
    MotionRecord(tmp_path).record_resume()
    assert not list(tmp_path.iterdir())


def test_a_part_is_blocked_until_the_next_permission(tmp_path: Path):
    """An obstacle belongs to one part of one robot."""
    record = MotionRecord(tmp_path)
    record.record_permission("icub", may_move=True)
    record.record_obstacle("/icub/left_arm")
    assert record.is_blocked("/icub/left_arm")
    assert not record.is_blocked("/icub/head")
    record.record_permission("other", may_move=True)
    record.record_permission("icub", may_move=False)
    assert record.is_blocked("/icub/left_arm")
    record.record_permission("icub", may_move=True)
    assert not record.is_blocked("/icub/left_arm")


@pytest.mark.parametrize("torn", ['{"robot": "icub", "may_mo', '{"place": "/icub/head", "excluded": 1}\n{"pla'])
def test_an_incomplete_line_is_skipped(tmp_path: Path, torn: str):
    """Its writer was killed; all other lines count."""
    (tmp_path / FILE_NAME).write_text('{"robot": "icub", "may_move": true}\n' + torn)
    assert MotionRecord(tmp_path).may_move("icub")
    MotionRecord(tmp_path).record_permission("icub", may_move=False)
    assert not MotionRecord(tmp_path).may_move("icub")


def test_without_a_run_folder_nothing_is_recorded(monkeypatch: pytest.MonkeyPatch):
    """And no method raises an error."""
    monkeypatch.delenv("RTF_RUN_FOLDER", raising=False)
    record = MotionRecord()
    record.record_permission("icub", may_move=True)
    assert not record.may_move("icub")
