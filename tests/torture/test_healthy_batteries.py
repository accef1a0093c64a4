"""Tests of the program that runs the battery again and again: its false alarms, and how it continues."""

from pathlib import Path

import pytest

from harness import write_files

from . import run_healthy_batteries

_TESTS = """
from rtf.testing import TestCase

class Healthy(TestCase):
    def run(self):
        self.measure("length", 2.0, "m")

class Wandering(TestCase):
    def run(self):
        import os
        self.measure("process", float(os.getpid()), "")

class Ill(TestCase):
    def run(self):
        self.assert_fail("it hurts")

class Slow(TestCase):
    def run(self):
        self.inconclusive("too busy")
"""


@pytest.fixture
def run(tmp_path, capsys):
    """Runs a suite of these tests ``count`` times; returns the exit code and what was printed."""

    def run(*tests: str, count: int = 2) -> tuple[int, str]:
        rows = "".join(f'<test name="{name}"> {name} </test>' for name in tests)
        write_files(tmp_path, {"healths.py": _TESTS, "suite.xml": f'<suite name="s">{rows}</suite>'})
        words = ["--folder", tmp_path / "runs", "--suite", tmp_path / "suite.xml", "--count", count]
        code = run_healthy_batteries.main([str(word) for word in words])
        return code, capsys.readouterr().out

    return run


def test_what_differs_from_run_to_run_is_listed(run):
    """A test that measures something else in each run is listed, and is no alarm."""
    code, printed = run("Healthy", "Wandering")
    assert code == 0
    assert "HEALTHY BATTERIES PASSED  2 of 2 without a false alarm (in lockstep); 0 alarms, 0 inconclusive" in printed
    assert "not the same each time: s/Wandering (2 ways)" in printed
    assert "1 of 2 tests have measured the same each time" in printed


def test_a_failure_is_an_alarm_and_doubt_is_none(run):
    """A failed test is an alarm, and an inconclusive one is only listed."""
    code, printed = run("Ill", "Slow", count=1)
    assert code == 1
    assert "ALARM s/Ill: failed" in printed
    assert "inconclusive: s/Slow" in printed
    assert "HEALTHY BATTERIES FAILED  0 of 1" in printed


def test_what_has_been_run_is_not_run_again(run, tmp_path):
    """A complete battery is not run again; an incomplete one is."""
    run("Healthy")
    whole, broken = (tmp_path / "runs" / name / "journal.jsonl" for name in ("battery00", "battery01"))
    before = whole.read_bytes()
    lines = broken.read_bytes().splitlines(keepends=True)
    broken.write_bytes(b"".join(lines[:-1]))
    code, _ = run("Healthy")
    assert code == 0
    assert whole.read_bytes() == before
    assert len(broken.read_bytes().splitlines()) == len(lines)
    assert Path(tmp_path / "runs" / "battery01.txt").exists()
