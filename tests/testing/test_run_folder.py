"""The folders of runs: unique, named after the run, with a link to the newest."""

from __future__ import annotations

from contextlib import closing

import pytest

from rtf.testing.events import FixtureChanged, RunStarted, TestStarted
from rtf.testing.journal import FILE_NAME, LATEST, Journal, make_run_folder
from rtf.testing.verdict import FixtureState

STARTED = RunStarted(run="r", version="1")
SERVER = FixtureChanged(fixture="server", suite="s", generation=1, state=FixtureState.STARTING)
TEST = TestStarted(test="s/t")


def test_runs_of_one_second_have_folders_of_their_own(tmp_path):
    """Runs that follow each other quickly have different folders."""
    made = [make_run_folder(tmp_path / "runs", "robot", "suite") for _ in range(20)]
    assert len({*made}) == 20
    assert all(folder.is_dir() and "_robot_suite" in folder.name for folder in made)


def test_latest_moves_when_something_is_done(tmp_path):
    """``latest`` links to the newest run in which something began."""
    before, refused, elsewhere = (make_run_folder(tmp_path) for _ in range(3))
    runs = ((before, [STARTED, SERVER, TEST], True), (refused, [STARTED], True), (elsewhere, [STARTED, TEST], False))
    for folder, events, latest in runs:
        with closing(Journal(folder / FILE_NAME, latest=latest)) as journal:
            for event in events:
                journal.append(event)
    assert (tmp_path / LATEST).resolve() == before


def test_name_of_a_robot_does_not_lead_out_of_the_folder(tmp_path):
    """Special characters in a robot's name do not leave the folder."""
    folder = make_run_folder(tmp_path, "../../red/robot", "")
    assert folder.parent == tmp_path
    assert folder.name.endswith("_..-..-red-robot")


def test_folder_that_cannot_be_made_is_an_error(tmp_path):
    """A folder that cannot be made raises OSError."""
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        make_run_folder(tmp_path / "file", "suite")
