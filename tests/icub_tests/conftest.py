"""Robot tests are run by the runner, in a suite with a name server and a simulated robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import pytest

from harness import Outcome, run_command, write_files
from stimuli import Recording, run_recorded

if TYPE_CHECKING:
    from rtf.testing.events import Measured

_HEAD = """<suite name="s">
<fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names"> {parameters} simulator </fixture>
"""
_NAMES_ONLY = '<suite name="s"><fixture name="names"> yarpserver </fixture>'


class Runs(Protocol):
    """The type of :func:`run_on_robot`."""

    def __call__(self, tests: str, *, limit: float = 240.0, robot: bool = True, **simulator: object) -> Outcome:
        """Run the tests to their end."""
        ...


@pytest.fixture(scope="module")
def run_on_robot(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    """Run tests, written as in a suite, one after the other on one simulated robot with these parameters."""

    def run(tests: str, *, limit: float = 240.0, robot: bool = True, **simulator: object) -> Outcome:
        folder = tmp_path_factory.mktemp("robot")
        rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in simulator.items())
        head = _HEAD.format(parameters=rows) if robot else _NAMES_ONLY
        write_files(folder, {"suite.xml": f"{head}{tests}</suite>"})
        return run_command(folder, "--suite", "suite.xml", limit=limit)

    return run


class Records(Protocol):
    """The type of :func:`record_on_robot`."""

    def __call__(self, tests: str, *parts: str) -> Recording:
        """Run the tests to their end, and return the commands that reached the boards."""
        ...


@pytest.fixture(scope="module")
def record_on_robot(tmp_path_factory: pytest.TempPathFactory) -> Records:
    """Run tests, written as in a suite, on a simulated robot with some parts, and record all commands to its boards."""
    return lambda tests, *parts: run_recorded(tmp_path_factory.mktemp("recorded"), tests, parts)


@pytest.fixture
def measured():
    """Return the measurements of a test: ``measured(outcome, test, name, subject)``."""

    def find(outcome: Outcome, test: str, name: str, subject: str = "") -> list[Measured]:
        from rtf.testing.events import Measured

        return [
            event
            for event in outcome.of(Measured, name=name)
            if event.test.rpartition("/")[2] == test and (not subject or subject in event.subject)
        ]

    return find
