"""Sessions of pytest in processes, in a folder with suites, with this plug-in and requested ones only."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import pytest

from harness import MARK, marked, read_back, write_files
from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable

    import psutil

    from rtf.testing.events import Event
    from rtf.testing.results import RunResult

#: Entry points are not loaded, so that the plug-in is there once, installed or not.
ALONE = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_ADDOPTS": "", "NO_COLOR": "1", "COLUMNS": "160"}
PLUGINS = ("-p", "rtf.pytest_plugin", "-p", "no:cacheprovider")

#: A plug-in file with a class for most verdicts of a test; a parameter selects what a test does.
TESTS = '''
import threading
from pathlib import Path
from rtf.testing import Inconclusive, SkipTest, TestCase

class Fine(TestCase):
    """Passes."""
    tags = ("quick",)
    def run(self):
        print("said aloud")
        self.check(True, "all is well")

class Measures(TestCase):
    """Measures two joints, the first of them too far out."""
    tags = ("slow-arm", "skip")
    def run(self):
        with self.subresult("left"):
            self.measure("position", 12.5, "deg", low=0, high=10)
        with self.subresult("right"):
            self.measure("position", 9.5, "deg", low=0, high=10)

class Crashes(TestCase):
    """Kills itself."""
    def run(self):
        import os, signal
        os.kill(os.getpid(), signal.SIGKILL)

class Hangs(TestCase):
    """Waits for nothing."""
    def run(self):
        Path("running").touch()
        threading.Event().wait()
    def teardown(self):
        Path("torn-down").touch()

class Skips(TestCase):
    """Does not want to."""
    def run(self):
        raise SkipTest("no left arm here")

class Unsure(TestCase):
    """Cannot say."""
    def run(self):
        raise Inconclusive("the light was off")

class Flaky(TestCase):
    """Fails the first time."""
    def run(self):
        mark = Path("was-here")
        if not mark.exists():
            mark.touch()
            self.assert_fail("stumbled")

class Raises(TestCase):
    """Has a bug."""
    def run(self):
        raise KeyError("arm")
'''

#: A fixture that logs its calls, and collapses, or does not come up, on request.
ROBOT = '''
from pathlib import Path
from rtf.testing import FixtureManager

class Robot(FixtureManager):
    """Notes what is done to it."""
    def setup(self, param=""):
        self.note("up")
    def check(self):
        if Path("robot-dies").exists():
            Path("robot-dies").unlink()
            return False
        return True
    def teardown(self):
        self.note("down")
    def note(self, word):
        with open("robot.log", "a") as stream:
            stream.write(word + "\\n")
'''


@dataclass
class Finished:
    """The result of a session of pytest."""

    exit_code: int
    out: str
    folder: Path
    events: list[Event] = field(default_factory=list)
    results: RunResult | None = None

    @property
    def summary(self) -> list[str]:
        """The lines of the short summary."""
        return self.out.partition("short test summary info")[2].splitlines()[1:]

    @property
    def last_line(self) -> str:
        """The line with the counts."""
        return self.out.rstrip().rpartition("\n")[2].strip("= ")

    def line(self, start: str) -> str:
        """Return the one line of the short summary with this beginning."""
        (found,) = [line for line in self.summary if line.startswith(start)]
        return found

    def cases(self, name: str = "junit.xml") -> dict[str, ET.Element]:
        """Return the cases of the JUnit file by name."""
        root = ET.parse(self.folder / name).getroot()
        return {case.get("name", ""): case for case in root.iter("testcase")}


class Session:
    """A running session of pytest."""

    def __init__(self, folder: Path, *arguments: str, **environment: str) -> None:
        self.folder = folder
        self.mark = f"{os.getpid()}-{id(self)}"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "pytest", *PLUGINS, *arguments],
            cwd=folder,
            env={**os.environ, **ALONE, MARK: self.mark, **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="backslashreplace",
        )

    def wait(self, timeout: float = 60.0) -> Finished:
        """Wait for the end, and read the run's journal if there is one."""
        out, _ = self.process.communicate(timeout=timeout)
        run = self.folder / "rtf-runs" / "latest"
        events, results = read_back(run) if run.exists() else ([], None)
        return Finished(self.process.returncode, out, self.folder, events, results)

    def wait_until(self, condition: Callable[[], bool], timeout: float = 30.0) -> None:
        """Wait until a condition holds, while the session runs."""
        deadline = clock.Deadline.after(timeout)
        while not condition():
            assert self.process.poll() is None, self.process.communicate()[0]
            assert not deadline.expired
            clock.sleep(0.005)

    def interrupt(self, signum: int = signal.SIGINT) -> None:
        """Send a signal to the session's process only."""
        self.process.send_signal(signum)

    def left_over(self, timeout: float = 15.0) -> list[psutil.Process]:
        """Return the remaining processes after a short time."""
        deadline = clock.Deadline.after(timeout)
        while (found := marked(self.mark)) and not deadline.expired:
            clock.sleep(0.01)
        return found


class Lab:
    """A folder with plug-ins and suites for sessions."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        write_files(folder, {"tests.py": TESTS, "robot.py": ROBOT})

    def write(self, **files: str) -> None:
        """Write files by name; ``stem__suffix`` stands for ``stem.suffix``."""
        write_files(self.folder, files)

    def suite(self, inside: str, name: str = "s", attributes: str = "") -> str:
        """Write a suite file, and return its name."""
        file = f"{name}.xml"
        text = f'<suite name="{name}" {attributes}>\n{inside}\n</suite>\n'
        (self.folder / file).write_text(text, encoding="utf-8")
        return file

    def start(self, *arguments: str, **environment: str) -> Session:
        """Start pytest."""
        return Session(self.folder, *arguments, **environment)

    def run(self, *arguments: str, **environment: str) -> Finished:
        """Run pytest to its end."""
        return self.start(*arguments, **environment).wait()

    @property
    def log(self) -> list[str]:
        """The notes of the robot fixture."""
        path = self.folder / "robot.log"
        return path.read_text().split() if path.exists() else []


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    """A folder for one test."""
    return Lab(tmp_path)


@pytest.fixture(scope="module")
def module_lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A folder for all tests of a module."""
    return Lab(tmp_path_factory.mktemp("lab"))
