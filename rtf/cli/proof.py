"""``rtf proof``: run every test on every fault that it claims to find, and write down the results."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import argument, count, make_parser
from rtf.errors import did_you_mean
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rtf.robot_testing.proof import Case, JudgedCase

_EXAMPLES = """\
rtf proof                          everything, on all cores; hours of robot time in minutes
rtf proof --fast                   the healthy robot, and the faults that are found soonest: some minutes
rtf proof --test JointLimits       one test
rtf proof --others                 also without a claim: every test on every fault, some hours
rtf proof --others --fast          the same with few joints and repetitions
rtf proof --limits                 also smaller faults than claimed: from which size on each is found
rtf proof --units 1-20             on robots that differ as real ones do, each claim on the next of them
rtf proof --resume                 go on with a proof that was interrupted
rtf proof --campaign proof.sqlite  judge the runs of suites/campaigns/proof.toml, which a cluster may have made
rtf proof --output docs/proof.md   write the matrix there"""


def proof(words: Sequence[str]) -> ExitCode:
    """Run the command; returns 0 when every claim holds, 1 otherwise."""
    options = _parse(words)
    if options.campaign:
        return _judge_campaign(options)
    from rtf.robot_testing.proof import write_matrix

    cases = _cases(options)
    wrong = _unknown(options.test) or ("" if cases else _nothing(options))
    if wrong:
        print(f"rtf proof: {wrong}", file=sys.stderr)
        return ExitCode.USAGE
    if options.list:
        print("\n".join(f"{case.expectation.value:9}  {case.name}{case.on_unit}" for case in cases))
        print(f"{len(cases)} cases")
        return ExitCode.PASSED
    folder = Path(options.folder).absolute()
    if options.resume and (folder / "run").exists():
        code, by_test = _resume(folder)
    else:
        code, by_test = _run(cases, folder, options.jobs)
    if code in (ExitCode.INTERRUPTED, ExitCode.USAGE, ExitCode.INTERNAL):
        print("PROOF INTERRUPTED  go on with it by: rtf proof --resume")
        return code
    judged = _judged_cases(folder / "run", by_test)
    text = write_matrix(judged)
    target = Path(options.output) if options.output else folder / "proof.md"
    target.write_text(text, encoding="utf-8")
    return _print_judgement(judged, target)


def _parse(words: Sequence[str]) -> argparse.Namespace:
    parser = make_parser(
        "proof",
        "Run every robot test on every fault of the simulated robot that it claims to find, on faults that it must\n"
        "not mind, and on the healthy robot.",
        _EXAMPLES,
    )
    parser.add_argument("--test", metavar="NAME", action="append", default=[], help="only the claims of this test")
    parser.add_argument("--fault", metavar="KIND", action="append", default=[], help="only cases with this fault")
    parser.add_argument("--fast", action="store_true", help="only the fast subset")
    parser.add_argument(
        "--others", action="store_true", help="also every test on every fault that it claims nothing of"
    )
    parser.add_argument(
        "--limits", action="store_true", help="also smaller faults than a test claims to find, down to a quarter"
    )
    parser.add_argument(
        "--units",
        metavar="A-B",
        type=range_of_units,
        default=(),
        help="each claim on the next one of these robots of the population, in turn (default: the nominal one)",
    )
    parser.add_argument("--list", action="store_true", help="list the cases and run nothing")
    parser.add_argument("-j", "--jobs", metavar="N", type=count, default=os.cpu_count() or 1, help="robots at a time")
    parser.add_argument("--folder", metavar="DIR", default="rtf-runs/proof", help="where suites and results are kept")
    parser.add_argument(
        "--output", metavar="FILE", help="where the matrix is written (default: proof.md in the folder)"
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with the proof in the folder, with the cases that it was begun with",
    )
    parser.add_argument("--campaign", metavar="FILE", type=Path, help="run nothing: judge the results of a campaign")
    return parser.parse_args(words)


def _judge_campaign(options: argparse.Namespace) -> ExitCode:
    from rtf.campaigns.claims import judged
    from rtf.campaigns.store import CampaignStore
    from rtf.robot_testing.proof import write_matrix

    with CampaignStore(options.campaign) as store:
        cases = [*judged(store)]
    target = Path(options.output) if options.output else options.campaign.with_suffix(".md")
    target.write_text(write_matrix(cases), encoding="utf-8")
    return _print_judgement(cases, target)


def _cases(options: argparse.Namespace) -> list[Case]:
    from rtf.robot_testing.proof import on_units, shipped_cases

    cases = shipped_cases(options.test, fast=options.fast, others=options.others, limits=options.limits)
    cases = [case for case in cases if not options.fault or case.fault in options.fault]
    return on_units(cases, options.units)


@argument
def range_of_units(text: str) -> range:
    """Return the units that a text such as ``1-20`` or ``7`` means. Raises ValueError."""
    first, _, last = text.partition("-") if "-" in text else (text, "", text)
    if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last)):
        raise ValueError(f"{text!r} is no range of units, such as 1-20, and no unit, such as 7")
    return range(int(first), int(last) + 1)


def _unknown(tests: Sequence[str]) -> str:
    """Return which of these tests claims nothing; empty when all of them claim something."""
    from rtf.robot_testing.proof import shipped_cases

    known = sorted({case.test for case in shipped_cases()}) if tests else []
    for test in tests:
        if test not in known:
            return f"there is no claim of a test {test!r}{did_you_mean(test, known)}"
    return ""


def _nothing(options: argparse.Namespace) -> str:
    """Return the reason why no case is left."""
    of = f" of {' or '.join(options.test)}" if options.test else ""
    faults = f" with {' or '.join(options.fault)}" if options.fault else ""
    return f"there is no case{of}{faults}{' in the fast subset' if options.fast else ''}"


def _run(cases: Sequence[Case], folder: Path, jobs: int) -> tuple[ExitCode, dict[str, Case]]:
    """Run the cases with the ordinary runner."""
    import shutil

    from rtf.cli import testrunner
    from rtf.robot_testing.proof import write_suites

    folder.mkdir(parents=True, exist_ok=True)
    files, by_test = write_suites(cases, folder)
    run = folder / "run"
    if run.exists():
        shutil.rmtree(run)
    suites = [word for file in files for word in ("--suite", str(file))]
    words = [*suites, "--run-folder", str(run), "-j", str(jobs), "--answer", "default", "-q"]
    return ExitCode(testrunner.main(words)), by_test


def _resume(folder: Path) -> tuple[ExitCode, dict[str, Case]]:
    """Continue the run in the folder, as it was begun: its suites say which cases it consists of."""
    from rtf.cli import testrunner
    from rtf.robot_testing.proof import read_suites, shipped_cases

    # The fast subset has other parameters.
    every = [*shipped_cases(others=True, limits=True), *shipped_cases(fast=True, others=True)]
    by_test = read_suites(folder, every)
    return ExitCode(testrunner.main(["--resume", str(folder / "run")])), by_test


def _judged_cases(run: Path, by_test: dict[str, Case]) -> list[JudgedCase]:
    from rtf.robot_testing.proof import judge
    from rtf.testing.journal import results_of

    results = results_of(run)
    return [judge(case, results.tests.get(test)) for test, case in by_test.items()]


def _print_judgement(judged: Sequence[JudgedCase], target: Path) -> ExitCode:
    wrong = [one for one in judged if not one.judgement.good]
    for one in wrong:
        print(f"{one.judgement.value}: {one.case.name}{one.case.on_unit}: {one.sentence}")
    print(f"The matrix is in {target}")
    if wrong:
        print(f"PROOF FAILED  {len(wrong)} of {len(judged)} claims do not hold")
        return ExitCode.FAILURES
    print(f"PROOF PASSED  all {len(judged)} claims hold")
    return ExitCode.PASSED
