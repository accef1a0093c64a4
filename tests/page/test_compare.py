"""An earlier run in few records: what it came to in the end, and nothing else."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from harness import run_suite
from rtf.page.compare import journal_of, records
from rtf.testing.journal import FILE_NAME, JournalError

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
    """What a retry made good is not shown as a difference; numbers stand as in the journal."""
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
    """A test that was run again is told of once; a torn end is nothing."""
    lines = [
        {"event": "run_started", "run": "r"},
        {"event": "test_planned", "test": "s/a"},
        {"event": "test_started", "test": "s/a"},
        {"event": "measured", "test": "s/a", "value": 1},
        {"event": "test_ended", "test": "s/a", "verdict": "interrupted"},
        {"event": "run_started", "run": "r", "resumed": True},
        {"event": "test_started", "test": "s/a"},
        {"event": "measured", "test": "s/a", "value": 2},
        {"event": "test_ended", "test": "s/a", "verdict": "passed"},
    ]
    text = "".join(json.dumps(line) + "\n" for line in lines) + '{"event":"run_ended"'
    (tmp_path / FILE_NAME).write_text(text)
    assert [*records(tmp_path)] == [lines[0], lines[1], lines[7], lines[8]]


def test_a_run_is_named_by_its_folder_or_its_journal(tmp_path: Path):
    """As for every other command."""
    (tmp_path / FILE_NAME).touch()
    assert journal_of(tmp_path) == journal_of(tmp_path / FILE_NAME) == tmp_path / FILE_NAME


def test_what_is_no_run_is_named(tmp_path: Path):
    """A slip of the fingers is told before anything runs."""
    with pytest.raises(JournalError, match="no run in"):
        journal_of(tmp_path / "latset")
