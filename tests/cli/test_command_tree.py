"""The rules of all commands: exit codes, help, unknown words, and the streams and folder that they need."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from rtf.cli.command_tree import RTF, TESTRUNNER, Command, main
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from pathlib import Path

#: Every command of both programs, by the words that lead to it.
COMMANDS = [(root, words, command) for root in (TESTRUNNER, RTF) for words, command in root.leaves()]
EVERY = pytest.mark.parametrize(
    ("root", "words", "command"), COMMANDS, ids=[" ".join((root.name, *words)) for root, words, _ in COMMANDS]
)
MODULE = {"testrunner": "rtf.cli.testrunner", "rtf": "rtf"}
FINE = """
from rtf.testing import TestCase
class Fine(TestCase):
    def run(self):
        self.check(True, "fine")
"""


def call(*words: str, folder: Path, **given: object) -> subprocess.CompletedProcess[str]:
    """Run a program in a process."""
    words = (sys.executable, "-m", MODULE[words[0]], *words[1:])
    return subprocess.run(words, cwd=folder, stderr=subprocess.PIPE, text=True, timeout=60, check=False, **given)


@EVERY
def test_help_is_no_error(root: Command, words: tuple[str, ...], command: Command, capsys: pytest.CaptureFixture[str]):
    """Help goes to standard output and names the command, with exit code 0."""
    for option in ("--help", "-h", "-?"):
        with pytest.raises(SystemExit) as ended:
            main(root, [*words, option])
        assert not ended.value.code
        shown = capsys.readouterr()
        assert command.name in shown.out
        assert not shown.err


@EVERY
def test_a_wrong_option_is_wrong_usage(
    root: Command, words: tuple[str, ...], command: Command, capsys: pytest.CaptureFixture[str]
):
    """An unknown option ends with 4, and a hint to the help."""
    with pytest.raises(SystemExit) as ended:
        main(root, [*words, "--no-such-option=1", "word"])
    assert ended.value.code == ExitCode.USAGE
    assert "--help'" in capsys.readouterr().err, command


@EVERY
@pytest.mark.parametrize(
    ("error", "code"),
    [
        (KeyboardInterrupt(), ExitCode.INTERRUPTED),
        (BrokenPipeError(), ExitCode.INTERNAL),
        (OSError("no space"), ExitCode.INTERNAL),
        (ZeroDivisionError("a bug"), ExitCode.INTERNAL),
    ],
    ids=["interrupted", "reader gone", "disk full", "bug"],
)
def test_what_ends_a_command_decides_its_exit_code(
    root: Command,
    words: tuple[str, ...],
    command: Command,
    error: BaseException,
    code: ExitCode,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
):
    """Each kind of exception has its exit code, never 1, which means failed tests."""

    def broken(_words: object) -> int:
        raise error

    monkeypatch.setattr(Command, "load", lambda found: broken if found is command else pytest.fail("another command"))
    monkeypatch.setattr(os, "dup2", lambda *_: None)
    assert main(root, words) == code
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(
    "words",
    [
        *(("testrunner", *words) for words, _ in TESTRUNNER.leaves()),
        *(("rtf", *words) for words, command in RTF.leaves() if command.name in ("list", "inject", "robotinterface")),
    ],
    ids=" ".join,
)
def test_without_an_output_or_a_folder_nothing_is_done(words: tuple[str, ...], tmp_path: Path):
    """Without standard output or working folder a command ends with 3, without a traceback."""
    command = [sys.executable, "-m", MODULE[words[0]], *words[1:]]
    spoil = "import os, sys; os.{}; os.execv(sys.executable, {!r})"
    (tmp_path / "gone").mkdir()
    for folder, broken, said in (
        (tmp_path, "close(1)", "standard output is closed"),
        (tmp_path / "gone", f"rmdir({str(tmp_path / 'gone')!r})", "working folder"),
    ):
        program = [sys.executable, "-c", spoil.format(broken, command)]
        done = subprocess.run(program, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == ExitCode.INTERNAL, done.stderr
        assert said in done.stderr
        assert "Traceback" not in done.stderr


def test_a_full_disk_is_no_failure_of_a_test(tmp_path: Path):
    """If the output cannot be written, the exit code is that of an internal error."""
    (tmp_path / "fine.py").write_text(FINE)
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = call("testrunner", "fine.py", folder=tmp_path, stdout=full)
    assert done.returncode == ExitCode.INTERNAL


def test_ctrl_c_in_the_last_moment(tmp_path: Path):
    """A signal while Python shuts down does not change the exit code."""
    (tmp_path / "fine.py").write_text(FINE)
    program = (
        "import os, signal, sys\n"
        "from rtf.cli.testrunner import main\n"
        "class Late:\n"
        "    def __del__(self, kill=os.kill, pid=os.getpid(), number=signal.SIGINT):\n"
        "        kill(pid, number)\n"
        "late = Late()\n"
        "late.itself = late\n"
        "sys.argv = ['testrunner', 'fine.py', '-q']\n"
        "sys.exit(main())\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, timeout=60, check=False)
    assert done.returncode == ExitCode.PASSED


@pytest.mark.parametrize("interrupt", ["raise KeyboardInterrupt", "raise RuntimeError() from KeyboardInterrupt()"])
def test_ctrl_c_in_generated_code(interrupt: str, tmp_path: Path):
    """KeyboardInterrupt from code that was compiled from text ends with 2, not by the signal."""
    program = (
        "import sys\n"
        "from rtf.cli.command_tree import Command\n"
        "from rtf.cli.tools import main\n"
        f"Command.load = lambda self: lambda words: exec({interrupt!r})\n"
        "sys.argv = ['rtf', 'version']\n"
        "sys.exit(main())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (ExitCode.INTERRUPTED, "rtf version: interrupted\n")


@pytest.mark.parametrize(
    "words",
    [
        ("testrunner", "describe", "one", "two"),
        ("testrunner", "report", "one", "two"),
        ("testrunner", "page", "one", "two"),
        ("testrunner", "where", "one", "two"),
        ("rtf", "version", "now"),
        ("rtf", "list", "/one", "/two"),
        ("rtf", "clean", "all"),
        ("rtf", "proof", "JointLimits"),
        ("rtf", "simulator", "now"),
        ("rtf", "simulator", "status", "now"),
        ("rtf", "robotinterface", "robot.xml"),
        ("rtf", "verison"),
        ("rtf",),
    ],
    ids=" ".join,
)
def test_no_word_is_dropped(words: tuple[str, ...], tmp_path: Path):
    """A superfluous word is wrong usage."""
    done = call(*words, folder=tmp_path, stdout=subprocess.PIPE)
    assert done.returncode == ExitCode.USAGE
    assert "--help" in done.stderr


def test_the_error_of_a_misspelt_command_has_the_right_one(tmp_path: Path):
    """The error about an unknown command names the nearest one."""
    assert "did you mean version?" in call("rtf", "verison", folder=tmp_path).stderr
