"""Compare the battery through CAN boards with the direct path: ``python tests/torture/run_can_battery.py``.

Each ``--part`` is run twice on the simulated iCub with the same seed, in lockstep: with boards that the servers ask
directly, and through control board, driver, bus and firmware; ``--part sensors`` has the tests of sensors and streams.
Printed is a table with both verdicts of each test, how many numbers both have judged by limits, and the number that
differs most, as a share of what its limits allow.

What boards on CAN cannot do is in ``MISSING``, with the reason. Another difference of verdicts ends the program with 1.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree as ET

from rtf.testing import journal
from rtf.testing.events import Measured
from rtf.testing.results import RunResult
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

_SUITES = Path(__file__).parents[2] / "suites" / "icub"
PARTS = ("head", "torso", "left_arm", "right_arm", "left_leg", "right_leg")
SENSORS = "sensors"
#: The suites of the battery with the tests of parts, and with those of sensors and streams.
_OF_PARTS, _OF_SENSORS = ("basics", "encoders", "motors", "control", "stress"), ("streams", "sensors")
#: What boards on CAN cannot do: the parameters of a test that leave it out on both paths, and why.
MISSING = {("ControlModes", "without", "(icur)"): "boards that control joints have no command for a current"}
#: Complaints that are shown of a test whose verdicts differ.
_SHOWN = 3

_SUITE = """<suite name="{name}">
    <fixture name="names" param="--namespace /{name}"> yarpserver </fixture>
    <fixture name="robot" depends="names" param="--clock /{name}/clock {words}"> simulator </fixture>
    {included}
</suite>
"""


@dataclass(slots=True)
class Outcome:
    """What a test came to: its verdict, its complaints, and its measurements by subject and name, in their order."""

    verdict: str = Verdict.NOT_RUN.value
    said: list[str] = field(default_factory=list)
    measured: dict[tuple[str, str], list[Measured]] = field(default_factory=lambda: defaultdict(list))


class Difference(NamedTuple):
    """A number of both paths, and how much of what its limits allow lies between them."""

    share: float
    what: str
    direct: float
    can: float


class Row(NamedTuple):
    """A test on both paths."""

    test: str
    direct: str
    can: str
    numbers: int
    most: Difference | None
    said: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether both paths have the same verdict."""
        return self.direct == self.can


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the parts. Returns 0 when all verdicts are the same, 1 otherwise."""
    parser = argparse.ArgumentParser(description="Compare the battery through CAN boards with the direct path.")
    parser.add_argument("--part", action="append", choices=(*PARTS, SENSORS), help="repeatable; default: all of them")
    parser.add_argument("--tests", default="", help="only tests whose name matches, such as 'sine or step'")
    parser.add_argument("--folder", type=Path, help="where the runs are kept (default: nowhere)")
    options = parser.parse_args(arguments)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for part in options.part or (*PARTS, SENSORS):
            found = compare(part, options.folder or Path(folder), options.tests)
            print("\n".join(table(found)), flush=True)
            rows += found
    different = [row for row in rows if not row.same]
    reasons = "; ".join(f"{' '.join(left_out)}: {why}" for left_out, why in MISSING.items())
    verdict = "FAILED" if different or not rows else "PASSED"
    print(
        f"CAN BATTERY {verdict}  {len(rows) - len(different)} of {len(rows)} verdicts are the same; left out: {reasons}"
    )
    return int(verdict == "FAILED")


def compare(part: str, folder: Path, tests: str = "") -> list[Row]:
    """Run a part, or the tests of sensors, on both paths; return their tests."""
    paths = [run(part, folder / f"{part}-{path}", words, tests) for path, words in _PATHS.items()]
    direct, can = paths
    return [_row(test, direct.get(test, Outcome()), can.get(test, Outcome())) for test in {**direct, **can}]


_PATHS = {"direct": "", "can": "--can true"}


def run(part: str, folder: Path, words: str, tests: str) -> dict[str, Outcome]:
    """Run the tests of a part in a new folder; return their outcomes by name.

    Raises SystemExit for a run that has not begun.
    """
    folder.mkdir(parents=True)
    whole = part == SENSORS
    suite = folder / "suite.xml"
    names = _OF_SENSORS if whole else _OF_PARTS
    for name in names:
        (folder / f"{name}.xml").write_bytes(of_part(_SUITES / f"{name}.xml", "" if whole else part))
    included = "".join(f"<include> {name}.xml </include>" for name in names)
    served = "" if whole else f"--parts {part}"
    suite.write_text(_SUITE.format(name=folder.name.replace("-", "_"), words=f"{served} {words}", included=included))
    command = [sys.executable, "-m", "rtf.cli.testrunner", str(suite), "--run-folder", str(folder / "run")]
    ended = subprocess.run([*command, *(["-k", tests] if tests else [])], capture_output=True, text=True, check=False)
    if not (folder / "run" / journal.FILE_NAME).exists():
        raise SystemExit(f"{part} was not run: {ended.stdout}{ended.stderr}")
    return outcomes(folder / "run")


def of_part(suite: Path, part: str) -> bytes:
    """Return a suite with the tests of one part only, if one is given, and without what boards on CAN cannot do."""
    tree = ET.parse(suite)
    root = tree.getroot()
    for element in list(root):
        if part and not (element.tag == "for" and part in element.get("in", "").split()):
            root.remove(element)
        elif part:
            element.set("in", part)
    for test in root.iter("test"):
        plugin = "".join(test.itertext()).split()[-1]
        for name, parameter, value in MISSING:
            if plugin == name:
                child = ET.Element("parameter", name=parameter)
                child.text = value
                test.insert(0, child)
    return bytes(ET.tostring(root))


def outcomes(folder: Path) -> dict[str, Outcome]:
    """Return the outcomes of the tests of a run, by name."""
    found: defaultdict[str, Outcome] = defaultdict(Outcome)
    results = RunResult()
    for event in journal.read(folder):
        results.apply(event)
        if isinstance(event, Measured):
            found[event.test].measured[event.subject, event.name].append(event)
    for test, result in results.tests.items():
        found[test].verdict = (result.verdict or Verdict.NOT_RUN).value
        found[test].said = [f"{one.title} {one.detail}".strip() for one in result.problems]
    return {results.tests[test].label: one for test, one in found.items() if test in results.tests}


def _row(test: str, direct: Outcome, can: Outcome) -> Row:
    differences = list(_differences(direct.measured, can.measured))
    most = max(differences, default=None)
    said = () if direct.verdict == can.verdict else tuple([*direct.said, *can.said][:_SHOWN])
    return Row(test, direct.verdict, can.verdict, len(differences), most, said)


def _differences(
    direct: Mapping[tuple[str, str], list[Measured]], can: Mapping[tuple[str, str], list[Measured]]
) -> Iterator[Difference]:
    """Yield the numbers with limits that both paths have."""
    for key, measured in direct.items():
        for one, other in zip(measured, can.get(key, ()), strict=False):
            if one.low is not None or one.high is not None:
                share = abs(_within_limits(one) - _within_limits(other))
                yield Difference(share, " ".join(filter(None, key)), one.value, other.value)


def _within_limits(one: Measured) -> float:
    """Return where a number lies: 0 at its lower limit, 1 at its upper one; with one limit, as a share of this.

    Limits may depend on where a joint was, so numbers are compared by their places between them.
    """
    if one.low is not None and one.high is not None:
        return (one.value - one.low) / ((one.high - one.low) or 1.0)
    limit = one.high if one.low is None else one.low
    return one.value / abs(limit or 1.0)


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the table, with the complaints of tests whose verdicts differ."""
    for row in rows:
        verdicts = row.direct if row.same else f"{row.direct} / {row.can}"
        most = row.most
        shown = f"{most.share:7.1%}  {most.what}: {most.direct:.5g} / {most.can:.5g}" if most is not None else ""
        yield f"| {row.test:32} | {verdicts:18} | {row.numbers:5} | {shown}"
        yield from (f"    {sentence}" for sentence in row.said)


if __name__ == "__main__":
    sys.exit(main())
