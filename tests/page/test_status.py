"""The status for scripts, with the keys and numbers of the C++ framework."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from harness import run_suite
from rtf.page.status import FAILED, NOT_RUN, PASSED, RUNNING, Status

if TYPE_CHECKING:
    from pathlib import Path


def test_the_numbers_follow_the_run(tmp_path: Path):
    """The status has 0 not run, 1 running, 2 failed, 3 passed, and the running test's or suite's name."""
    path = tmp_path / "journal"
    status = Status(path)
    assert status.read() == {"name": "", "testStatus": []}
    steps = [
        ({"event": "suite_planned", "suite": "s", "name": "Arm"}, "", []),
        ({"event": "test_planned", "suite": "s", "test": "s/a", "name": "Elbow"}, "", [NOT_RUN]),
        ({"event": "test_planned", "suite": "s", "test": "s/b", "name": "Wrist"}, "", [NOT_RUN, NOT_RUN]),
        ({"event": "suite_started", "suite": "s"}, "Arm", [NOT_RUN, NOT_RUN]),
        ({"event": "test_started", "test": "s/a"}, "Elbow", [RUNNING, NOT_RUN]),
        ({"event": "message", "severity": "info", "title": "test_ended", "test": "s/a"}, "Elbow", [RUNNING, NOT_RUN]),
        ({"event": "test_renamed", "test": "s/a", "name": "Left elbow"}, "Left elbow", [RUNNING, NOT_RUN]),
        ({"event": "test_ended", "test": "s/a", "verdict": "error", "final": False}, "Arm", [FAILED, NOT_RUN]),
        ({"event": "test_started", "test": "s/a"}, "Left elbow", [RUNNING, NOT_RUN]),
        ({"event": "test_ended", "test": "s/a", "verdict": "flaky"}, "Arm", [PASSED, NOT_RUN]),
        ({"event": "test_ended", "test": "s/b", "verdict": "not run"}, "Arm", [PASSED, NOT_RUN]),
        ({"event": "test_ended", "test": "s/b", "verdict": "fixture lost"}, "Arm", [PASSED, FAILED]),
    ]
    with path.open("a") as stream:
        for record, name, numbers in steps:
            more = {"outcome": "failed"} if record["event"] == "test_ended" else {}
            line = json.dumps(record | more)
            stream.write(line[:10])
            stream.flush()
            status.read()  # an incomplete line is ignored
            stream.write(line[10:] + "\n")
            stream.flush()
            assert status.read() == {"name": name, "testStatus": numbers}


def test_every_verdict_of_a_run_has_its_number(tmp_path: Path):
    """Every verdict of a real journal has its number."""
    bodies = {"good": "self.check(True, 'yes')", "bad": "self.check(False, 'no')", "skipped": "self.skip('nothing')"}
    head = "from rtf.testing import TestCase\nclass T(TestCase):\n    def run(self):\n        "
    xml = "<test>good.py</test><test>bad.py</test><test>skipped.py</test>"
    outcome = run_suite(tmp_path, xml, **{f"{name}__py": head + body for name, body in bodies.items()})
    status = Status(outcome.folder / "journal.jsonl")
    assert status.read() == {"name": "s", "testStatus": [PASSED, FAILED, PASSED]}
    assert status.suites() == {"s"}
