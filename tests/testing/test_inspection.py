"""Inspection: a plug-in is loaded in a child process; its description, its failures, and nothing left behind."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.testing import inspection
from rtf.testing.inspection import inspect_plugin, inspect_plugins
from rtf.testing.isolation.messages import Use
from rtf.testing.plugins import PluginRef

if TYPE_CHECKING:
    from rtf.testing.inspection import Inspection

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
    """Return whether a process exists, zombies included."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def inspect(folder: Path, text: str) -> Inspection:
    """Inspect a plug-in with this text."""
    path = folder / "leaver.py"
    path.write_text(text + CASE)
    return inspect_plugin(PluginRef("test", "leaver", str(path), "python"))


def test_result_comes_back_whole(tmp_path: Path):
    """A description larger than a pipe's buffer is returned whole."""
    path = tmp_path / "large.py"
    path.write_text(CASE.replace("    def run", "    tags = ('\\ud800', 'x' * (1 << 20))\n    def run"))
    found = inspect_plugin(PluginRef("test", "large", str(path), "python"))
    assert found.spec.tags == ("\\ud800", "x" * (1 << 20))


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("import os; os._exit(7)", "its process ended while it was being loaded: exit status 7"),
        ("import os; os.kill(os.getpid(), 11)", "its process ended while it was being loaded: killed by SIGSEGV"),
        (
            "import os, signal; os.kill(os.getppid(), 9); signal.pause()",
            "the process from which it was forked was lost while it was being",
        ),
        ("import signal; signal.pause()", "it did not load within 1 s"),
        ("import os; os.kill(os.getpid(), 19)", "it did not load within 1 s"),
        ("import sys; sys.exit('enough')", "SystemExit: enough"),
        ("import os; os.write(3, b'nonsense nonsense')", "what it wrote while it was being loaded is no"),
        ("import os; os.closerange(3, 9)", "its process ended while it was being loaded: exit status"),
    ],
)
def test_why_there_is_no_result_is_a_sentence(
    tmp_path: Path, line: str, sentence: str, monkeypatch: pytest.MonkeyPatch
):
    """A crash, exit, hang, exception or invalid result is a problem in one sentence."""
    if "within 1 s" in sentence:
        monkeypatch.setattr(inspection, "LOAD_LIMIT", 1.0)
    (problem,) = inspect(tmp_path, f"{line}\n").problems
    assert problem.startswith(sentence)


CRASHER = """
import os
from rtf.testing import Parameter, TestCase
class Crasher(TestCase):
    crash = Parameter(bool, "", default=False)
    def resolve_parameters(self, **given):
        found = super().resolve_parameters(**given)
        return os._exit(3) if self.crash else found
    def run(self): pass
"""


def test_one_that_crashes_spoils_no_other(tmp_path: Path):
    """Each inspected plug-in, and each use of one, has its own problems."""
    texts = {"good": CASE, "bad": "import os; os._exit(7)\n", "crasher": CRASHER}
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text)
    good, bad, crasher = (PluginRef("test", name, str(tmp_path / f"{name}.py"), "python") for name in texts)
    found = inspect_plugins({good: [], bad: [], crasher: [Use(), Use(param="--crash true")]})
    assert (found[good].spec.class_name, found[good].problems) == ("Leaver", ())
    assert "exit status 7" in found[bad].problems[0]
    assert [bool(trial.problems) for trial in found[crasher].trials] == [False, True]


@pytest.mark.parametrize("text", [FORKS, FORKS_AND_GOES_ON, DAEMON], ids=["forks", "goes on in both", "daemon"])
def test_plugin_that_starts_processes_at_import_leaves_none(tmp_path: Path, text: str):
    """A plug-in that starts processes is described, and its processes are ended."""
    began = clock.monotonic()
    found = inspect(tmp_path, text)
    assert (found.spec.class_name, found.problems) == ("Leaver", ())
    assert clock.monotonic() - began < 10
    if text is DAEMON:
        assert not alive(int((tmp_path / "daemon").read_text()))


def test_child_that_does_not_end_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A time-out ends the child and its daemon."""
    monkeypatch.setattr(inspection, "LOAD_LIMIT", 1.0)
    assert inspect(tmp_path, DAEMON + "signal.pause()\n").problems == ("it did not load within 1 s",)
    assert not alive(int((tmp_path / "daemon").read_text()))


def test_process_that_asks_has_the_same_files_open_afterwards(tmp_path: Path):
    """Inspection leaves no descriptor open."""

    def open_files() -> list[str]:
        return sorted(path.name for path in Path("/proc/self/fd").iterdir())

    before = open_files()
    inspect(tmp_path, "")
    assert open_files() == before
