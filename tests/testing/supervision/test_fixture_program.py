"""A program of a fixture: how one that has ended is told from one that is silent, and what its end means."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest

from rtf.testing import FixtureCollapsed, FixtureManager
from rtf.testing.supervision.fixture_program import FixtureProgram

if TYPE_CHECKING:
    from collections.abc import Iterator

PATIENCE = 10.0


class Owner(FixtureManager):
    """A fixture that keeps what it would tell its runner."""

    def __init__(self) -> None:
        self.causes: list[str] = []

    def collapsed(self, reason: str, **_more: object) -> None:
        self.causes.append(reason)

    def output(self, line: str, stream: str = "stdout") -> None: ...

    def warn(self, text: str) -> None: ...


@pytest.fixture
def owner() -> Owner:
    """The fixture that runs the program."""
    return Owner()


@pytest.fixture
def program(owner: Owner) -> Iterator[FixtureProgram]:
    """A program that runs until it is killed."""
    program = FixtureProgram(owner, ["sleep", "1000"])
    program.start()
    yield program
    program.stop(signal.SIGKILL, PATIENCE)


def kill(program: FixtureProgram) -> None:
    """Kill it from outside."""
    assert program._process is not None
    os.kill(program._process.pid, signal.SIGKILL)


def test_one_that_runs_has_not_ended(program: FixtureProgram):
    """Which takes no time to say, unless something was lost: it may be dying."""
    assert not program.has_ended(PATIENCE)
    assert not program.has_ended(0.01, lost=ConnectionError())


def test_the_end_has_been_announced_when_it_is_known(program: FixtureProgram, owner: Owner):
    """Who knows of it may rely on that."""
    kill(program)
    assert program.has_ended(PATIENCE, lost=ConnectionError())
    assert owner.causes == ["sleep ended: killed by SIGKILL"]
    assert program.has_ended(PATIENCE)


def test_an_end_that_was_asked_for_is_no_collapse(program: FixtureProgram, owner: Owner):
    """A fixture may end its program and start another one."""
    assert program.stop(signal.SIGTERM, PATIENCE)
    assert program.end is not None
    assert owner.causes == []


def test_silence_is_not_waited_for(program: FixtureProgram):
    """Who does not answer in time has been waited for already, and may live."""
    assert not program.has_ended(1000.0, lost=TimeoutError())


def test_what_is_missing_is_said_when_its_time_is_up(program: FixtureProgram):
    """It is asked for until then, with the seconds that are left."""
    left: list[float] = []
    with pytest.raises(FixtureCollapsed, match=r"^sleep was not ready after 0\.1 s: a sign of life$"):
        program.await_ready(lambda seconds: left.append(seconds) or "a sign of life", 0.1)
    assert left == sorted(left, reverse=True)
    program.await_ready(lambda _: "", 0.1)
