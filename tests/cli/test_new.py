"""``rtf new``: what it writes passes, and nothing that exists is lost."""

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
    """``rtf new`` in a folder."""
    command = [sys.executable, "-m", "rtf", "new", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_passes(kind: str, tmp_path: Path):
    """The command that is printed runs a test that passes, and validating finds nothing."""
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
    """Where one of the files exists, none is written."""
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
def test_wrong_words_are_told(words: tuple[str, ...], tmp_path: Path):
    """A name has to be one for files and classes."""
    assert new(tmp_path, *words).returncode == ExitCode.USAGE
    assert [*tmp_path.iterdir()] == []
