"""The report of a proof: which test finds which fault, at which severity, with which message."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot_testing.proof.cases import Expectation, provable_kinds
from rtf.robot_testing.proof.judging import Judgement
from rtf.simulator.faults import KINDS, find_kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot_testing.proof.cases import Case
    from rtf.robot_testing.proof.judging import JudgedCase

_LONGEST = 160
_HEAD_OF_LIMITS = 3


def write_matrix(judged: Sequence[JudgedCase]) -> str:
    """Return the report in Markdown: a summary, a table of faults and tests, and every case with its message."""
    limits = _limits(judged)
    others = [one for one in judged if one.case.expectation is Expectation.OTHER]
    judged = [one for one in judged if one.case.expectation not in (Expectation.OTHER, Expectation.LIMIT)]
    good = sum(one.judgement.good for one in judged)
    parts = [
        "# The proof\n\n",
        "Which test finds which fault of the simulated robot. Made by `rtf proof`; each line is a run of the test in\n",
        "the ordinary runner, on a robot with that fault.\n\n",
        _units(judged),
        f"{good} of {len(judged)} claims hold; ",
        f"{len(_found(judged))} of {len(provable_kinds())} kinds of faults are found.\n\n",
        _by_fault(judged),
        limits,
        "## Cases\n\n",
        _cases(judged),
        _others(others) if others else "",
    ]
    return "".join(parts)


def _units(judged: Sequence[JudgedCase]) -> str:
    units = sorted({one.case.unit for one in judged})
    if units in ([], [0]):
        return ""
    return f"Each on one of the units {', '.join(map(str, units))} of the population.\n\n"


def _others(judged: Sequence[JudgedCase]) -> str:
    """Return the section on faults without a claim: the number of passed cases, and each other case."""
    loud = [one for one in judged if one.judgement is not Judgement.SILENT]
    return (
        "\n## Faults without a claim\n\n"
        f"Every test was also run on every fault that none of its claims covers, {len(judged)} pairs: "
        f"{len(judged) - len(loud)} passed.\n"
        f"These did not, because they found the fault, or for another reason:\n\n{_cases(loud)}"
    )


def _found(judged: Sequence[JudgedCase]) -> set[str]:
    return {one.case.fault for one in judged if one.judgement is Judgement.FOUND}


def _by_fault(judged: Sequence[JudgedCase]) -> str:
    rows = ["## Faults\n\n", "| fault | layer | found by |\n| --- | --- | --- |\n"]
    for name in provable_kinds():
        tests = sorted({f.case.test for f in judged if f.case.fault == name and f.judgement is Judgement.FOUND})
        rows.append(f"| {name} | {KINDS[name].layer.value} | {', '.join(tests) or '**nothing**'} |\n")
    return "".join([*rows, "\n"])


def _limits(judged: Sequence[JudgedCase]) -> str:
    """Return the section on the smallest faults that are found, for claims of which smaller ones were tried."""
    tried: dict[tuple[str, ...], list[JudgedCase]] = {}
    for one in judged:
        if one.case.expectation in (Expectation.FOUND, Expectation.LIMIT) and _severity_of(one) is not None:
            tried.setdefault(_without_severity(one.case), []).append(one)
    rows = [
        "## Detection limits\n\n",
        "The smallest fault that a test finds, and the greatest one that it does not.\n\n",
        "| test | fault | target | found from | not found |\n| --- | --- | --- | --- | --- |\n",
    ]
    for several in tried.values():
        if any(one.case.expectation is Expectation.LIMIT for one in several):
            ordered = sorted(several, key=lambda one: abs(_severity_of(one) or 0.0))
            found = [one for one in ordered if one.judgement is Judgement.FOUND]
            missed = [one for one in ordered if one.judgement in (Judgement.SILENT, Judgement.MISSED)]
            cells = [ordered[0].case.test, ordered[0].case.fault, ordered[0].case.target]
            cells += [_severity(found[0].case) if found else "nothing", _severity(missed[-1].case) if missed else ""]
            rows.append(f"| {' | '.join(map(_cell, cells))} |\n")
    return "".join([*rows, "\n"]) if len(rows) > _HEAD_OF_LIMITS else ""


def _severity_of(one: JudgedCase) -> float | None:
    return find_kind(one.case.fault).severity(one.case.values)


def _without_severity(case: Case) -> tuple[str, ...]:
    first = find_kind(case.fault).parameters[0].name
    rest = {name: value for name, value in case.values.items() if name != first}
    return case.test, case.fault, case.target, str(rest), str(case.parameters), str(case.delay)


def _cases(judged: Sequence[JudgedCase]) -> str:
    rows = [
        "| test | fault | target | severity | result | message of the test |\n| --- | --- | --- | --- | --- | --- |\n",
    ]
    order = list(Expectation)
    for one in sorted(judged, key=lambda f: (f.case.test, order.index(f.case.expectation), f.case.name)):
        case = one.case
        came = one.judgement.value if one.judgement.good else f"**{one.judgement.value}**"
        said = one.sentence if one.judgement is Judgement.FOUND else case.reason or one.sentence
        came += case.on_unit
        cells = [case.test, case.fault or "none", case.target, _severity(case), came, said]
        rows.append(f"| {' | '.join(_cell(cell) for cell in cells)} |\n")
    return "".join(rows)


def _severity(case: Case) -> str:
    """Return the severity of the fault: all its parameters, defaults included, and its begin and end."""
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
