"""``rtf demo``: show what the framework does, and say whether all of it ended as it was meant to.

First the demonstration suite, which crashes, hangs and fails on purpose, so that its own exit code is that of a run
with failures; what is judged is whether the framework saw exactly what happened. Then two programs that talk, a
simulated robot that moves, and the battery: all tests of a lab on the simulated iCub, with the live page.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rtf.cli.parser import Parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.testing.results import RunResult

#: The suites of the battery: the longest first, so that the others run beside it.
BATTERY = ("control", "encoders", "motors", "basics", "stress", "sensors", "streams")


class _Shown(NamedTuple):
    """What a run of the demonstration came to: its exit code, its tests, what is not as expected, and its page."""

    code: ExitCode
    tests: int
    wrong: list[str]
    page: Path


def demo(words: Sequence[str]) -> ExitCode:
    """Run the demonstration in a folder of its own, and compare."""
    parser = Parser(prog="rtf demo", description="Run the demonstration and check every verdict.")
    parser.add_argument("--runs", metavar="DIR", default="rtf-runs", help="where the folders of the runs are made")
    parser.add_argument("--quick", action="store_true", help="leave out the battery, which takes some minutes")
    options, rest = parser.parse_known_args(words)
    runs = Path(options.runs)
    first = _what_goes_wrong(runs, rest)
    if first.code not in (ExitCode.PASSED, ExitCode.FAILURES):
        return first.code
    shown = [first]
    wrong = first.wrong + _show("two programs that talk", _talk)
    if _can_simulate():
        wrong += _show("a robot that moves", lambda: _move(runs))
        if not options.quick:
            shown.append(_battery(runs / "battery"))
            wrong += shown[-1].wrong
    return _verdict(shown, wrong)


def _verdict(shown: Sequence[_Shown], wrong: Sequence[str]) -> ExitCode:
    print()
    for line in wrong:
        print(f"not as expected: {line}")
    total = sum(one.tests for one in shown)
    if wrong:
        print(f"DEMO FAILED  {len(wrong)} of {total} expectations were not met")
        return ExitCode.FAILURES
    for one in shown:
        print(f"A page to look at in a browser: {one.page.resolve()}")
    print(f"DEMO PASSED  all {total} tests ended as expected: crash, hang, lost fixture and the rest")
    return ExitCode.PASSED


def _show(what: str, show: Callable[[], list[str]]) -> list[str]:
    """Print what something says; what is wrong with it, if anything is."""
    from rtf.errors import RtfError

    print()
    try:
        print("\n".join(show()))
    except (RtfError, OSError) as error:
        return [f"{what}: {error}"]
    return []


def _talk() -> list[str]:
    from rtf.cli.demo_network import talk

    return talk()


def _move(runs: Path) -> list[str]:
    from rtf.cli.demo_robot import move

    return move(runs)


def _what_goes_wrong(runs: Path, rest: Sequence[str]) -> _Shown:
    """The suite in which everything goes wrong that can."""
    from rtf.cli import testrunner
    from rtf.testing.plugins import shipped_folder

    folder = shipped_folder("suites") / "demo"
    latest = runs / "latest"
    page = ["--web-reporter", "--web-port", "0", "--history", str(runs / "demo-history.sqlite")]
    before = latest.resolve()
    if (before / "journal.jsonl").exists():
        page += ["--compare", str(before)]
    reports = ["--junit", str(runs / "demo-junit.xml"), "--json", str(runs / "demo.json")]
    run = ["--suite", str(folder / "demo.xml"), "--runs", str(runs), "--answer", "default"]
    code = ExitCode(testrunner.main([*run, *page, *reports, *rest]))
    if code not in (ExitCode.PASSED, ExitCode.FAILURES):
        return _Shown(code, 0, [], latest)
    results = _results(latest)
    expected = tomllib.loads((folder / "expected.toml").read_text(encoding="utf-8"))
    return _Shown(code, len(results.tests), compare(results, expected), (latest / "report.html").resolve())


def _can_simulate() -> bool:
    """Whether what simulates a robot is installed; says what fixes it."""
    from rtf.simulator import engine
    from rtf.simulator.errors import MissingPackageError

    try:
        engine.mujoco()
        engine.robot_description()
    except MissingPackageError as error:
        print(f"\nWithout a robot: {error}")
        return False
    return True


def _battery(runs: Path) -> _Shown:
    """All tests of a lab, on simulated robots."""
    from rtf.cli import testrunner
    from rtf.testing.plugins import shipped_folder

    print("\nThe battery: all tests of a lab, on the simulated robot; it takes some minutes")
    folder = shipped_folder("suites") / "icubSim"
    suites = [word for suite in (*BATTERY, *_cameras()) for word in ("--suite", str(folder / f"{suite}.xml"))]
    page = ["--web-reporter", "--web-port", "0", "--history", str(runs / "battery-history.sqlite")]
    runs.mkdir(parents=True, exist_ok=True)
    words = ["--runs", str(runs), "--answer", "default", "--junit", str(runs / "battery-junit.xml")]
    words += ["--jobs", str(len(os.sched_getaffinity(0)))]
    code = ExitCode(testrunner.main([*suites, *words, *page]))
    results = _results(runs / "latest")
    tests = results.tests.values()
    wrong = [f"battery: {test.id}: {test.verdict}" for test in tests if test.verdict is None or not test.verdict.good]
    if code != ExitCode.PASSED and not wrong:
        wrong.append(f"battery: it ended with exit code {code}")
    return _Shown(code, len(results.tests), wrong, (runs / "latest" / "report.html").resolve())


def _cameras() -> tuple[str, ...]:
    """The suite of the cameras, where the machine can make pictures."""
    from rtf.simulator.errors import RenderingError
    from rtf.simulator.rendering import rendering_back_end

    try:
        rendering_back_end()
    except RenderingError as error:
        print(f"Without the tests of the cameras: {error}")
        return ()
    return ("cameras",)


def _results(run: Path) -> RunResult:
    from rtf.testing import replay
    from rtf.testing.results import RunResult

    results = RunResult()
    for event in replay.as_one_run(run):
        results.apply(event)
    return results


def compare(results: RunResult, expected: dict[str, dict[str, object]]) -> list[str]:
    """What is not as expected, a line each."""
    wrong = []
    for name, verdict in expected["verdicts"].items():
        test = results.tests.get(f"demo/{name}")
        if test is None or test.last is None:
            wrong.append(f"{name}: is not in the results")
            continue
        if test.verdict != verdict:
            wrong.append(f"{name}: {test.verdict}, expected {verdict}: {test.last.detail}")
        reason = expected["reasons"].get(name)
        if reason is not None and test.last.reason != reason:
            wrong.append(f"{name}: reason {test.last.reason!r}, expected {reason!r}")
    unknown = [test.id for test in results.tests.values() if test.id.partition("/")[2] not in expected["verdicts"]]
    wrong.extend(f"{name}: nobody expected this test" for name in unknown)
    incidents = sum(len(suite.incidents) for suite in results.suites.values())
    if incidents != expected["fixture"]["incidents"]:
        wrong.append(f"{incidents} fixture incidents, expected {expected['fixture']['incidents']}")
    return wrong
