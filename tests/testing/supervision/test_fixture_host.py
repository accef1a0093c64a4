"""The host process of a fixture, with a scripted supervisor, and interrupted at bad moments."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections import deque
from typing import TYPE_CHECKING

import msgspec
import pytest

from rtf import clock
from rtf.testing import FixtureManager
from rtf.testing.isolation import messages
from rtf.testing.isolation.messages import Command, Frames

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Starter = Callable[..., "Talk"]

HOST = """
import sys
from rtf.testing.supervision import fixture_host
from rtf.testing import plugins
from rtf.testing.isolation.messages import Job
from rtf.testing.isolation.worker import Channel
fixture_host.ORPHAN_PATIENCE = 0.2
path, descriptor, attempt = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
plugin = plugins.PluginRef("fixture", "Fx", path, "python")
job = Job(
    kind="fixture", id="fx", name="fx", plugin=plugin, folder="", run_folder="", attempt=attempt, check_period=0.02
)
sys.exit(fixture_host.host(job, Channel(descriptor)))
"""

FIXTURE = """
import os, threading
from rtf import clock
from rtf.testing import FixtureManager
class Fx(FixtureManager):
    def note(self, hook):
        with open(CALLS, "a") as stream: stream.write(hook + "\\n")
    def setup(self): self.note("setup")
    def enter_safe_state(self): self.note("park")
    def on_collapse(self, reason): self.note("on_collapse " + reason)
    def teardown(self): self.note("teardown")
"""


class Talk:
    """The supervisor's end of one host."""

    def __init__(self, folder: Path, body: str, attempt: int = 1) -> None:
        self.calls = folder / "calls"
        path = folder / "fx.py"
        path.write_text(FIXTURE.replace("CALLS", repr(str(self.calls))) + body)
        here, there = socket.socketpair()
        here.settimeout(20.0)
        self.here = here
        self._frames = Frames()
        self._heard: deque[bytes] = deque()
        self.process = subprocess.Popen(
            [sys.executable, "-c", HOST, str(path), str(there.fileno()), str(attempt)], pass_fds=[there.fileno()]
        )
        there.close()

    def command(self, command: str, detail: str = "") -> None:
        """Send a command."""
        self.here.sendall(messages.pack(Command(command, detail)))

    def hear(self) -> Iterator[dict]:
        """Yield all messages until the host ends."""
        while True:
            while self._heard:
                yield msgspec.to_builtins(messages.from_fixture(self._heard.popleft()))
            data = self.here.recv(1 << 16)
            if not data:
                return
            self._heard.extend(self._frames.feed(data))

    def until(self, **members: object) -> dict:
        """Wait for a message with these members."""
        for message in self.hear():
            if members.items() <= message.items():
                return message
        raise AssertionError(f"{members} was never said")

    def interrupt(self) -> None:
        """Send SIGTERM."""
        self.process.send_signal(signal.SIGTERM)

    def end(self) -> list[str]:
        """Wait for the end, and return the calls of the fixture."""
        assert self.process.wait(20.0) == 0
        return self.calls.read_text().splitlines() if self.calls.exists() else []

    def close(self) -> None:
        """Kill the host, and close the connection."""
        self.process.kill()
        self.process.wait()
        self.here.close()


@pytest.fixture
def talk(tmp_path: Path) -> Iterator:
    """Return a function that starts a host."""
    talks = []

    def start(body: str = "", attempt: int = 1) -> Talk:
        talks.append(Talk(tmp_path, body, attempt))
        return talks[-1]

    yield start
    for one in talks:
        one.close()


class TestCommands:
    """Commands of the supervisor."""

    def test_life(self, talk: Starter):
        """The host reports ready and alive, enters the safe state on request and before teardown, and ends."""
        host = talk()
        host.until(event="ready")
        host.until(event="alive")
        host.command("enter_safe_state")
        host.until(event="alive", answered=True)
        host.command("check")
        host.until(event="alive", answered=True)
        host.command("teardown", "")
        said = [message["step"] for message in host.hear() if message["event"] == "doing"]
        assert said == ["enter_safe_state()", "teardown()", "nothing"]
        assert host.end() == ["setup", "park", "park", "teardown"]

    def test_collapse_found_by_the_runner(self, talk: Starter):
        """The supervisor's reason is passed to on_collapse."""
        host = talk()
        host.until(event="ready")
        host.command("teardown", "the runner says so")
        assert host.end() == ["setup", "on_collapse the runner says so", "teardown"]

    def test_first_announcement_counts(self, talk: Starter):
        """Of several threads that announce a collapse, the first one is reported."""
        body = """
    def check(self):
        threads = [threading.Thread(target=self.collapsed, args=(f"reason {n}",)) for n in range(20)]
        for thread in threads: thread.start()
        for thread in threads: thread.join()
        return False
"""
        host = talk(body)
        cause = host.until(event="lost")["incident"]["cause"]
        host.command("teardown", cause)
        assert [message for message in host.hear() if message["event"] == "lost"] == []
        assert host.end() == ["setup", f"on_collapse {cause}", "teardown"]

    def test_what_breaks_as_soon_as_it_is_ready_has_been_set_up(self, talk: Starter):
        """A collapse right after the setup is one of the phase check."""
        body = """
    def setup(self):
        emit = self._host.emit
        def emit_and_break(message):
            if type(message).__name__ == "Ready": self.collapsed("at once")
            emit(message)
        self._host.emit = emit_and_break
"""
        assert talk(body).until(event="lost")["incident"]["phase"] == "check"

    def test_announcement_of_anything_is_heard(self, talk: Starter):
        """Any objects are accepted as reason and output of a collapse."""
        host = talk("    def check(self): self.collapsed(ValueError(7), exit_status=3, output=b'x')\n")
        said = host.until(event="lost")["incident"]
        assert (said["cause"], said["exit_status"], said["output"]) == ("7", 3, "b'x'")

    def test_exception_that_is_broken_itself(self, talk: Starter):
        """An exception whose text raises an error is reported with its class."""
        body = """
    def setup(self):
        class Broken(Exception):
            def __str__(self): raise RuntimeError
        raise Broken
"""
        assert "Broken" in talk(body).until(event="lost")["incident"]["cause"]

    def test_keyboard_interrupt_does_not_skip_teardown(self, talk: Starter):
        """KeyboardInterrupt in setup is a collapse, and teardown runs."""
        host = talk("    def setup(self): raise KeyboardInterrupt\n")
        assert host.until(event="lost")["incident"]["cause"] == "KeyboardInterrupt"
        host.until(event="doing", step="nothing")
        assert host.end() == ["teardown"]


class TestInterruption:
    """SIGTERM at every moment."""

    @pytest.mark.parametrize("delay", [index * 0.004 for index in range(25)])
    def test_at_any_moment_ends_in_order(self, talk: Starter, delay: float):
        """After SIGTERM at any moment all messages are whole, and teardown runs."""
        body = """
    def setup(self):
        self.note("setup")
        for _ in range(2000): self.report("x" * 500)
    def check(self): self.report("y" * 500)
"""
        host = talk(body)
        host.until(event="doing", step="setup()")
        clock.sleep(delay)  # the moment is what is varied; nothing is waited for
        host.interrupt()
        assert [*host.hear()][-1] == {"event": "doing", "step": "nothing"}
        called = host.end()
        assert called in ([], ["teardown"], ["setup", "teardown"], ["setup", "park", "teardown"])

    def test_in_a_hung_check_has_the_reason(self, talk: Starter):
        """A command before the signal gives the reason of the teardown."""
        host = talk("    def check(self): clock.sleep(1000)\n")
        host.until(event="ready")
        clock.sleep(0.1)  # so that it is in check(); were it not, the outcome would be the same
        host.command("teardown", "hung")
        host.interrupt()
        assert host.end() == ["setup", "on_collapse hung", "teardown"]

    def test_does_not_touch_teardown(self, talk: Starter):
        """SIGTERM does not interrupt teardown."""
        body = """
    def teardown(self):
        self.report("begun")
        deadline = clock.Deadline.after(0.3)
        while not deadline.expired: clock.sleep(0.01)
        self.note("teardown ended")
"""
        host = talk(body)
        host.until(event="ready")
        host.command("teardown", "")
        host.until(event="message", detail="begun")
        for _ in range(5):
            host.interrupt()
        host.until(event="doing", step="nothing")
        assert host.end()[-1] == "teardown ended"


class TestLostRunner:
    """A host whose runner is gone."""

    def test_tears_down_when_the_fork_server_says_so(self, talk: Starter):
        """At the signal of the fork server the host enters the safe state, and tears down."""
        host = talk()
        host.until(event="ready")
        host.here.shutdown(socket.SHUT_RDWR)
        host.interrupt()
        assert host.end() == ["setup", "park", "teardown"]

    def test_tears_down_on_its_own_without_a_signal(self, talk: Starter):
        """Without a signal the host does so after a time."""
        host = talk()
        host.until(event="ready")
        host.here.shutdown(socket.SHUT_RDWR)
        assert host.end() == ["setup", "park", "teardown"]

    def test_does_not_keep_it_from_parking(self, talk: Starter):
        """A message that cannot be sent does not interrupt the safe state."""
        host = talk("    def enter_safe_state(self): self.report('parking'); self.note('parked')\n")
        host.until(event="ready")
        host.here.shutdown(socket.SHUT_RDWR)
        assert host.end() == ["setup", "parked", "teardown"]


def test_a_fixture_with_the_old_name_of_the_safe_state_is_refused():
    """A fixture with a method ``park``, the former name, is refused with a hint."""
    with pytest.raises(TypeError, match=r"Bench\.park\(\) is called enter_safe_state\(\) now"):
        type("Bench", (FixtureManager,), {"park": lambda self: None})
