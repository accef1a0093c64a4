"""What becomes of the suites of icub-tests: which of their tests run here, which are blocked, and which cannot pass.

It reads a folder of such suites with their fixtures and parameter files, runs nothing, and writes a table::

    python tools/upstream_suites.py icub-tests/suites
    python tools/upstream_suites.py tests/data/upstream/suites docs/upstream-suites.md

The second form replaces the table of a page. A run uses programs of YARP and of the iCub that are installed, so these
change the table.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.applications.deployers import is_local
from rtf.applications.xml.reader import read_application
from rtf.bottle import Bottle, as_float, as_string, to_string
from rtf.resources import ResourceFinder
from rtf.testing.inspection import Trial, try_uses
from rtf.testing.isolation.messages import Use
from rtf.testing.plan import Planner, load_files, suite_files

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rtf.testing.suite.model import FixtureEntry, TestEntry, TestSuite

BEGIN = "<!-- the suites: written by `python tools/upstream_suites.py`, do not edit -->"
END = "<!-- the suites end -->"

#: Tests of icub-tests that cannot run as they are, and what they would need.
MISSING = {
    "DemoRedBallTest": "config-test.ini is part of icub-basic-demos; with it and a table it passes, see below",
}


class Outcome(StrEnum):
    """What becomes of a test."""

    RUNS = "runs"
    BLOCKED = "blocked"
    REFUSED = "cannot pass as shipped"


@dataclass(frozen=True, slots=True)
class Row:
    """A test of a suite, and what becomes of it; ``reason`` names the file and line where it cannot pass."""

    suite: str
    test: str
    outcome: Outcome
    reason: str = ""


class Rate(NamedTuple):
    """A rate in Hz that a test expects of a port, and where it says so."""

    low: float
    high: float
    place: str


def read_suites(folder: Path) -> list[Row]:
    """Return what becomes of all tests of the suites in a folder and its folders. Sets ``YARP_DATA_DIRS`` to it."""
    folder = folder.resolve()
    os.environ["YARP_DATA_DIRS"] = str(folder)
    files = [path for path in suite_files(folder, recursive=True) if path.parent.name != "fixtures"]
    loaded = load_files([(path, False) for path in files], {}, lenient=True)
    suites = Planner([]).plan(loaded.suites)
    entries: list[TestEntry | FixtureEntry] = []
    for suite in suites:
        entries += suite.fixtures
        entries += suite.tests
    given = {id(entry): (entry.found, Use.of(entry, ())) for entry in entries if entry.found is not None}
    trials = try_uses(given.values())
    tried = {key: trials[use] for key, use in given.items()}
    rows = [row for suite in suites for row in _rows(suite, tried, folder)]
    shorten = f"{folder}{os.sep}"
    return [Row(row.suite, row.test, row.outcome, row.reason.replace(shorten, "")) for row in rows]


def _rows(suite: TestSuite, tried: Mapping[int, Trial], folder: Path) -> Iterator[Row]:
    name = Path(suite.file).relative_to(folder).as_posix()
    reasons = [_why_blocked(fixture, tried, Path(suite.file).parent) for fixture in suite.fixtures]
    blocked = "; ".join(filter(None, reasons))
    rates: dict[str, list[Rate]] = {}
    for test in suite.tests:
        for port, rate in _rates(tried.get(id(test), Trial())):
            rates.setdefault(port, []).append(rate)
    for test in suite.tests:
        yield Row(name, test.name, *_outcome(test, tried, blocked, rates))


def _outcome(
    test: TestEntry, tried: Mapping[int, Trial], blocked: str, rates: Mapping[str, list[Rate]]
) -> tuple[Outcome, str]:
    if test.plugin in MISSING:
        return Outcome.BLOCKED, MISSING[test.plugin]
    if test.found is None:
        return Outcome.REFUSED, f"{test.location}: {_first_line(test.problem)}"
    trial = tried[id(test)]
    if trial.problems:
        return Outcome.REFUSED, f"{test.location}: {_first_line(trial.problems[0])}"
    for port, rate in _rates(trial):
        other = next((one for one in rates[port] if one.low > rate.high or one.high < rate.low), None)
        if other is not None and rates[port].index(rate) < rates[port].index(other):
            wanted = f"{other.low:g} to {other.high:g} Hz of {port}, as {other.place} says"
            return Outcome.REFUSED, f"{rate.place}: {rate.low:g} to {rate.high:g} Hz exclude the {wanted}"
    blocked = blocked or _missing_model(trial)
    return (Outcome.BLOCKED, blocked) if blocked else (Outcome.RUNS, "")


def _missing_model(trial: Trial) -> str:
    """Return that the description of the robot that a test names is not there, or an empty text."""
    row = next((row for row in trial.values if row["name"] == "model"), None)
    name = to_string(Bottle.parse(row["value"]).get(0)) if row else ""
    if row is None or not name or ResourceFinder().search(name).path is not None:
        return ""
    return f"{row['source']}: {name} is not there; it belongs to the configuration of a robot"


def _first_line(text: str) -> str:
    return text.partition("\n")[0]


def _why_blocked(fixture: FixtureEntry, tried: Mapping[int, Trial], folder: Path) -> str:
    """Return why a fixture is not usable, or an empty text."""
    if fixture.found is None:
        return _first_line(fixture.problem)
    trial = tried[id(fixture)]
    if trial.problems:
        lines = [line for problem in trial.problems for line in problem.splitlines()]
        return "; ".join(dict.fromkeys(line.partition("error: ")[2].partition(" (")[0] or line for line in lines))
    values = {row["name"]: row["value"] for row in trial.values}
    return "; ".join(_distant_nodes(folder, values["fixture"])) if fixture.plugin == "yarpmanager" else ""


def _distant_nodes(folder: Path, name: str) -> Iterator[str]:
    """Yield the nodes of an application that are not this machine."""
    for place in (folder, folder.parent):
        path = place / "fixtures" / name.strip('"')
        if path.is_file():
            for module in read_application(path).application.modules:
                if not is_local(module.node):
                    yield f"{module.location}: {module.name} needs the node {module.node}"
            return


def _rates(trial: Trial) -> Iterator[tuple[str, Rate]]:
    """Yield the ports of which a test expects rates."""
    rows = {row["name"]: row for row in trial.values}
    values = {name: Bottle.parse(row["value"]) for name, row in rows.items() if name in _OF_RATES}
    if "expected_frequency" in values:
        frequency = as_float(values["expected_frequency"].get(0))
        room = as_float(values["tolerance"].get(0)) / as_float(values["measure_time"].get(0))
        place = rows["expected_frequency"]["source"]
        yield to_string(values["portname"].get(0)), Rate(frequency - room, frequency + room, place)
    for port in values.get("PORTS", Bottle()):
        if isinstance(port, Bottle):
            frequency, tolerance = as_float(port.get(1)), as_float(port.get(2))
            yield as_string(port.get(0)), Rate(frequency - tolerance, frequency + tolerance, rows["PORTS"]["source"])


_OF_RATES = frozenset({"expected_frequency", "tolerance", "measure_time", "portname", "PORTS"})


# Writing --------------------------------------------------------------------------------------------------------------


_HEAD = ("| suite | tests | | why |", "| --- | --- | --- | --- |")
_SUMS = {Outcome.RUNS: "run", Outcome.BLOCKED: "are blocked", Outcome.REFUSED: "cannot pass as shipped"}


def as_markdown(rows: list[Row]) -> str:
    """Return the table: a row for the tests of a suite with the same outcome and reason, and the sums."""
    sums = Counter(row.outcome for row in rows)
    suites = len({row.suite for row in rows})
    total = ", ".join(f"{sums[outcome]} {text}" for outcome, text in _SUMS.items())
    lines = [f"{suites} suites, {len(rows)} tests: {total}.", "", *_HEAD]
    groups: dict[tuple[str, Outcome, str], list[str]] = {}
    for row in rows:
        groups.setdefault((row.suite, row.outcome, row.reason), []).append(row.test)
    for (suite, outcome, reason), tests in groups.items():
        named = tests[0] if len(tests) == 1 else str(len(tests))
        lines.append(f"| `{suite}` | {_cell(named)} | {outcome.value} | {_cell(reason)} |")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;")


def with_table(page: str, table: str) -> str:
    """Return a page with this table between its marks. Raises ValueError without them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page has no lines {BEGIN!r} and {END!r}")
    return f"{before}{BEGIN}\n\n{table}\n\n{END}{after}"


def main() -> None:
    """Write the table of a folder into a page, or print it."""
    table = as_markdown(read_suites(Path(sys.argv[1])))
    if len(sys.argv) == 2:  # noqa: PLR2004 - the folder alone
        sys.stdout.write(f"{table}\n")
        return
    page = Path(sys.argv[2])
    page.write_text(with_table(page.read_text(encoding="utf-8"), table), encoding="utf-8")


if __name__ == "__main__":
    main()
