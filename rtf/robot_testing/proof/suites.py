"""The cases as suites for the ordinary runner: a simulator for each suite, and as many suites as may run at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rtf.robot_testing.proof.cases import Case

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<!-- Made by `rtf proof`. -->
<suite name={name}>
    <fixture name={names}> yarpserver </fixture>
    <fixture name={robot} depends={names}>
        <parameter name="cameras">{cameras}</parameter>
        simulator
    </fixture>
"""


def write_suites(cases: Sequence[Case], folder: Path, lanes: int) -> tuple[list[Path], dict[str, Case]]:
    """Write the cases into so many suites; returns the files, and each case by the id of its test in the run."""
    groups: list[list[Case]] = [[] for _ in range(max(1, lanes))]
    # Cases of one test next to each other, divided evenly: the slow ones are then in all of the suites.
    for place, case in enumerate(cases):
        groups[place % len(groups)].append(case)
    files: list[Path] = []
    by_test: dict[str, Case] = {}
    for number, group in enumerate(groups):
        if not group:
            continue
        name = f"proof-{number}"
        files.append(folder / f"{name}.xml")
        files[-1].write_text(_suite(name, number, group, by_test), encoding="utf-8")
    return files, by_test


def _suite(name: str, number: int, cases: Sequence[Case], by_test: dict[str, Case]) -> str:
    cameras = "auto" if any(case.needs_cameras for case in cases) else "no"
    parts = [
        _HEAD.format(
            name=quoteattr(name),
            names=quoteattr(f"names-{number}"),
            robot=quoteattr(f"robot-{number}"),
            cameras=cameras,
        )
    ]
    for place, case in enumerate(cases):
        test = f"case-{place}"
        by_test[f"{name}/{test}"] = case
        parts.append(_test(test, case))
    return "".join([*parts, "</suite>\n"])


def _test(name: str, case: Case) -> str:
    rows = [f'        <parameter name="inject">{escape(case.injection)}</parameter>\n'] if case.injection else []
    rows += [
        f"        <parameter name={quoteattr(key)}>{escape(_text(value))}</parameter>\n"
        for key, value in case.parameters.items()
    ]
    limit, description = quoteattr(f"{case.timeout:g}"), quoteattr(case.name)
    head = f"    <test name={quoteattr(name)} timeout={limit} description={description}>\n"
    return f"{head}{''.join(rows)}        {escape(case.test)}\n    </test>\n"


def _text(value: object) -> str:
    if isinstance(value, list):
        return f"({' '.join(_text(one) for one in value)})"
    return str(value).lower() if isinstance(value, bool) else str(value)
