"""``--debug`` and ``--core-dumps``: a debugger at the terminal for a test, and core dumps of programs."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import subprocess
import sys
from pathlib import Path

import pytest

from harness import run_command, write_files
from rtf import clock
from rtf.testing.events import Attached, Message
from rtf.testing.verdict import Verdict

SUITE = '<suite name="s"><timeout>0.5</timeout><test name="a">a.py</test></suite>'
STOPS = """
from rtf.testing import TestCase
class A(TestCase):
    def run(self):
        secret = 6 * 7
        breakpoint()
        self.check_equal(secret, 43, "the secret")
"""
RAISES = """
from rtf.testing import TestCase
class A(TestCase):
    def run(self):
        place = "the author's frame"
        self.assert_equal(1, 2, "numbers")
"""
CRASHES = "#!/bin/sh\nkill -SEGV $$\n"


class Terminal:
    """``testrunner`` at a terminal."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._master, slave = pty.openpty()
        self.seen = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rtf.cli.testrunner", *arguments],
            cwd=folder,
            env={**os.environ, "TERM": "xterm"},
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
        )
        os.close(slave)

    def wait_for(self, text: str) -> None:
        """Read until a text is shown."""
        deadline = clock.Deadline.after(30.0)
        start = len(self.seen)
        while text not in self.seen[start:]:
            assert not deadline.expired, self.seen
            if select.select([self._master], [], [], 0.1)[0]:
                self.seen += os.read(self._master, 4096).decode(errors="replace")

    def type(self, text: str) -> None:
        """Type a line."""
        os.write(self._master, f"{text}\n".encode())

    def end(self) -> int:
        """Wait for the end, and return the exit code."""
        deadline = clock.Deadline.after(30.0)
        with contextlib.suppress(OSError):  # no process has the terminal any more
            while not deadline.expired:
                if select.select([self._master], [], [], 0.1)[0]:
                    self.seen += os.read(self._master, 4096).decode(errors="replace")
        os.close(self._master)
        return self.process.wait(30.0)


def test_breakpoint_opens_the_debugger_at_the_terminal(tmp_path: Path):
    """A breakpoint opens the debugger in the test's process, without a time limit; changes have an effect."""
    write_files(tmp_path, {"s.xml": SUITE, "a.py": STOPS})
    terminal = Terminal(tmp_path, "s.xml", "--debug")
    terminal.wait_for("(Pdb)")
    terminal.type("print('it is', secret)")
    terminal.wait_for("it is 42")
    clock.sleep(0.6)  # longer than the limit of the test
    terminal.type("secret = 43")
    terminal.wait_for("(Pdb)")
    terminal.type("c")
    assert terminal.end() == 0, terminal.seen


def test_a_test_that_raises_is_examined_where_it_did(tmp_path: Path):
    """After an exception the debugger opens in the author's frame; the verdict is the usual one."""
    write_files(tmp_path, {"s.xml": SUITE, "a.py": RAISES})
    terminal = Terminal(tmp_path, "s.xml", "--debug")
    terminal.wait_for("(Pdb)")
    assert "TestFailure: numbers: 1, expected 2" in terminal.seen
    terminal.type("print(place)")
    terminal.wait_for("the author's frame")
    terminal.type("c")
    assert terminal.end() == 1, terminal.seen


def test_a_debugger_needs_a_terminal(tmp_path: Path):
    """``--debug`` without a terminal is wrong usage, and nothing runs."""
    write_files(tmp_path, {"s.xml": SUITE, "a.py": STOPS})
    outcome = run_command(tmp_path, "s.xml", "--debug")
    assert outcome.exit_code == 4
    assert "--debug needs a terminal" in outcome.stderr


def test_core_dumps_are_kept_where_the_kernel_writes_them(tmp_path: Path):
    """A program's core file is attached to its test; without one a warning has the reason."""
    write_files(tmp_path, {"s.xml": '<suite name="s"><test name="p" type="exit">p.sh</test></suite>', "p.sh": CRASHES})
    outcome = run_command(tmp_path, "s.xml", "--core-dumps")
    assert outcome.verdict("p") is Verdict.ERROR
    attached = [event.path for event in outcome.of(Attached)]
    warned = [event.detail for event in outcome.of(Message, title="warns")]
    if warned:
        assert "core dump" in warned[0]
    else:
        (path,) = attached
        assert (outcome.folder / path).read_bytes().startswith(b"\x7fELF")
    assert not [*tmp_path.glob("core*")]


@pytest.mark.parametrize(
    ("pattern", "problem"),
    [
        ("|/usr/share/apport %p", "the kernel hands it to /usr/share/apport"),
        ("no-%e-%p", "has written no core dump"),
    ],
)
def test_why_there_is_no_core_dump_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pattern: str, problem: str):
    """The reason for a missing core dump is reported, such as a program that gets it from the kernel."""
    from rtf.testing.languages import program

    pattern_file = tmp_path / "pattern"
    pattern_file.write_text(pattern)
    monkeypatch.setattr(program, "_CORE_PATTERN", pattern_file)
    assert problem in program.keep_core_dump(os.getpid(), tmp_path / "kept", 0.0)


def test_a_core_file_is_found_by_the_pattern_of_the_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A core file is found by the kernel's pattern, with its variables."""
    from rtf.testing.languages import program

    pattern_file = tmp_path / "pattern"
    pattern_file.write_text(f"{tmp_path}/%e.%p.%t-100%%")
    monkeypatch.setattr(program, "_CORE_PATTERN", pattern_file)
    (tmp_path / "program.77.1234-100%").write_bytes(b"core")
    assert program.keep_core_dump(77, tmp_path / "kept", 0.0) == ""
    assert (tmp_path / "kept" / "core.77").read_bytes() == b"core"
