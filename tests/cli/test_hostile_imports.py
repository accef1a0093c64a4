"""Plug-ins that start processes while they are imported: every command works with them, and leaves no process."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness import Command, write_files
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from pathlib import Path

TEST = """
from rtf.testing import TestCase
class Starter(TestCase):
    '''Starts something.'''
    safety = "motion"
    def run(self): self.check(True, "runs")
"""
FORKS = "import os, time\nif os.fork() == 0:\n    time.sleep(600)\n"
GOES_ON_TWICE = "import os\nos.fork()\n"
DAEMON = """
import os, signal, time
read, write = os.pipe()
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.write(write, b"x")
        time.sleep(600)
    os._exit(0)
os.read(read, 1)
"""


COMMANDS = [
    ["--suite", "s.xml", "--dry-run"],
    ["validate", "s.xml"],
    ["describe", "starter.py"],
    ["--test", "starter.py"],
    ["--suite", "s.xml"],
]


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("text", [FORKS, DAEMON, GOES_ON_TWICE], ids=["forks", "daemon", "goes on twice"])
def test_a_plug_in_that_starts_processes_at_import_breaks_no_command(tmp_path: Path, text: str, arguments: list[str]):
    """The command passes without a traceback, and no process is left."""
    suite = '<suite name="s"><test> starter.py </test></suite>'
    write_files(tmp_path, {"starter.py": text + TEST, "s.xml": suite})
    command = Command(tmp_path, *arguments)
    outcome = command.wait()
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert "Traceback" not in outcome.stderr + outcome.stdout
    assert command.left_over() == []
