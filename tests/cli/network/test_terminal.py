"""Tools on a terminal, and signals while ports are opened and closed."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.cli.network.terminal import ENDING, Bell, opened
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from conftest import Net


class Terminal:
    """A tool on a terminal of its own."""

    def __init__(self, net: Net, *words: str) -> None:
        self._side, other = pty.openpty()
        self.shown = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtf", *words],
            env={**net.environment, "TERM": "xterm"},
            stdin=other,
            stdout=other,
            stderr=other,
            start_new_session=True,
        )
        os.close(other)

    def until(self, text: str, limit: float = 30.0) -> None:
        """Read until a text is shown."""
        deadline = clock.Deadline.after(limit)
        while text not in self.shown:
            assert not deadline.expired, self.shown
            self.shown += os.read(self._side, 65536).decode()

    def type(self, text: str) -> None:
        """Type a text."""
        os.write(self._side, text.encode())

    def end(self) -> int:
        """Send SIGINT, and return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(30)

    def close(self) -> None:
        """Kill the tool, and close the terminal."""
        self.process.kill()
        self.process.wait()
        os.close(self._side)


@pytest.fixture
def terminal(net: Net) -> Iterator[Callable[..., Terminal]]:
    """Return a function that starts a tool on a terminal."""
    made: list[Terminal] = []

    def start(*words: str) -> Terminal:
        made.append(Terminal(net, *words))
        return made[-1]

    yield start
    for one in made:
        one.close()


class TestTerminal:
    """Output that only a terminal gets."""

    def test_a_prompt_and_answers(self, net: Net, terminal: Callable[..., Terminal]):
        """``rtf rpc`` shows a prompt, and ends with its input."""
        server = net.opened("/oracle", "rpcserver", "/oracle")
        server.type("42")
        asking = terminal("rpc", "/oracle")
        asking.until(">> ")
        asking.type("what is it\n")
        asking.until("Response: 42")
        asking.shown = asking.shown.partition("Response: 42")[2]
        asking.until(">> ")
        asking.type("\x04")
        assert asking.process.wait(30) == 0
        assert server.end() == 0
        assert ">>" not in server.stdout

    def test_progress(self, terminal: Callable[..., Terminal]):
        """``rtf read`` prints the address of its port, and ends with Ctrl-C."""
        reading = terminal("read", "/seen")
        reading.until("Port /seen active at tcp://127.0.0.1:")
        assert reading.end() == 0

    def test_top_lives(self, terminal: Callable[..., Terminal]):
        """``rtf top`` redraws its table, and restores the screen at its end."""
        looking = terminal("top", "--interval", "50ms")
        looking.until("/root")
        looking.shown = ""
        looking.until("/root")
        looking.process.send_signal(signal.SIGINT)
        looking.until("\x1b[?1049l")
        assert looking.process.wait(30) == 0


def _killed_and_waiting(bell: Bell) -> None:
    threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGTERM)).start()
    bell.wait()


def _descriptors() -> int:
    return len([*Path("/proc/self/fd").iterdir()])


class TestEnding:
    """Signals and ports."""

    def test_a_signal_while_a_port_is_opened(self):
        """A signal takes effect after the port is open, and the port is closed."""
        network = Network(LocalNames())
        made: list[Port] = []

        def make() -> Port:
            os.kill(os.getpid(), signal.SIGTERM)
            made.append(Port("/p", network=network))
            return made[0]

        with ENDING, pytest.raises(KeyboardInterrupt), opened(make):
            pytest.fail("the signal came before")
        assert made[0].closed
        assert network.names.list() == []

    def test_a_signal_while_a_port_is_closed(self):
        """A signal does not interrupt closing."""
        network = Network(LocalNames())

        class Slow(Port):
            def close(self) -> None:
                os.kill(os.getpid(), signal.SIGTERM)
                super().close()

        with ENDING, pytest.raises(KeyboardInterrupt), opened(lambda: Slow("/p", network=network)):
            pass
        assert network.names.list() == []

    def test_a_signal_ends_a_wait(self):
        """A signal ends the wait of a bell, whichever thread gets it."""
        bell = Bell()
        with ENDING, pytest.raises(KeyboardInterrupt):
            _killed_and_waiting(bell)

    def test_each_ring_ends_one_wait(self):
        """Each ring of a bell ends one wait."""
        bell = Bell()
        with ENDING:
            bell.ring()
            bell.ring()
            bell.wait()
            bell.wait()

    def test_everything_is_put_back(self):
        """The former signal handlers are restored, and no descriptor is left."""
        before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
        descriptors = _descriptors()
        with ENDING:
            assert signal.getsignal(signal.SIGINT) not in before
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == before
        assert _descriptors() == descriptors


_TOOL = """
import os, signal, sys
from rtf import clock
from rtf.cli.network.terminal import run_to_its_end

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)
    print("interrupted", flush=True)
{moment}
def tool(words):
    begin()
    while True:
        clock.sleep(1)

sys.exit(run_to_its_end("tool", tool, []))
"""
_DESTRUCTOR = """
class Released:
    def __del__(self):
        interrupt()

def begin():
    Released()
"""
_IMPORT = """
def trace(frame, event, argument):
    if frame.f_code.co_name == "cb" and "importlib" in frame.f_code.co_filename:
        sys.settrace(None)
        interrupt()
    return trace

def begin():
    sys.settrace(trace)
    import colorsys
"""


@pytest.mark.parametrize("moment", [_DESTRUCTOR, _IMPORT], ids=["a destructor", "a callback of an import"])
def test_an_interrupt_is_not_lost_where_python_ignores_exceptions(moment: str):
    """A tool ends though its Ctrl-C comes in code whose exceptions are printed and forgotten."""
    program = _TOOL.format(moment=moment)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (2, "interrupted\n", "")
