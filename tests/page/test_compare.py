"""The records of an earlier run for comparison: its final results only."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from harness import run_suite
from rtf.page.compare import journal_of, records
from rtf.testing.events import Measured, RunStarted, TestEnded, TestPlanned, TestStarted, to_line
from rtf.testing.journal import FILE_NAME, JournalError
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

TWICE = """
from rtf.testing import TestCase

class Twice(TestCase):
    def run(self):
        first = not (self.folder.parent / "seen").exists()
        (self.folder.parent / "seen").touch()
        self.report('{"event":"measured"}')
        self.measure("voltage", 1.0 if first else 24.0, "V", low=23, high=25)
        self.measure("gain", float("inf"))
"""


def test_only_the_last_attempt_is_compared(tmp_path: Path):
    """Only the last attempt is compared, with numbers as in the journal."""
    outcome = run_suite(tmp_path, '<test retries="2">twice.py</test><test name="b">twice.py</test>', twice__py=TWICE)
    found = [*records(outcome.folder)]
    assert [(record["event"], record.get("test"), record.get("value")) for record in found] == [
        ("run_started", None, None),
        ("test_planned", "s/twice", None),
        ("test_planned", "s/b", None),
        ("measured", "s/twice", 24.0),
        ("measured", "s/twice", "Infinity"),
        ("test_ended", "s/twice", None),
        ("measured", "s/b", 24.0),
        ("measured", "s/b", "Infinity"),
        ("test_ended", "s/b", None),
        ("run_ended", None, None),
    ]


def test_of_a_resumed_run_the_last_word_counts(tmp_path: Path):
    """Of a test that ran again the last result counts; an incomplete line is ignored."""
    start = RunStarted(run="r", version="1", time=1.0, seq=1)
    planned = TestPlanned(test="s/a", suite="s", name="a", fingerprint="f", time=1.0)
    lost, kept = (Measured(test="s/a", name="n", value=value, time=2.0) for value in (1.0, 2.0))
    ends = [
        TestEnded(test="s/a", verdict=verdict, outcome=verdict, time=3.0)
        for verdict in (Verdict.INTERRUPTED, Verdict.PASSED)
    ]
    begun = TestStarted(test="s/a", time=1.0)
    again = RunStarted(run="r", version="1", resumed=True, time=4.0)
    events = [start, planned, begun, lost, ends[0], again, begun, kept, ends[1]]
    (tmp_path / FILE_NAME).write_bytes(b"".join(map(to_line, events)) + b'{"event":"run_ended"')
    assert [*records(tmp_path)] == [json.loads(to_line(event)) for event in (start, planned, kept, ends[1])]


def test_run_of_an_older_version_is_compared_by_the_ids_of_now(tmp_path: Path):
    """Ids of an older version are translated."""
    events = [
        TestPlanned(test="s/nod-left", suite="s", name="Nod [left]"),
        TestStarted(test="s/nod-left"),
        Measured(test="s/nod-left", name="n", value=1.0),
        TestEnded(test="s/nod-left", verdict=Verdict.PASSED, outcome=Verdict.PASSED),
    ]
    (tmp_path / FILE_NAME).write_bytes(b"".join(map(to_line, events)))
    assert {record["test"] for record in records(tmp_path)} == {"s/Nod[left]"}


def test_a_run_is_named_by_its_folder_or_its_journal(tmp_path: Path):
    """A run is named by its folder or its journal."""
    (tmp_path / FILE_NAME).touch()
    assert journal_of(tmp_path) == journal_of(tmp_path / FILE_NAME) == tmp_path / FILE_NAME


def test_what_is_no_run_is_named(tmp_path: Path):
    """A path without a run is an error that names it."""
    with pytest.raises(JournalError, match="no run in"):
        journal_of(tmp_path / "latset")
