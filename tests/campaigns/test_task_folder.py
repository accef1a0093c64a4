"""Folders of runs are removed: by their process, and by the next one where it was killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

MAKE = "from rtf.campaigns.task_folder import task_folder\nwith task_folder() as (path, keeper):\n    "
#: Prints the folder, and ends when its input does.
WAITING = MAKE + "print(path, flush=True); input()"
#: The same, with a child that has inherited the descriptor and outlives it; its input ends with that of the process.
WITH_RUNNER = MAKE + (
    "import subprocess, sys\n"
    "    child = subprocess.Popen([sys.executable, '-c', 'input()'], pass_fds=(keeper,))\n"
    "    print(path, child.pid, flush=True); child.wait()"
)


def begun(code: str) -> tuple[subprocess.Popen[str], list[str]]:
    """A process that has made its folder, and what it says of it."""
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, process.stdout.readline().split()


def made_once() -> None:
    """Make a folder in a process of its own, which removes what was left."""
    subprocess.run([sys.executable, "-c", MAKE + "pass"], check=True)


def test_what_a_killed_process_has_left_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """By the next one; folders in use, also by a runner alone, and those of others stay."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    (tmp_path / "rtf-campaign-mine").mkdir()  # of something else: it has no lock
    used, [used_folder] = begun(WAITING)
    killed, _ = begun(WAITING)
    orphaned, [orphaned_folder, runner] = begun(WITH_RUNNER)
    killed.kill()
    orphaned.kill()
    killed.wait()
    orphaned.wait()
    made_once()
    left = {str(path) for path in tmp_path.iterdir()}
    assert left == {str(tmp_path / "rtf-campaign-mine"), used_folder, orphaned_folder}
    os.kill(int(runner), signal.SIGKILL)
    used.communicate("\n")
    assert not Path(used_folder).exists()
    for process in (killed, orphaned):
        process.communicate()  # ends when the runner has, too, which has the same output
    made_once()
    assert [path.name for path in tmp_path.iterdir()] == ["rtf-campaign-mine"]
