"""Python scripts of the C++ framework run unchanged."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rtf.testing.events import Message, ParametersResolved, SubResultEnded, TestRenamed
from rtf.testing.isolation.messages import Finished, Job, Use
from rtf.testing.isolation.worker import run_test
from rtf.testing.languages import legacy_python
from rtf.testing.plugins import PluginRef
from rtf.testing.session import Session

if TYPE_CHECKING:
    from collections.abc import Callable

DATA = Path(__file__).parents[2] / "data" / "plugins"


class Ran:
    """The result of a test: conclusion and events."""

    def __init__(self, conclusion: Finished, events: list[object]) -> None:
        self.outcome = str(conclusion.outcome)
        self.events = events
        self.messages = self.of(Message)

    def of(self, kind: type) -> list:
        """Return the events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def reported(self, *severities: str) -> list[tuple[str, str]]:
        """Return title and detail of the messages with these severities."""
        return [(m.title, m.detail) for m in self.messages if m.severity in severities]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a function that runs a script as a worker does."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, legacy_python.MODULE, raising=False)

    def carry_out(script: Path | str, param: str = "", how: dict[str, Any] | None = None, **more: Any) -> Ran:
        if isinstance(script, str):
            path = tmp_path / "script.py"
            path.write_text(script)
        else:
            path = script
        events: list[object] = []
        job = Job(
            kind="test",
            id="suite/the-test",
            name="the test",
            plugin=PluginRef("test", path.name, str(path), "python"),
            folder=str(tmp_path / "files"),
            run_folder=str(tmp_path),
            use=Use(param=param, **more),
            **(how or {}),
        )
        session = Session(job.id, events.append, folder=Path(job.folder), run_folder=tmp_path)
        return Ran(run_test(job, session), events)

    return carry_out


def test_a_script_of_the_cpp_framework_runs_unchanged(run: Callable[..., Ran]):
    """Every function works, with the C++ framework's titles, and lines of the script."""
    ran = run(DATA / "classic.py", "--joints 3", environment="--robotname icubSim")
    assert ran.reported("failure") == [
        ("checks", "wrong sums"),
        ("checking (False)", "told"),
        ("checking (a > b)", "always told"),
    ]
    assert ran.reported("pass") == [("checks", "sums")]
    assert [detail for _, detail in ran.reported("info")] == [
        "param is --joints 3",
        "environment is --robotname icubSim",
        "torn down",
    ]
    assert [event.name for event in ran.of(TestRenamed)] == ["classic"]
    assert {str(DATA / "classic.py")} == {message.file for message in ran.messages}
    assert next(message.line for message in ran.messages if message.detail == "sums") == 12
    assert ran.outcome == "failed"


def test_the_module_can_be_imported(run: Callable[..., Ran]):
    """A script can import the module ``robottestingframework``."""
    legacy_python.install()
    ran = run("""
import robottestingframework
from robottestingframework import testCheck
class TestCase:
    def run(self):
        testCheck(True, "imported")
        robottestingframework.testCheck(True, "too")
""")
    assert ran.reported("pass") == [("checks", "imported"), ("checks", "too")]
    assert ran.outcome == "passed"


def test_a_module_of_the_users_own_is_left_alone(run: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch):
    """An existing module of that name is not replaced."""
    monkeypatch.setitem(sys.modules, legacy_python.MODULE, sys)
    assert sys is legacy_python.install()


@pytest.mark.parametrize(
    ("signature", "expected"),
    [
        ("self", "()"),
        ("self, param", "('--a \"b c\" d',)"),
        ("self, param=''", "('--a \"b c\" d',)"),
        ("self, *args", "('the-test', '--a', 'b c', 'd')"),
        ("self, name, *args", "('the-test', '--a', 'b c', 'd')"),
        ("self, name, a, b, c", "('the-test', '--a', 'b c', 'd')"),
        ("self, *, key=1", "()"),
    ],
)
def test_setup_gets_what_it_asks_for(run: Callable[..., Ran], signature: str, expected: str):
    """setup() gets nothing, the parameter string, or the test's name and the words, by its signature."""
    names = [word.strip() for word in signature.split(",")[1:] if "key" not in word and word.strip() != "*"]
    given = "".join(f"{name.split('=')[0]}," for name in names)
    ran = run(
        f"""
class TestCase:
    def setup({signature}):
        robottestingframework.testReport(str(({given})))
    def run(self):
        pass
""",
        '--a "b c" d',
    )
    assert [("reports", expected)] == ran.reported("info")


def test_a_setup_of_the_wrong_shape_is_an_error_with_its_reason(run: Callable[..., Ran]):
    """Wrong arguments of setup() are an error with Python's message."""
    ran = run("class TestCase:\n  def setup(self, name, a): pass\n  def run(self): pass", "1 2 3")
    assert "takes 3 positional arguments but 5 were given" in ran.reported("error")[0][1]


@pytest.mark.parametrize(
    ("result", "outcome"), [("None", "passed"), ("True", "passed"), ("False", "error"), ("0", "error")]
)
def test_what_setup_returns_decides(run: Callable[..., Ran], result: str, outcome: str):
    """Only None and True of setup() count as success; otherwise run() is omitted, and tearDown() runs."""
    ran = run(f"""
class TestCase:
    def setup(self): return {result}
    def run(self): robottestingframework.testReport("run")
    def tearDown(self): robottestingframework.testReport("down")
""")
    assert outcome == ran.outcome
    assert (["run", "down"] if outcome == "passed" else ["down"]) == [detail for _, detail in ran.reported("info")]


@pytest.mark.parametrize(
    ("statement", "outcome", "title", "detail"),
    [
        ("robottestingframework.assertFail('no')", "failed", "asserts failure with exception", "no"),
        ("robottestingframework.assertError('no')", "error", "asserts error with exception", "no"),
        ("1 / 0", "error", "exception", "ZeroDivisionError: division by zero"),
        ("assert 1 == 2, 'unequal'", "failed", "asserts failure with exception", "unequal"),
        ("import sys; sys.exit(3)", "error", "exception", "the test raised SystemExit(3)"),
    ],
)
def test_exceptions_say_what_they_are(run: Callable[..., Ran], statement: str, outcome: str, title: str, detail: str):
    """An exception has its verdict, line and traceback in the script; tearDown() runs."""
    ran = run(f"""
class TestCase:
    def run(self):
        {statement}
    def tearDown(self):
        robottestingframework.testReport("down")
""")
    (problem,) = [message for message in ran.messages if message.severity in ("failure", "error")]
    assert (outcome, title, detail) == (ran.outcome, problem.title, problem.detail)
    if "exit" not in statement:
        assert (Path(problem.file).name, problem.line) == ("script.py", 4)
    if problem.traceback:
        assert statement in problem.traceback
        assert "legacy_python" not in problem.traceback
    assert ran.reported("info") == [("reports", "down")]


@pytest.mark.parametrize(
    ("script", "part"),
    [
        ("class TestCase:\n    pass", "must have a method run()"),
        ("class TestCase:\n    def __init__(self, x): pass\n    def run(self): pass", "missing 1 required positional"),
        ("class TestCase(:", "SyntaxError"),
        ("import no_such_module_at_all", "ModuleNotFoundError"),
        (
            "import robottestingframework as r\nclass TestCase:\n  def run(self): pass\nr.testReport('x')",
            "speaks for a running test",
        ),
    ],
)
def test_what_is_wrong_with_a_script_is_said_when_it_is_loaded(run: Callable[..., Ran], script: str, part: str):
    """An error while a script is loaded is an error of the test."""
    legacy_python.install()
    ran = run(script)
    assert ran.outcome == "error"
    assert part in ran.reported("error")[0][1]


def test_two_scripts_in_one_process_do_not_mix(run: Callable[..., Ran]):
    """The functions report for the running test, not for the last loaded one."""
    first = run(DATA / "classic.py")
    second = run("class TestCase:\n  def run(self): robottestingframework.testCheck(True, 'second')")
    assert first.outcome == "failed"
    assert second.reported("pass") == [("checks", "second")]
    assert second.outcome == "passed"


def test_added_parameters_stand_behind_the_string(run: Callable[..., Ran]):
    """``<parameter>`` and ``--set`` are options after the parameter string, each with its source."""
    ran = run(
        "class TestCase:\n  def setup(self, p): robottestingframework.testReport(p)\n  def run(self): pass",
        "--a 1",
        parameters=(("b", "2 3"), ("c", "4")),
        overrides=(("c", "5"), ("flag", "")),
        place="s.xml:3",
    )
    assert ran.reported("info") == [("reports", '--a 1 --b "2 3" --c 5 --flag')]
    (event,) = ran.of(ParametersResolved)
    assert [(row["name"], row["value"], row["source"]) for row in event.parameters] == [
        ("param", "--a 1", "param of s.xml:3"),
        ("b", "2 3", "<parameter> of s.xml:3"),
        ("c", "5", "--set"),
        ("flag", "", "--set"),
    ]


def test_only_run_repeats(run: Callable[..., Ran]):
    """Only run() is repeated, and each repetition is a sub-result."""
    ran = run(
        """
class TestCase:
    count = 0
    def setup(self): robottestingframework.testReport("setup")
    def run(self):
        self.count += 1
        robottestingframework.testCheck(self.count != 2, "not the second")
""",
        how={"repetition": 2},
    )
    assert [str(part.verdict) for part in ran.of(SubResultEnded)] == ["passed", "failed", "passed"]
    assert ran.reported("info").count(("reports", "setup")) == 1
