"""``rtf new``: its files pass, and no existing file is overwritten."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from harness import run_command
from rtf.cli.new import KINDS
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from pathlib import Path


def new(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run ``rtf new`` in a folder."""
    command = [sys.executable, "-m", "rtf", "new", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_passes(kind: str, tmp_path: Path):
    """The printed command runs a test that passes, and the suite is valid."""
    made = new(tmp_path, kind, "left_elbow")
    assert made.returncode == 0, made.stderr
    *written, following = made.stdout.splitlines()
    assert all((tmp_path / line.removeprefix("wrote ")).is_file() for line in written)
    program, *words = following.removeprefix("Next: ").split()
    assert program == "testrunner"
    done = run_command(tmp_path, *words)
    assert done.exit_code == ExitCode.PASSED, done.stdout + done.stderr
    assert len(done.results.tests) >= 1
    if words[0].endswith(".xml"):
        assert run_command(tmp_path, "validate", "--strict", *words).exit_code == ExitCode.PASSED


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_overwritten(kind: str, tmp_path: Path):
    """If one of the files exists, none is written."""
    written = [line.removeprefix("wrote ") for line in new(tmp_path, kind, "mine").stdout.splitlines()[:-1]]
    last = tmp_path / written[-1]
    last.write_text("mine")
    for name in written[:-1]:
        (tmp_path / name).unlink()
    done = new(tmp_path, kind, "mine")
    assert done.returncode == ExitCode.USAGE
    assert f"{written[-1]} exists already" in done.stderr
    assert last.read_text() == "mine"
    assert not any((tmp_path / name).exists() for name in written[:-1])


@pytest.mark.parametrize("words", [("tset", "x"), ("test", "../x"), ("test", "1x"), ("test",), ("test", "x", "y")])
def test_wrong_words_are_reported(words: tuple[str, ...], tmp_path: Path):
    """An unknown kind, and a name that fits no file and class, are wrong usage."""
    assert new(tmp_path, *words).returncode == ExitCode.USAGE
    assert [*tmp_path.iterdir()] == []
