"""The end of one generation, with a scripted fixture process."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.testing.events import Event, FixtureIncident
from rtf.testing.isolation.child import End
from rtf.testing.isolation.messages import DUMP_SIGNAL, SAFE_STATE_LIMIT, Command, Doing, Frames, Job, Ready, pack
from rtf.testing.plugins import PluginRef
from rtf.testing.suite.model import FixtureEntry
from rtf.testing.supervision.fixture_process import TEARDOWN_LIMIT, Fixture, FixtureProcess
from rtf.testing.verdict import FixtureState

if TYPE_CHECKING:
    from collections.abc import Callable

    import msgspec

PLUGIN = PluginRef("fixture", "fx", "fx.py", "python")
TEARDOWN, PARK, DONE = Doing("teardown()"), Doing("enter_safe_state()"), Doing("nothing")


class Scripted:
    """A child and its reactor in one, whose time passes only while it is waited for.

    ``plan`` has its messages with their seconds, ``in_dump`` those while its stacks are written, or how it ends.
    """

    def __init__(self, *plan: tuple[float, msgspec.Struct | End], in_dump: tuple[msgspec.Struct | End, ...] = ()):
        self.time = 0.0
        self.plan = [*plan]
        self.in_dump = [*in_dump]
        self.pid = 0
        self.end: End | None = None
        self.channel_closed = self.cut_off = False
        self.signals: list[int] = []

    def mark_as_host(self) -> None: ...

    def drain(self) -> None: ...

    def begin(self, job: Job, on_message: Callable[[bytes], None], on_output: Callable[[str, bytes], None]) -> None:
        self.on_message = on_message

    def send(self, message: Command) -> None: ...

    def say(self, said: msgspec.Struct) -> None:
        self.on_message(b"".join(Frames().feed(pack(said))))

    def interrupt(self, signum: int) -> None:
        self.signals.append(int(signum))

    def stop_nudging(self) -> None: ...

    def kill(self) -> None:
        self.signals.append(int(signal.SIGKILL))
        self.end = self.end or End(9)

    def dump_stacks(self) -> str:
        """Play the messages of the time in which stacks are written."""
        self.signals.append(int(DUMP_SIGNAL))
        said, self.in_dump = self.in_dump, []
        for one in said:
            self.play(one)
        return "State: S (sleeping)"

    def new_stacks(self) -> str:
        return "stacks\n"

    def run_once(self, deadline: clock.Deadline) -> None:
        assert self.time < 3600.0, "it should be over"
        if not self.plan or self.plan[0][0] > deadline.at:
            self.time = max(self.time, deadline.at)
            return
        when, said = self.plan.pop(0)
        self.time = max(self.time, when)
        self.play(said)

    def play(self, said: msgspec.Struct | End) -> None:
        if isinstance(said, End):
            self.end = said
        else:
            self.say(said)


def stop(child: Scripted, monkeypatch: pytest.MonkeyPatch, kill_now: Callable[[], bool] = lambda: False):
    """Stop a running generation; return the causes of its incidents."""
    monkeypatch.setattr(clock, "monotonic", lambda: child.time)
    events: list[Event] = []
    fixture = Fixture(FixtureEntry(name="fx", plugin="fx", found=PLUGIN), emit=events.append)

    def wait(until: Callable[[], bool], limit: clock.Deadline) -> None:
        while not until():
            child.run_once(limit.earliest(generation.deadline))

    generation = FixtureProcess(fixture, child, wait, kill_now)  # type: ignore[arg-type]
    fixture.process = generation
    fixture.state = FixtureState.STARTING
    generation.begin(Job(kind="fixture", id="fx", name="fx", plugin=PLUGIN, folder="", run_folder=""))
    child.say(Doing("setup()"))
    child.say(Ready(secures_robot=True, stop_limit=5.0))
    fixture.state = FixtureState.STOPPING
    generation.stop("")
    return [event.cause for event in events if isinstance(event, FixtureIncident)]


def test_what_comes_to_its_teardown_while_its_stacks_are_written_is_not_killed_in_it(monkeypatch: pytest.MonkeyPatch):
    """A teardown that begins while stacks of a hung safe state are written has its own limit."""
    at = SAFE_STATE_LIMIT + 2.1 + TEARDOWN_LIMIT
    child = Scripted((0.5, PARK), (at, DONE), (at, End(0)), in_dump=(TEARDOWN,))
    assert stop(child, monkeypatch) == []
    assert int(DUMP_SIGNAL) in child.signals
    assert int(signal.SIGKILL) not in child.signals


def test_a_process_that_ends_while_its_stacks_are_written_is_not_killed(monkeypatch: pytest.MonkeyPatch):
    """A process that ends while its stacks are written is reported by its own end."""
    child = Scripted((0.5, PARK), in_dump=(TEARDOWN, End(11)))
    assert stop(child, monkeypatch) == ["the fixture's process ended in teardown(): killed by SIGSEGV"]
    assert stop(Scripted((0.5, PARK), in_dump=(TEARDOWN, DONE, End(0))), monkeypatch) == []


def test_teardown_that_ends_late_is_reported_and_not_killed(monkeypatch: pytest.MonkeyPatch):
    """A teardown that ends while its stacks are written is reported as late, and not killed."""
    child = Scripted((0.5, TEARDOWN), in_dump=(DONE, End(0)))
    assert stop(child, monkeypatch) == ["teardown() did not come back within 30 s"]
    assert int(signal.SIGKILL) not in child.signals


def test_teardown_that_hangs_is_killed_however_late_it_began(monkeypatch: pytest.MonkeyPatch):
    """A teardown that hangs is killed at its limit."""
    child = Scripted((0.5, PARK), in_dump=(TEARDOWN,))
    assert stop(child, monkeypatch) == ["teardown() did not come back within 30 s; killed"]
    assert child.time < SAFE_STATE_LIMIT + TEARDOWN_LIMIT + 4.0


@pytest.mark.parametrize("said", [PARK, TEARDOWN, Doing("nothing much"), Doing("setup()")])
def test_each_of_the_last_things_begins_once(said: Doing, monkeypatch: pytest.MonkeyPatch):
    """Repeated messages do not renew the limits of safe state and teardown."""
    child = Scripted((0.5, PARK), (1.0, TEARDOWN), *((float(second), said) for second in range(2, 300)))
    assert stop(child, monkeypatch) == ["teardown() did not come back within 30 s; killed"]
    assert child.time < TEARDOWN_LIMIT + 2.0


def test_force_kills_what_comes_to_its_teardown_while_its_stacks_are_written(monkeypatch: pytest.MonkeyPatch):
    """A kill that is requested while stacks are written is executed."""
    child = Scripted((0.5, PARK), in_dump=(TEARDOWN,))
    assert len(stop(child, monkeypatch, lambda: int(DUMP_SIGNAL) in child.signals)) == 1
    assert child.signals[-1] == signal.SIGKILL
    assert child.time < SAFE_STATE_LIMIT + 4.0
