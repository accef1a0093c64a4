"""The pytest plug-in: suites of robot tests beside all other tests. Hooks and options, and nothing else.

It is loaded in every session of every project of the environment, so it imports nothing of ours and changes nothing
until a suite file is collected; what it then needs is in :mod:`rtf.pytest_suites`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from rtf.pytest_suites.nodes import SuiteFile

#: What workers of pytest-xdist have told the session that started them: lines of the summary, and whether one broke.
_FROM_WORKERS = pytest.StashKey[dict[str, Any]]()
_XDIST_SESSION = pytest.StashKey[str]()

#: Options with one value: name, metavar, help. Each is an ini value, too, with underscores.
_SINGLE = (
    ("timeout", "S", "limit of one run() where the suite says none, such as 20, 500ms, 2min"),
    ("retries", "N", "try a test that did not pass N more times; a late pass is 'flaky'"),
    ("robot", "NAME", "name of the robot, for the record"),
    ("station", "NAME", "name of the test station, for the record (default: host name)"),
    ("answer", "TEXT", "answer operator questions with this ('default': their defaults)"),
    ("runs", "DIR", "where the folders of runs are made (default: rtf-runs)"),
)
#: Options that may be given several times, after those of the ini file, one a line there.
_SEVERAL = (
    ("set", "KEY=VALUE", "parameter of every test, over what the suite says"),
    ("define", "NAME=VALUE", "put VALUE in for ${NAME} in suite files"),
    ("feature", "WORD", "grant what tests require by a bare word"),
    ("report", "NAME[=FILE]", "write a report of the robot tests, such as html, history, json"),
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options and their ini values."""
    group = parser.getgroup("rtf", "robot testing (rtf)")
    group.addoption("--rtf", action="store_true", help="collect suite files in folders, too, not only where named")
    group.addoption(
        "--rtf-lenient", action="store_true", help="an unknown element or attribute of a suite is a warning"
    )
    parser.addini("rtf_lenient", "read suites as --rtf-lenient does", type="bool", default=False)
    parser.addini("rtf_suites", "collect suite files in folders, as --rtf does", type="bool", default=False)
    for name, metavar, text in _SINGLE:
        group.addoption(f"--rtf-{name}", metavar=metavar, help=text)
        parser.addini(f"rtf_{name}", text, type="string", default="")
    for name, metavar, text in _SEVERAL:
        group.addoption(f"--rtf-{name}", metavar=metavar, action="append", default=[], help=f"{text} (repeat)")
        parser.addini(f"rtf_{name}", text, type="linelist", default=[])


def pytest_configure(config: pytest.Config) -> None:
    """Refuse wrong values before anything is collected, if there are values."""
    names = [name for name, _, _ in (*_SINGLE, *_SEVERAL)]
    if any(config.getoption(f"rtf_{name}") or config.getini(f"rtf_{name}") for name in names):
        from rtf.pytest_suites.settings import Settings

        Settings.of(config)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> SuiteFile | None:
    """Collect a suite file that was named, or any where that was asked for."""
    if file_path.suffix.lower() != ".xml":
        return None
    config = parent.config
    if not (parent.session.isinitpath(file_path) or config.getoption("rtf") or config.getini("rtf_suites")):
        return None
    from rtf.pytest_suites.sniff import is_suite

    if not is_suite(file_path):
        return None
    from rtf.pytest_suites.nodes import SuiteFile

    return SuiteFile.from_parent(parent, path=file_path)


# Where pytest-xdist has workers run the tests -------------------------------------------------------------------------


def lock_file(session: str) -> Path:
    """The file by which the workers of a session keep from each other's fixtures; nobody else can guess its name."""
    return Path(tempfile.gettempdir()) / f"rtf-fixtures-{session}.lock"


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:  # a class of pytest-xdist, which need not be installed
    """Keep the id that all workers of this session know."""
    node.config.stash[_XDIST_SESSION] = node.workerinput["testrunuid"]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Keep what a worker has to say about its run."""
    said = getattr(node, "workeroutput", {}).get("rtf")
    if said is not None:
        kept = node.config.stash.setdefault(_FROM_WORKERS, {"lines": [], "broken": False})
        kept["lines"] += said["lines"]
        kept["broken"] |= said["broken"]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A worker's run that broke must not look like one that passed."""
    if session.config.stash.get(_FROM_WORKERS, {"broken": False})["broken"]:
        session.exitstatus = pytest.ExitCode.INTERNAL_ERROR


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say where the records of the workers' runs are."""
    for line in config.stash.get(_FROM_WORKERS, {"lines": []})["lines"]:
        terminalreporter.write_line(line)


def pytest_unconfigure(config: pytest.Config) -> None:
    """When all workers are gone nobody needs their file any more."""
    if _XDIST_SESSION in config.stash:
        lock_file(config.stash[_XDIST_SESSION]).unlink(missing_ok=True)
