"""The cases as suites for the runner, which can run several suites at a time: each has a robot of its own.

Earlier cases change a robot: the positions of its joints, and the state of its random numbers. So the assignment of
cases to robots does not depend on the number of parallel suites, and measurements are the same on every machine.

The runner distinguishes two fixtures by their ``param`` only. So each name server has a name of its own, and each
simulator a clock of its own; the robots have the same port names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from rtf.robot_testing.proof.cases import on_units
from rtf.robot_testing.proof.claims import ClaimsError
from rtf.testing.plugins import shipped_folder
from rtf.testing.suite.xml import load_suite

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from rtf.robot_testing.proof.cases import Case

#: The number of cases that share a robot. A robot starts and ends in two seconds, and a case takes about five.
_CASES = 6
_FILES = "proof-*.xml"
_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<!-- Made by `rtf proof`. -->
<suite name="proof-{number}">{environment}
    <fixture name="names-{number}" param="--namespace /proof-{number}"> yarpserver </fixture>
    <fixture name="robot-{number}" depends="names-{number}"{robot}
    </fixture>
"""
_SIMULATOR = """ param="--clock /proof-{number}/clock">
        <parameter name="cameras">{cameras}</parameter>{simulator}
        simulator"""


def write_suites(cases: Sequence[Case], folder: Path) -> tuple[list[Path], dict[str, Case]]:
    """Write the cases into suites, and replace those of an earlier proof in the folder.

    Return the files, and the cases by the ids of their tests in the run.
    """
    for file in folder.glob(_FILES):
        file.unlink()
    files: list[Path] = []
    by_test: dict[str, Case] = {}
    of_robots: dict[tuple[str, str, str], list[Case]] = {}
    for case in cases:
        of_robots.setdefault((case.robot, str(case.simulator), case.configuration), []).append(case)
    shares = [group[first : first + _CASES] for group in of_robots.values() for first in range(0, len(group), _CASES)]
    for number, share in enumerate(shares):
        files.append(folder / f"proof-{number}.xml")
        files[-1].write_text(_suite(number, share, by_test), encoding="utf-8")
    return files, by_test


def read_suites(folder: Path, cases: Iterable[Case]) -> dict[str, Case]:
    """Return the cases of written suites, by the ids of their tests.

    Raises ClaimsError if a case has no claim any more.
    """
    by_name = {case.name: case for case in cases}
    by_test: dict[str, Case] = {}
    for file in sorted(folder.glob(_FILES)):
        suite = load_suite(file).suite
        if suite is None:
            continue
        unit = [int(value) for one in suite.fixtures for name, value in one.parameters if name == "unit"]
        for test in suite.tests:
            if test.description not in by_name:
                raise ClaimsError(f"{file}: no claim has the case {test.description!r}; start a new proof")
            (by_test[test.id],) = on_units([by_name[test.description]], unit)
    return by_test


def _suite(number: int, cases: Sequence[Case], by_test: dict[str, Case]) -> str:
    cameras = "auto" if any(case.needs_cameras for case in cases) else "no"
    robot = cases[0].robot
    environment = f"\n    <environment>--robotmodel {escape(robot)}</environment>" if robot else ""
    simulator = "".join(
        f"\n        <parameter name={quoteattr(key)}>{escape(_text(value))}</parameter>"
        for key, value in cases[0].simulator.items()
    )
    if cases[0].configuration:
        fixture = f">\n{configured_robot(cases[0].configuration, f'/proof-{number}/clock')}"
    else:
        fixture = _SIMULATOR.format(number=number, cameras=cameras, simulator=simulator)
    parts = [_HEAD.format(number=number, environment=environment, robot=fixture)]
    for place, case in enumerate(cases):
        test = f"case-{place}"
        by_test[f"proof-{number}/{test}"] = case
        parts.append(_test(test, case))
    return "".join([*parts, "</suite>\n"])


def configured_robot(name: str, clock: str, *words: str) -> str:
    """Return what is in a fixture that starts a robot of ``suites/robots`` by its configuration, in lockstep.

    ``icubSim/redBall`` is another file of the robot ``icubSim``. ``clock`` is the port of its clock, ``words`` are
    further arguments. Raises ClaimsError for an unknown robot.
    """
    folder, _, file = name.rpartition("/")
    path = shipped_folder("suites") / "robots" / (folder or file) / f"{file}.xml"
    if not path.is_file():
        raise ClaimsError(f"configuration: there is no robot {name!r}: {path} does not exist")
    arguments = " ".join(("--lockstep", "yes", "--clock", clock, *words))
    return (
        f'        <parameter name="config">{escape(str(path))}</parameter>\n'
        f'        <parameter name="arguments">({escape(arguments)})</parameter>\n'
        "        robotinterface"
    )


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
