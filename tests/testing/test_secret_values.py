"""Secret values: absent from journal, reports and page, and required again to resume a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness import run_command
from rtf.testing import Parameter, TestCase, journal
from rtf.testing.parameters import ParameterError
from rtf.testing.plugins import find, spec_of
from rtf.testing.secret_values import is_secret, masked_command
from rtf.testing.verdict import ExitCode

LOGIN = '''
from pathlib import Path
from rtf.testing import Parameter, TestCase

class Login(TestCase):
    """Logs in."""

    password = Parameter(str, "password of the robot", default="none")
    pin = Parameter(int, "number of the operator", default=0, high=9999, secret=True, aliases=("code",))
    keyboard = Parameter(str, "layout", default="us")

    def run(self):
        Path("seen").write_text(f"{self.password} {self.pin}")
        self.assert_true(self.keyboard != "de", "the keyboard has the letters")
'''

SEER = """
import os
from pathlib import Path
from rtf.testing import Parameter, TestCase

class Seer(TestCase):
    password = Parameter(str, "password of the robot", default="none")
    token = Parameter(str, "token", default="none")

    def run(self):
        shown, process = [], os.getpid()
        while not shown or b"testrunner" not in shown[-1]:
            shown.append(Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\\n", b" "))
            process = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
        Path("shown").write_bytes(b"\\n".join(shown))
        self.assert_equal((self.password, self.token), ("hunter2", "t0psecret"), "the values")
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a suite of a test with secret parameters."""
    (tmp_path / "login.py").write_text(LOGIN)
    (tmp_path / "s.xml").write_text('<suite name="s"><test>login.py</test><test name="b">login.py</test></suite>')
    return tmp_path


@pytest.mark.parametrize("name", ["password", "robot_passwd", "apiToken", "API_KEY", "key", "client-secret", "tokens"])
def test_name_that_is_secret(name: str):
    """A name is secret by one of its words, however they are joined."""
    assert is_secret(name)


@pytest.mark.parametrize("name", ["keyboard", "monkey", "speed", "passive", "part", "tokenizer"])
def test_name_that_is_not_secret(name: str):
    """A name is not secret by a part of a word."""
    assert not is_secret(name)


@pytest.mark.parametrize(
    ("word", "shown"),
    [
        ("password=hunter2", "password=***"),
        ("--set=password=hunter2", "--set=password=***"),
        ("pin=4711", "pin=***"),
        ("speed=20", "speed=20"),
        ("--speed 3 --password 'hunter 2' --part arm", "--speed 3 --password *** --part arm"),
        ("--param=--token hunter2", "--param=--token ***"),
        ("left and not key", "left and not key"),
    ],
)
def test_command_line_without_its_secrets(word: str, shown: str):
    """Secrets in ``NAME=VALUE`` and parameter strings are masked, and nothing else."""
    assert masked_command([word], {"pin"}) == (shown,)


def test_secrets_are_in_no_file_of_a_run(folder: Path):
    """The test gets the secrets; journal, reports, page and console do not have them."""
    command = ["-s", "s.xml", "--set", "password=hunter2", "--set", "code=4711", "--set", "keyboard=fr"]
    reports = ["--json", "r.json", "--junit", "j.xml", "--html", "r.html", "-vv"]
    done = run_command(folder, *command, *reports)
    assert done.exit_code == 0, done.stderr
    seen = [path for path in folder.rglob("seen") if path.read_text() == "hunter2 4711"]
    assert seen, "the test has the values"
    written = [path for path in folder.rglob("*") if path.is_file() and path not in seen]
    assert [path for path in written if b"hunter2" in path.read_bytes() or b"code=4711" in path.read_bytes()] == []
    assert "hunter2" not in done.stdout + done.stderr
    assert b"keyboard=fr" in (done.folder / journal.FILE_NAME).read_bytes()


def test_secrets_are_in_the_arguments_of_no_process_that_the_run_starts(folder: Path):
    """No process between runner and worker has secrets in its arguments."""
    (folder / "seer.py").write_text(SEER)
    (folder / "s.xml").write_text('<suite name="s"><test param="--token t0psecret">seer.py</test></suite>')
    done = run_command(folder, "-s", "s.xml", "--set", "password=hunter2")
    assert done.exit_code == 0, done.stderr
    *started, runner = (folder / "shown").read_bytes().split(b"\n")
    assert b"password=hunter2" in runner, "what the user typed is where the looking ends"
    assert started
    assert all(b"hunter2" not in line and b"t0psecret" not in line for line in started)


def test_value_that_is_wrong_is_not_shown(folder: Path):
    """The error about an invalid secret does not show its value."""
    done = run_command(folder, "-s", "s.xml", "--set", "pin=471147", "-vv")
    assert b"471147" not in (done.folder / journal.FILE_NAME).read_bytes()
    assert "471147" not in done.stdout
    assert "pin: the secret value is no whole number that is allowed (--set)" in done.stdout


class Open(TestCase):
    """A test with a parameter that only sounds secret."""

    key = Parameter(str, "key on the keyboard", default="a", secret=False)
    token = Parameter(int, "a number")


def test_author_has_the_last_word():
    """A parameter with ``secret=False`` is shown, whatever its name."""
    rows = Open().resolve_parameters(param="--key q --token 12")
    assert {row["name"]: row["value"] for row in rows if row["source"] == "param"} == {"key": "q", "token": "***"}
    with pytest.raises(ParameterError) as caught:
        Open().resolve_parameters(param="--token hunter2")
    assert "hunter2" not in str(caught.value)


def test_resumed_run_needs_its_secrets_again(folder: Path):
    """A resumed run needs its secrets again; the error names them."""
    secrets = ["--set", "password=hunter2", "--set", "pin=4711"]
    run_command(folder, "-s", "s.xml", *secrets, "--set", "keyboard=de", "--maxfail", "1")
    refused = run_command(folder, "--resume", "rtf-runs/latest", "--set", "pin=4711")
    assert refused.exit_code == ExitCode.USAGE
    assert "password is secret and was not written down; give it again: --set password=VALUE" in refused.stderr
    refused = run_command(folder, "--resume", "rtf-runs/latest", *secrets, "--set", "keyboard=fr")
    assert "--set keyboard: a run that is resumed keeps its parameters" in refused.stderr
    run_command(folder, "--resume", "rtf-runs/latest", *secrets)
    run = folder / "rtf-runs" / "latest"
    assert journal.results_of(run).finished() == {"s/login", "s/b"}
    assert b"hunter2" not in (run / journal.FILE_NAME).read_bytes()


def test_declarations_are_read_from_the_text(folder: Path):
    """Secret parameters of a class and its bases are read from the text."""
    (folder / "again.py").write_text(f"{LOGIN}\nclass Again(Login):\n    pass\n")
    for name in ("login.py", "again.py"):
        assert spec_of(find("test", name, beside=folder)).secrets == ("code", "pin")


def test_parameter_that_a_class_of_another_file_declares_is_secret(folder: Path):
    """A secret parameter that another file declares is masked, too."""
    (folder / "again.py").write_text("from login import Login\nclass Again(Login):\n    pass\n")
    done = run_command(folder, "again.py", "--set", "code=4711")
    assert done.exit_code == ExitCode.PASSED, done.stderr
    assert b"code=4711" not in (done.folder / journal.FILE_NAME).read_bytes()
