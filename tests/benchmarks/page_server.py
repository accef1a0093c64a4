"""The live page: what it adds to the start of a run, and what a hundred open pages take from one."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from measuring import TESTRUNNER, TRIVIAL, Benchmark, Command, suite_of

if TYPE_CHECKING:
    from collections.abc import Iterable

CLIENTS = (sys.executable, str(Path(__file__).with_name("many_clients.py")))
PAGE = ("--web-reporter", "--web-port", "0")
#: A run with the live page leaves the archived one as well, which has a cost of its own.
ARCHIVE = ("--html", "page.html")

#: As much as tests say that say much: a measurement of each joint, a message here and there, and some time to move.
MOVING = """
import time
from rtf.testing import TestCase

class Moving(TestCase):
    def run(self):
        for number in range(EVENTS):
            self.measure("position error", number / 1000, "deg", low=-1, high=1)
            if number % 10 == 0:
                self.report(f"step {number}: the joint moves as it should")
                time.sleep(0.002)
"""


def start() -> Benchmark:
    """The benchmark of the start: one test as small as it gets."""

    def prepare(folder: Path) -> None:
        (folder / "trivial.py").write_text(TRIVIAL)

    run = (*TESTRUNNER, "--test", "trivial.py", "--quiet", "--no-output")
    commands = [
        Command("no page at all", run),
        Command("the archived page", (*run, *ARCHIVE)),
        Command("and the live one", (*run, *ARCHIVE, *PAGE), against="the archived page", limit="goal: 50 ms more"),
    ]
    return Benchmark("Start with the page", commands, prepare)


def clients(tests: int, events: int, numbers: Iterable[int] = (0, 1, 100)) -> Benchmark:
    """The benchmark of a run of so many tests with so many events each, that nobody or so many clients follow."""

    def prepare(folder: Path) -> None:
        (folder / "moving.py").write_text(MOVING.replace("EVENTS", str(events)))
        (folder / "suite.xml").write_text(suite_of(tests, "moving.py"))

    run = (*TESTRUNNER, "--suite", "suite.xml", "--quiet", "--no-output", *ARCHIVE)
    without = "without the live page"
    commands = [Command(without, (*CLIENTS, "0", *run))]
    for number in numbers:
        arguments = (*CLIENTS, str(number), *run, *PAGE)
        commands.append(
            Command(f"with it, {number} clients", arguments, against=without, limit="goal: 1.05" if number > 1 else "")
        )
    return Benchmark(f"{tests} tests of {events} events each, followed live", commands, prepare)
