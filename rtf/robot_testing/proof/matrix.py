"""The result of a proof as a page: which test finds which fault, from which severity on, and what was said."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing.proof.cases import Expectation, provable_kinds
from rtf.robot_testing.proof.judging import Judgement
from rtf.simulator.faults import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot_testing.proof.cases import Case
    from rtf.robot_testing.proof.judging import Finding

_LONGEST = 160


def write_matrix(findings: Sequence[Finding]) -> str:
    """The page in Markdown: a summary, a table of faults and tests, and every case with its sentence."""
    others = [finding for finding in findings if finding.case.expectation is Expectation.OTHER]
    findings = [finding for finding in findings if finding.case.expectation is not Expectation.OTHER]
    good = sum(finding.judgement.good for finding in findings)
    parts = [
        "# The proof\n\n",
        "Which test finds which fault of the simulated robot. Made by `rtf proof`; each line is a run of the test in\n",
        "the ordinary runner, on a robot with that fault.\n\n",
        f"{good} of {len(findings)} claims hold; ",
        f"{len(_found(findings))} of {len(provable_kinds())} kinds of faults are found.\n\n",
        _by_fault(findings),
        "## Cases\n\n",
        _cases(findings),
        _others(others) if others else "",
    ]
    return "".join(parts)


def _others(findings: Sequence[Finding]) -> str:
    """What came of faults of which a test claims nothing: how many passed, and each that did not."""
    loud = [finding for finding in findings if finding.judgement is not Judgement.SILENT]
    return (
        "\n## Faults of which a test claims nothing\n\n"
        f"Every test was also run on every fault that it says nothing of, {len(findings)} pairs: "
        f"{len(findings) - len(loud)} passed. These did not:\n\n{_cases(loud)}"
    )


def _found(findings: Sequence[Finding]) -> set[str]:
    return {finding.case.fault for finding in findings if finding.judgement is Judgement.FOUND}


def _by_fault(findings: Sequence[Finding]) -> str:
    rows = ["## Faults\n\n", "| fault | layer | found by |\n| --- | --- | --- |\n"]
    for name in provable_kinds():
        tests = sorted({f.case.test for f in findings if f.case.fault == name and f.judgement is Judgement.FOUND})
        rows.append(f"| {name} | {KINDS[name].layer.value} | {', '.join(tests) or '**nothing**'} |\n")
    return "".join([*rows, "\n"])


def _cases(findings: Sequence[Finding]) -> str:
    rows = [
        "| test | fault | where | severity | came to | the test said |\n| --- | --- | --- | --- | --- | --- |\n",
    ]
    order = list(Expectation)
    for finding in sorted(findings, key=lambda f: (f.case.test, order.index(f.case.expectation), f.case.name)):
        case = finding.case
        came = finding.judgement.value if finding.judgement.good else f"**{finding.judgement.value}**"
        said = case.reason or finding.sentence
        cells = [case.test, case.fault or "none", case.target, _severity(case), came, said]
        rows.append(f"| {' | '.join(_cell(cell) for cell in cells)} |\n")
    return "".join(rows)


def _severity(case: Case) -> str:
    """How bad the fault is, in all its numbers, also those that nobody set; and when it begins and ends."""
    kind = KINDS.get(case.fault)
    words = [
        f"{one.name} {case.values.get(one.name, one.default):g} {one.unit}".strip()
        for one in (kind.parameters if kind else ())
    ]
    words += [f"after {case.delay:g} s"] * (case.delay > 0)
    words += [f"for {case.duration:g} s"] if case.duration is not None else []
    return ", ".join(words)


def _cell(text: str) -> str:
    line = " ".join(text.split())
    short = line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…"
    return short.replace("|", "\\|")
