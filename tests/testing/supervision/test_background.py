"""A program in the background: how one that has ended is told from one that is silent."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest

from rtf.testing.supervision.background import BackgroundProgram

if TYPE_CHECKING:
    from collections.abc import Iterator

PATIENCE = 10.0


@pytest.fixture
def ends() -> list[object]:
    """How the program has ended."""
    return []


@pytest.fixture
def program(ends: list[object]) -> Iterator[BackgroundProgram]:
    """A program that runs until it is killed."""
    program = BackgroundProgram(["sleep", "1000"], environ=os.environ, on_output=lambda *_: None, on_end=ends.append)
    program.start()
    yield program
    program.stop(signal.SIGKILL, PATIENCE)


def kill(program: BackgroundProgram) -> None:
    """Kill it from outside."""
    assert program._process is not None
    os.kill(program._process.pid, signal.SIGKILL)


def test_one_that_runs_has_not_ended(program: BackgroundProgram):
    """Which takes no time to say, unless something was lost: it may be dying."""
    assert not program.has_ended(PATIENCE)
    assert not program.has_ended(0.01, lost=ConnectionError())


def test_the_end_has_been_announced_when_it_is_known(program: BackgroundProgram, ends: list[object]):
    """Who knows of it may rely on that."""
    kill(program)
    assert program.has_ended(PATIENCE, lost=ConnectionError())
    assert len(ends) == 1
    assert program.has_ended(PATIENCE)


def test_silence_is_not_waited_for(program: BackgroundProgram):
    """Who does not answer in time has been waited for already, and may live."""
    assert not program.has_ended(1000.0, lost=TimeoutError())
