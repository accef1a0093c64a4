"""Many tests that each say much, with every reporter that writes a file: the time, and memory that stays flat."""

from __future__ import annotations

from typing import TYPE_CHECKING

from measuring import TESTRUNNER, Benchmark, Command, suite_of

if TYPE_CHECKING:
    from pathlib import Path

REPORTS = ("--output", "r.txt", "--junit", "r.xml", "--json", "r.json", "--ctrf", "r.ctrf.json")

TALKATIVE = """
from rtf.testing import TestCase

class Talkative(TestCase):
    def run(self):
        for number in range(EVENTS):
            if number % 10:
                self.report(f"step {number}: the joint moves as it should")
            else:
                self.measure("position error", number / 1000, "deg", low=-1, high=1)
"""


def benchmark(count: int, events: int) -> Benchmark:
    """The benchmark with ``count`` tests of ``events`` events each, and with a tenth of the tests, for the memory."""

    def prepare(folder: Path) -> None:
        (folder / "talkative.py").write_text(TALKATIVE.replace("EVENTS", str(events)))
        for number in (count, count // 10):
            (folder / f"{number}.xml").write_text(suite_of(number, "talkative.py"))

    def command(number: int, *, limit: str = "") -> Command:
        return Command(f"{number} tests", (*TESTRUNNER, "--suite", f"{number}.xml", "--quiet", *REPORTS), limit=limit)

    return Benchmark(
        f"Tests of {events} events each, all reporters",
        [command(count // 10), command(count, limit="goal: 60 s, the same memory")],
        prepare,
    )
