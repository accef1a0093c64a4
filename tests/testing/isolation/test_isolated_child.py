"""A function that is called in an isolated child: its result, its end, and what it leaves behind."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.testing.inspection import inspect_plugin
from rtf.testing.isolation.isolated_child import run_isolated
from rtf.testing.plugins import PluginRef

if TYPE_CHECKING:
    from collections.abc import Callable

CASE = """
from rtf.testing import TestCase
class Leaver(TestCase):
    def run(self): self.check(True, "")
"""
FORKS = "import os, time\nif os.fork() == 0:\n    time.sleep(600)\n"
FORKS_AND_GOES_ON = "import os\nos.fork()\n"
DAEMON = """
import os, pathlib, signal, time
read, write = os.pipe()
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        pathlib.Path(__file__).with_name("daemon").write_text(str(os.getpid()))
        os.write(write, b"x")
        time.sleep(600)
    os._exit(0)
os.read(read, 1)
"""


def alive(pid: int) -> bool:
    """Whether there is such a process, zombies included."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def hangs() -> dict[str, object]:
    """Wait for a signal that nobody sends."""
    signal.pause()
    return {}


def test_result_comes_back_whole():
    """The object is larger than a pipe holds."""
    assert run_isolated(lambda: {"text": "x" * (1 << 20)}, 10.0) == {"text": "x" * (1 << 20)}


@pytest.mark.parametrize(
    ("function", "limit", "sentence"),
    [
        (lambda: os._exit(7), 10.0, "its process ended while it was being loaded: exit status 7"),
        (lambda: os.kill(os.getpid(), signal.SIGSEGV), 10.0, "its process ended while it was being loaded: killed by"),
        (hangs, 0.2, "it did not load within 0.2 s"),
        (lambda: sys.exit("enough"), 10.0, "SystemExit: enough"),
        (lambda: {"a": object()}, 10.0, "TypeError: Object of type object is not JSON serializable"),
        (list, 10.0, "its process ended while it was being loaded: exit status 0"),
        (lambda: os.closerange(3, 9) or {}, 10.0, "its process ended while it was being loaded: exit status 0"),
    ],
)
def test_why_there_is_no_result_is_a_sentence(function: Callable[[], dict[str, object]], limit: float, sentence: str):
    """A crash, an exit, a hang, an exception and a result that is no JSON object are findings, each in one sentence."""
    answer = run_isolated(function, limit)
    assert isinstance(answer, str)
    assert answer.startswith(sentence)


@pytest.mark.parametrize("text", [FORKS, FORKS_AND_GOES_ON, DAEMON], ids=["forks", "goes on in both", "daemon"])
def test_plugin_that_starts_processes_at_import_leaves_none(tmp_path: Path, text: str):
    """It is described as any other, and nothing that it started is alive."""
    path = tmp_path / "leaver.py"
    path.write_text(text + CASE)
    began = clock.monotonic()
    found = inspect_plugin(PluginRef("test", "leaver", str(path), "python"))
    assert (found.spec.class_name, found.problems) == ("Leaver", ())
    assert clock.monotonic() - began < 10
    if text is DAEMON:
        assert not alive(int((tmp_path / "daemon").read_text()))


def test_child_that_does_not_end_leaves_nothing(tmp_path: Path):
    """A time-out ends the child and its daemon."""
    path = tmp_path / "leaver.py"
    path.write_text(DAEMON + "signal.pause()\n" + CASE)

    def load() -> dict[str, object]:
        exec(compile(path.read_text(), str(path), "exec"), {"__file__": str(path)})
        return {}

    assert run_isolated(load, 1.0) == "it did not load within 1 s"
    assert not alive(int((tmp_path / "daemon").read_text()))


def test_process_that_asks_has_the_same_files_open_afterwards():
    """Pipes and sockets are closed."""

    def open_files() -> list[str]:
        return sorted(path.name for path in Path("/proc/self/fd").iterdir())

    before = open_files()
    run_isolated(dict, 10.0)
    assert open_files() == before
