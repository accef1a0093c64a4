"""The robots that suites name, for the head of a run: whether their thresholds are validated, and which unit they are.

A suite names a robot by ``--robotmodel`` in an environment, or by the parameter ``model`` of the fixture ``simulator``,
and a unit of the population by its parameter ``unit``. There are no entries for suites that name none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import to_string
from rtf.errors import RtfError
from rtf.resources.arguments import parse_arguments, split_arguments
from rtf.testing.events import Diagnosed
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.testing.suite.model import TestSuite

_SIMULATOR = "simulator"


def profiles_of(suites: Iterable[TestSuite]) -> tuple[dict[str, str], list[Diagnosed]]:
    """Return the origin of the thresholds of each robot, by ``profile.NAME``, and a warning if it is not validated.

    The error of a robot that cannot be read is a warning, too; the robot's tests end with the same error. Units other
    than the nominal one are in ``simulated units``, with a warning each.
    """
    suites = [*suites]
    units = dict.fromkeys(unit for suite in suites for unit in _of_simulators(suite, "unit") if unit != "0")
    facts: dict[str, str] = {"simulated units": " ".join(units)} if units else {}
    said = [
        Diagnosed(severity=Severity.WARNING, text=f"unit {unit} of the population is simulated, not the nominal robot")
        for unit in units
    ]
    for named in dict.fromkeys(name for suite in suites for name in _named_by(suite)):
        from rtf.robot.model import load_robot  # which takes long to import

        try:
            robot = load_robot(named)
        except RtfError as error:
            said.append(Diagnosed(severity=Severity.WARNING, text=str(error)))
            continue
        facts[f"profile.{robot.name}"] = robot.origins
        if robot.unvalidated:
            said.append(Diagnosed(severity=Severity.WARNING, text=robot.unvalidated))
    return facts, said


def _named_by(suite: TestSuite) -> Iterator[str]:
    for environment in (suite.environment, *(test.environment for test in suite.tests)):
        yield from _values(environment, "robotmodel")
    yield from _of_simulators(suite, "model")


def _of_simulators(suite: TestSuite, key: str) -> Iterator[str]:
    """Yield the values of a parameter of the fixtures that simulate a robot."""
    for fixture in suite.fixtures:
        if fixture.plugin == _SIMULATOR:
            yield from _values(fixture.param, key)
            yield from (value for name, value in fixture.parameters if name == key)


def _values(words: str, key: str) -> Iterator[str]:
    if f"--{key}" in words and (value := to_string(parse_arguments(split_arguments(words)).get(key, ""))):
        yield value
