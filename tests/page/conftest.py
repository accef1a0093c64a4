"""A run that waits while tests use its page; afterwards it goes on, and must pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness import write_files
from live_page import WAITING, LiveRun
from rtf.testing.verdict import ExitCode, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

TWO = '<suite name="s"><test>waiting.py</test><test name="more">waiting.py</test></suite>'


@pytest.fixture(scope="module")
def waiting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveRun]:
    """A run whose first test has asked a question."""
    folder = tmp_path_factory.mktemp("waiting")
    write_files(folder, {"suite__xml": TWO, "waiting__py": WAITING})
    run = LiveRun(folder, "-s", "suite.xml", "--no-output")
    with run.page.follow() as stream:
        stream.until(event="asked")
        yield run
        for test in ("s/waiting", "s/more"):
            if test == "s/more":
                stream.until(event="asked", test=test)
            assert run.page.control("answer", test=test, question=f"{test}#1", answer="yes").status == 202
        stream.until_end()
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert [test.verdict for test in outcome.results.tests.values()] == [Verdict.PASSED, Verdict.PASSED]
    assert "Traceback" not in outcome.stderr
    assert not run.left_over()
