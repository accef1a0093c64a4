"""How a benchmark is made: whole processes, run in turn, and what each took.

Every command of a benchmark runs once unmeasured, so that all code is compiled, as in an installed program; then all of
them run in turn, several times, so that a machine that gets slower for a while does so for each of them.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable

TESTRUNNER = (sys.executable, "-m", "rtf.cli.testrunner")
PYTEST = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")

#: One test, as small as it gets, in a file of this name.
TRIVIAL = """
from rtf.testing import TestCase

class Trivial(TestCase):
    def run(self):
        self.check(True, "holds")
"""


@dataclass(frozen=True)
class Taken:
    """What one run took: seconds, CPU seconds of all its processes, memory of the largest of them in bytes."""

    wall: float
    cpu: float
    memory: int
    status: int


@dataclass
class Command:
    """One row of a benchmark. ``against`` names the row to which it is compared.

    ``may_fail`` lets a tool that is only compared with end badly; the table says so.
    """

    name: str
    arguments: tuple[str, ...]
    against: str = ""
    limit: str = ""
    may_fail: bool = False
    runs: list[Taken] = field(default_factory=list)

    @property
    def wall(self) -> float:
        """The median of its times on the clock."""
        return statistics.median(run.wall for run in self.runs)


@dataclass
class Benchmark:
    """Commands that are measured together. ``prepare`` writes the files they need into the folder they run in."""

    title: str
    commands: list[Command]
    prepare: Callable[[Path], None]

    def measure(self, folder: Path, rounds: int) -> None:
        """Prepare, run everything once for nothing, then ``rounds`` times in turn."""
        folder.mkdir(parents=True)
        self.prepare(folder)
        for command in self.commands:
            if run(command, folder).status != 0:
                command.name += " (fails)"
        for _ in range(rounds):
            for command in self.commands:
                command.runs.append(run(command, folder))

    def table(self) -> str:
        """The results, a line a command."""
        lines = [self.title, f"  {'':40}{'median':>9}{'best':>9}{'CPU':>9}{'memory':>10}   ratio"]
        walls = {command.name: command.wall for command in self.commands}
        for command in self.commands:
            best = min(taken.wall for taken in command.runs)
            cpu = statistics.median(taken.cpu for taken in command.runs)
            memory = max(taken.memory for taken in command.runs) / (1 << 20)
            ratio = f"{command.wall / walls[command.against]:.2f} x {command.against}" if command.against else ""
            limit = f"   ({command.limit})" if command.limit else ""
            lines.append(
                f"  {command.name:40}{command.wall:7.3f} s{best:7.3f} s{cpu:7.3f} s{memory:6.1f} MiB   {ratio}{limit}"
            )
        return "\n".join(lines)


def run(command: Command, folder: Path) -> Taken:
    """Run a command to its end, in silence; raises with what it said if it did not succeed."""
    arguments = command.arguments
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "RTF_"))}
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    with (folder / "said").open("wb+") as said:
        began = clock.monotonic()
        process = subprocess.Popen(
            arguments, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT
        )
        _, status, usage = os.wait4(process.pid, 0)
        took = clock.monotonic() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0 and not command.may_fail:
            said.seek(0)
            text = said.read().decode(errors="replace")[-2000:]
            raise RuntimeError(f"{' '.join(arguments)} ended with {process.returncode}: {text}")
    return Taken(took, usage.ru_utime + usage.ru_stime, usage.ru_maxrss << 10, process.returncode)


def suite_of(count: int, file: str) -> str:
    """A suite in which one file is tested ``count`` times."""
    return "".join(
        ["<suite name='bench'>", *(f"<test name='t{number}'>{file}</test>\n" for number in range(count)), "</suite>"]
    )
