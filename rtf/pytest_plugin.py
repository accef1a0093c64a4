"""The pytest plug-in: suites of robot tests beside all other tests. Hooks and options, and nothing else.

It is loaded in every pytest session of the environment, so it imports no other module of the framework and changes
nothing until a suite file is collected; the rest is in :mod:`rtf.pytest_suites`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.pytest_suites.nodes import SuiteFile

#: Reports of pytest-xdist workers to their session: lines of the summary, and whether one had an internal error.
_FROM_WORKERS = pytest.StashKey[dict[str, Any]]()
_XDIST_SESSION = pytest.StashKey[str]()

#: Options with one value: name, metavar, help. Each is an ini value, too, with underscores.
_SINGLE = (
    ("timeout", "S", "default limit of one run(), such as 20, 500ms, 2min"),
    ("retries", "N", "retry a test that did not pass up to N times; a late pass is 'flaky'"),
    ("robot", "NAME", "name of the robot, for the record"),
    ("station", "NAME", "name of the test station, for the record (default: host name)"),
    ("answer", "TEXT", "answer operator questions with this ('default': their defaults)"),
    ("runs", "DIR", "folder for the run folders (default: rtf-runs)"),
)
#: Options that may be given several times, after those of the ini file, one a line there.
_SEVERAL = (
    ("set", "KEY=VALUE", "parameter of every test, overriding the suite"),
    ("define", "NAME=VALUE", "replace ${NAME} in suite files by VALUE"),
    ("feature", "WORD", "grant a requirement that tests name by a word"),
    ("report", "NAME[=FILE]", "write a report of the robot tests, such as html, history, json"),
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options and their ini values."""
    group = parser.getgroup("rtf", "robot testing (rtf)")
    group.addoption("--rtf", action="store_true", help="collect suite files in folders, too, not only named ones")
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
    """Check the values of options before anything is collected."""
    names = [name for name, _, _ in (*_SINGLE, *_SEVERAL)]
    if any(config.getoption(f"rtf_{name}") or config.getini(f"rtf_{name}") for name in names):
        from rtf.pytest_suites.settings import Settings

        Settings.of(config)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> SuiteFile | None:
    """Collect a named suite file, or any suite file with ``--rtf``."""
    if file_path.suffix.lower() != ".xml":
        return None
    config = parent.config
    if not (parent.session.isinitpath(file_path) or config.getoption("rtf") or config.getini("rtf_suites")):
        return None
    from rtf.pytest_suites.sniff import is_suite

    if not is_suite(file_path):
        return None
    from rtf.pytest_suites.hooks import register_hooks
    from rtf.pytest_suites.nodes import SuiteFile

    register_hooks(config)
    return SuiteFile.from_parent(parent, path=file_path)


# Where pytest-xdist has workers run the tests -------------------------------------------------------------------------


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:  # a class of pytest-xdist, which need not be installed
    """Pass the common id of the session to a worker."""
    node.config.stash[_XDIST_SESSION] = node.workerinput["testrunuid"]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Keep the report of a worker about its run."""
    said = getattr(node, "workeroutput", {}).get("rtf")
    if said is not None:
        kept = node.config.stash.setdefault(_FROM_WORKERS, {"lines": [], "broken": False})
        kept["lines"] += said["lines"]
        kept["broken"] |= said["broken"]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail the session if the run of a worker had an internal error."""
    if session.config.stash.get(_FROM_WORKERS, {"broken": False})["broken"]:
        session.exitstatus = pytest.ExitCode.INTERNAL_ERROR


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the folders of the workers' runs."""
    for line in config.stash.get(_FROM_WORKERS, {"lines": []})["lines"]:
        terminalreporter.write_line(line)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the lock file when all workers have ended."""
    if _XDIST_SESSION in config.stash:
        from rtf.pytest_suites.locks import lock_file

        lock_file(config.stash[_XDIST_SESSION]).unlink(missing_ok=True)
