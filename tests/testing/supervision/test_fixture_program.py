"""The program of a fixture: a program that ended, one that is silent, and the consequences."""

from __future__ import annotations

import os
import signal
import subprocess
from typing import TYPE_CHECKING, Any

import pytest

from rtf.testing import FixtureCollapsed, FixtureManager
from rtf.testing.supervision.fixture_program import FixtureProgram

if TYPE_CHECKING:
    from collections.abc import Iterator

PATIENCE = 10.0


class Owner(FixtureManager):
    """A fixture that keeps its reports."""

    def __init__(self) -> None:
        self.causes: list[str] = []

    def collapsed(self, reason: str, **_more: object) -> None:
        self.causes.append(reason)

    def output(self, line: str, stream: str = "stdout") -> None: ...

    def warn(self, text: str) -> None: ...


@pytest.fixture
def owner() -> Owner:
    """The fixture with the program."""
    return Owner()


@pytest.fixture
def program(owner: Owner) -> Iterator[FixtureProgram]:
    """A program that runs until it is killed."""
    program = FixtureProgram(owner, ["sleep", "1000"])
    program.start()
    yield program
    program.stop(signal.SIGKILL, PATIENCE)


def kill(program: FixtureProgram) -> None:
    """Kill the program from outside."""
    assert program._process is not None
    os.kill(program._process.pid, signal.SIGKILL)


def test_one_that_runs_has_not_ended(program: FixtureProgram):
    """A running program has not ended; after a lost connection the answer waits."""
    assert not program.has_ended(PATIENCE)
    assert not program.has_ended(0.01, lost=ConnectionError())


def test_the_end_has_been_announced_when_it_is_known(program: FixtureProgram, owner: Owner):
    """When the end is known, the collapse has been announced."""
    kill(program)
    assert program.has_ended(PATIENCE, lost=ConnectionError())
    assert owner.causes == ["sleep ended: killed by SIGKILL"]
    assert program.has_ended(PATIENCE)


def test_an_end_that_was_asked_for_is_no_collapse(program: FixtureProgram, owner: Owner):
    """A program that the fixture stops is no collapse."""
    assert program.stop(signal.SIGTERM, PATIENCE)
    assert program.end is not None
    assert owner.causes == []


def test_silence_is_not_waited_for(program: FixtureProgram):
    """After a time-out the answer does not wait for the program's end."""
    assert not program.has_ended(1000.0, lost=TimeoutError())


def test_what_is_missing_is_said_when_its_time_is_up(program: FixtureProgram):
    """A program that is not ready in time raises FixtureCollapsed with what is missing."""
    left: list[float] = []
    with pytest.raises(FixtureCollapsed, match=r"^sleep was not ready after 0\.1 s: a sign of life$"):
        program.await_ready(lambda seconds: left.append(seconds) or "a sign of life", 0.1)
    assert left == sorted(left, reverse=True)
    program.await_ready(lambda _: "", 0.1)


class Interrupted(BaseException):
    """Raised by the handler of a signal."""


def test_a_signal_during_the_start_comes_after_it(owner: Owner, monkeypatch: pytest.MonkeyPatch):
    """A program that was started then is attended, and can be stopped."""

    def interrupt(*_: object) -> None:
        raise Interrupted

    class InterruptedStart(subprocess.Popen[bytes]):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(subprocess, "Popen", InterruptedStart)
    program, before = FixtureProgram(owner, ["sleep", "1000"]), signal.signal(signal.SIGTERM, interrupt)
    try:
        with pytest.raises(Interrupted):
            program.start()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert program.stop(signal.SIGTERM, PATIENCE)
    assert str(program.end) == "killed by SIGTERM"


def test_a_program_gets_all_signals(owner: Owner):
    """None is blocked in it, also if it was while it was started."""
    heard: list[str] = []
    program = FixtureProgram(owner, ["grep", "SigBlk", "/proc/self/status"], heard=heard.append)
    program.start()
    assert program.wait(PATIENCE)
    program.stop(signal.SIGTERM, PATIENCE)
    assert heard == [f"SigBlk:\t{0:016x}"]


def test_an_error_of_what_listens_is_a_collapse(owner: Owner):
    """The end of the program is noticed all the same."""

    def stumble(text: str) -> None:
        raise KeyError(text)

    program = FixtureProgram(owner, ["sh", "-c", "echo hello; exit 3"], heard=stumble)
    program.start()
    assert program.wait(2.0)
    program.stop(signal.SIGTERM, PATIENCE)
    assert owner.causes == [
        "what listens to sh raised KeyError: 'hello'",
        "sh ended: exit status 3; its last line: hello",
    ]
