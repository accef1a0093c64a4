"""What the start alone takes: the help, and a suite with one test."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from measuring import TESTRUNNER, TRIVIAL, Benchmark, Command, suite_of

if TYPE_CHECKING:
    from pathlib import Path


def benchmark() -> Benchmark:
    """The benchmark."""

    def prepare(folder: Path) -> None:
        (folder / "trivial.py").write_text(TRIVIAL)
        (folder / "suite.xml").write_text(suite_of(1, "trivial.py"))

    return Benchmark(
        "Start",
        [
            Command("python -c pass", (sys.executable, "-c", "pass")),
            Command("testrunner --help", (*TESTRUNNER, "--help"), limit="goal: 0.15 s"),
            Command("testrunner, one trivial test", (*TESTRUNNER, "--suite", "suite.xml"), limit="goal: 0.35 s"),
        ],
        prepare,
    )
