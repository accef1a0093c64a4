"""``rtf demo``: run the demonstration suite and say whether every test ended as it was meant to.

The suite crashes, hangs and fails on purpose, so its own exit code is that of a run with failures; what is judged here
is whether the framework saw exactly what happened.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.arguments import Parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.results import RunResult


def demo(words: Sequence[str]) -> ExitCode:
    """Run the demonstration in a folder of its own, and compare."""
    from rtf.cli import testrunner
    from rtf.cli.moving import move
    from rtf.cli.talking import talk
    from rtf.errors import RtfError
    from rtf.testing import replay
    from rtf.testing.plugins import shipped_folder
    from rtf.testing.results import RunResult

    parser = Parser(prog="rtf demo", description="Run the demonstration suite and check every verdict.")
    parser.add_argument("--runs", metavar="DIR", default="rtf-runs", help="where the run's folder is made")
    options, rest = parser.parse_known_args(words)
    folder = shipped_folder("suites") / "demo"
    runs = Path(options.runs)
    latest = runs / "latest"
    page = ["--web-reporter", "--web-port", "0", "--history", str(runs / "demo-history.sqlite")]
    before = latest.resolve()
    if (before / "journal.jsonl").exists():
        page += ["--compare", str(before)]
    run = ["--suite", str(folder / "demo.xml"), "--runs", str(runs), "--answer", "default"]
    code = testrunner.main([*run, *page, *_reports(runs), *rest])
    if code not in (ExitCode.PASSED, ExitCode.FAILURES):
        return ExitCode(code)
    results = RunResult()
    for event in replay.as_one_run(latest):
        results.apply(event)
    wrong = compare(results, tomllib.loads((folder / "expected.toml").read_text(encoding="utf-8")))
    print()
    try:
        print("\n".join(talk()))
    except (RtfError, OSError) as error:
        wrong.append(f"two programs that talk: {error}")
    try:
        print("\n".join(move(runs)))
    except (RtfError, OSError) as error:
        wrong.append(f"a robot that moves: {error}")
    for line in wrong:
        print(f"not as expected: {line}")
    total = len(results.tests)
    if wrong:
        print(f"DEMO FAILED  {len(wrong)} of {total} expectations were not met")
        return ExitCode.FAILURES
    print(f"The page of this run, to look at in a browser: {(latest / 'report.html').resolve()}")
    print(f"DEMO PASSED  all {total} tests ended as expected: crash, hang, lost fixture and the rest")
    return ExitCode.PASSED


def _reports(runs: Path) -> list[str]:
    return ["--junit", str(runs / "demo-junit.xml"), "--json", str(runs / "demo.json")]


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
