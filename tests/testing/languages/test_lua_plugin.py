"""Tests in Lua, with the semantics of the C++ framework."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("lupa", reason="Lua tests need lupa")

from rtf.testing.events import Measured, Message, Progressed, TestRenamed
from rtf.testing.isolation.messages import Finished, Job, Use
from rtf.testing.isolation.worker import run_test
from rtf.testing.languages import lua_plugin
from rtf.testing.plugins import PluginError, PluginRef
from rtf.testing.session import Session

if TYPE_CHECKING:
    from collections.abc import Callable

DATA = Path(__file__).parents[2] / "data" / "plugins"


class Ran:
    """The result of a test: conclusion and events."""

    def __init__(self, conclusion: Finished, events: list[object]) -> None:
        self.outcome = str(conclusion.outcome)
        self.detail = conclusion.detail
        self.events = events
        self.messages = self.of(Message)

    def of(self, kind: type) -> list:
        """Return the events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def reported(self, *severities: str) -> list[tuple[str, str]]:
        """Return title and detail of the messages with these severities."""
        return [(m.title, m.detail) for m in self.messages if m.severity in severities]


@pytest.fixture
def run(tmp_path: Path):
    """Return a function that runs a script as a worker does."""

    def carry_out(script: Path | str | bytes, param: str = "", **more: Any) -> Ran:
        if isinstance(script, Path):
            path = script
        else:
            path = tmp_path / "script.lua"
            path.write_bytes(script.encode() if isinstance(script, str) else script)
        events: list[object] = []
        job = Job(
            kind="test",
            id="suite/test",
            name="test",
            plugin=PluginRef("test", path.name, str(path), "lua"),
            folder=str(tmp_path / "files"),
            run_folder=str(tmp_path),
            use=Use(param=param, **more),
        )
        session = Session(job.id, events.append, folder=Path(job.folder), run_folder=tmp_path)
        return Ran(run_test(job, session), events)

    return carry_out


def body(statements: str) -> str:
    """Return a script with these statements in ``run``, from line 2 on, and a report in ``tearDown``."""
    return (
        f"function TestCase.run()\n{statements}\nend\n"
        "function TestCase.tearDown() robottestingframework.testReport('down') end"
    )


def test_a_script_of_the_cpp_framework_runs_unchanged(run: Callable[..., Ran]):
    """Every function works, with the C++ framework's titles, and lines of the script."""
    ran = run(DATA / "classic.lua", "--joints 3 'x'", environment="--robotname icubSim")
    assert ran.reported("failure") == [
        ("checks", "wrong sums"),
        ("checking (false)", "told"),
        ("checking (a > b)", "always told"),
    ]
    assert ran.reported("pass") == [("checks", "sums")]
    assert [detail for _, detail in ran.reported("info")] == [
        "param is --joints 3 'x'",
        "environment is --robotname icubSim",
        "torn down",
    ]
    assert [event.name for event in ran.of(TestRenamed)] == ["classic"]
    assert {str(DATA / "classic.lua")} == {message.file for message in ran.messages}
    assert next(message.line for message in ran.messages if message.detail == "sums") == 11
    assert ran.outcome == "failed"


@pytest.mark.parametrize(
    ("result", "good"),
    [("true", True), ("1", True), ("0", True), ("''", True), ("false", False), ("nil", False), ("", False)],
)
def test_lua_truth_decides_over_setup(run: Callable[..., Ran], result: str, good: bool):
    """The result of setup counts by Lua's truth: nil and false fail; tearDown runs anyway."""
    ran = run(f"function TestCase.setup() return {result} end\n{body('')}")
    assert ("passed" if good else "error") == ran.outcome
    assert ran.reported("info") == [("reports", "down")]
    assert ([] if good else [("setup() failed!", "TestCase.setup() did not return true")]) == ran.reported("error")


@pytest.mark.parametrize(
    ("condition", "holds"), [("nil", False), ("false", False), ("0", True), ("'x'", True), ("{}", True)]
)
def test_conditions_that_are_no_booleans_follow_lua_truth(run: Callable[..., Ran], condition: str, holds: bool):
    """Conditions count by Lua's truth; the C++ framework ignored such checks."""
    ran = run(
        body(f"robottestingframework.testCheck({condition}, 'a')\nrobottestingframework.testFailIf({condition}, 'b')")
    )
    assert ("passed" if holds else "failed") == ran.outcome
    failures = [] if holds else [("checks", "a"), (f"checking ({condition})", "b")]
    assert failures == ran.reported("failure")


def test_messages_are_no_format_strings(run: Callable[..., Ran]):
    """Percent signs and invalid UTF-8 in messages do no harm."""
    ran = run(body("robottestingframework.testReport('%d %s %n \\xff \\u{e9}')\nerror('100%d')"))
    assert ("reports", "%d %s %n � é") in ran.reported("info")
    assert ran.reported("error") == [("exception", "LuaError: script.lua:3: 100%d")]


@pytest.mark.parametrize(
    ("statement", "outcome", "title", "detail"),
    [
        ("robottestingframework.assertFail('no')", "failed", "asserts failure with exception", "no"),
        ("robottestingframework.assertError('no')", "error", "asserts error with exception", "no"),
        ("local x = nil; x.y = 1", "error", "exception", "attempt to index a nil value"),
        ("error({})", "error", "exception", "the error value is a table"),
        ("error(nil)", "error", "exception", "nil"),
        ("error(io.stdout)", "error", "exception", "file"),
        ("os.exit(3)", "error", "exception", "the script called os.exit(3)"),
        ("robottestingframework.skip('no robot')", "skipped", "skipped", "no robot"),
        ("robottestingframework.measure('a', 1, 'parsec')", "error", "exception", "'parsec'"),
        ("robottestingframework.measure('a', {})", "error", "exception", "TypeError"),
        ("robottestingframework.measure('a', 1e9, '', 0, 0/0)", "error", "exception", "high is nan"),
        ("string.rep('x', -1)()", "error", "exception", "attempt to call a string value"),
    ],
)
def test_what_ends_a_test_says_what_it_is_and_where(
    run: Callable[..., Ran], statement: str, outcome: str, title: str, detail: str
):
    """Each way to end a test has its verdict, title and line; tearDown runs."""
    ran = run(body(statement))
    problem = next(m for m in ran.messages if m.title == title)
    assert detail in problem.detail
    assert (outcome, "script.lua", 2) == (ran.outcome, Path(problem.file).name, problem.line)
    assert ("reports", "down") in ran.reported("info")


def test_an_error_carries_the_traceback_of_lua(run: Callable[..., Ran]):
    """An error has Lua's traceback, and the line of the script."""
    ran = run("local function inner()\n  error('deep')\nend\n" + body("inner()\nreturn 1"))
    (problem,) = [m for m in ran.messages if m.severity == "error"]
    assert "stack traceback:" in problem.traceback
    assert "script.lua:5: in function" in problem.traceback
    assert "error('deep')" in problem.traceback
    assert (Path(problem.file).name, problem.line) == ("script.lua", 2)
    assert "lua_plugin.py" not in problem.traceback
    assert "[rtf]" not in problem.traceback


@pytest.mark.parametrize("name", ["setup", "run", "tearDown"])
def test_an_error_anywhere_is_an_error_of_the_test(run: Callable[..., Ran], name: str):
    """An error in setup, run or tearDown is an error of the test."""
    ran = run(f"TestCase.run = function() end\nTestCase.{name} = function() error('x') end")
    assert ran.reported("error") == [("exception", "LuaError: script.lua:2: x")]
    assert ran.outcome == "error"


def test_pcall_catches_an_assertion_as_it_always_did(run: Callable[..., Ran]):
    """An assertion can be caught by pcall, and stays an assertion when it is raised again."""
    caught = run(
        body(
            "local ok, e = pcall(robottestingframework.assertFail, 'no')\n"
            "robottestingframework.testReport(tostring(ok) .. tostring(e))"
        )
    )
    assert ("reports", "falseno") in caught.reported("info")
    assert caught.outcome == "passed"
    passed_on = run(body("local ok, e = pcall(robottestingframework.assertFail, 'no')\nerror(e)"))
    assert passed_on.reported("failure") == [("asserts failure with exception", "no")]
    assert passed_on.outcome == "failed"


def test_an_assertion_crosses_coroutines(run: Callable[..., Ran]):
    """An assertion in a coroutine ends the test."""
    ran = run(body("coroutine.wrap(function() robottestingframework.assertFail('no') end)()"))
    assert ran.outcome == "failed"


@pytest.mark.parametrize(
    ("script", "part", "line"),
    [
        ("TestCase.run = function(\n  end end", "Cannot load lua script", 2),
        ("\n\nerror('top')", "Cannot run lua script", 3),
        ("-- nothing", "must implement 'TestCase.run()' function.", None),
        ("TestCase = 5", "must implement 'TestCase.run()' function.", None),
        ("robottestingframework.testReport('x')", "speaks for a running test", 1),
        ("\x1bLua", "Cannot load lua script", 1),
    ],
)
def test_what_is_wrong_with_a_script_is_said_when_it_is_loaded(
    run: Callable[..., Ran], script: str, part: str, line: int | None
):
    """An error while a script is loaded is an error of the test, with its line."""
    ran = run(script)
    (problem,) = [m for m in ran.messages if m.severity == "error"]
    assert part in problem.detail
    assert line in (None, problem.line)
    assert ran.outcome == "error"


def test_a_first_line_for_the_shell_is_passed_over(run: Callable[..., Ran]):
    """A shebang line and a byte order mark are ignored."""
    assert run("#!/usr/bin/lua\n" + body("")).outcome == "passed"
    assert run("\ufeff" + body("")).outcome == "passed"


def test_measurements_progress_and_skips_are_ours(run: Callable[..., Ran]):
    """Measurements and progress are available beyond the C++ framework."""
    ran = run(
        body("robottestingframework.progress(0.5, 'half')\nrobottestingframework.measure('angle', 12, 'deg', 0, 10)")
    )
    (measured,) = ran.of(Measured)
    assert (
        measured.name,
        measured.value,
        measured.unit,
        measured.low,
        measured.high,
        Path(measured.file).name,
        measured.line,
    ) == ("angle", 12.0, "deg", 0, 10, "script.lua", 3)
    assert [(event.fraction, event.text) for event in ran.of(Progressed)] == [(0.5, "half")]
    assert ran.outcome == "failed"
    assert run(body("robottestingframework.measure('angle', 12)")).outcome == "measured"


def test_python_is_out_of_reach(run: Callable[..., Ran]):
    """A script can reach neither Python's modules nor attributes of Python's objects."""
    ran = run(
        body("""
        assert(python == nil and not pcall(require, "python") and package.loaded.python == nil)
        local ok, e = pcall(robottestingframework.assertFail, 'no')
        for _, name in ipairs({"__class__", "__traceback__", "detail", "args"}) do
            assert(not pcall(function() return e[name] end), name)
            assert(not pcall(function() e[name] = 1 end), name)
        end
        """)
    )
    assert ran.outcome == "passed", ran.detail


def test_the_standard_libraries_are_open_and_neighbours_can_be_required(run: Callable[..., Ran], tmp_path: Path):
    """A script has Lua's libraries, and modules beside it."""
    (tmp_path / "neighbour.lua").write_text("return {answer = 42}")
    assert run(body("assert(require('neighbour').answer == 42 and io and os and debug and string)")).outcome == "passed"


def test_each_test_has_an_interpreter_of_its_own(run: Callable[..., Ran]):
    """Globals of one test do not exist in the next."""
    run("leak = 1\n" + body(""))
    assert run(body("assert(leak == nil)")).outcome == "passed"


def test_output_of_print_is_not_lost(run: Callable[..., Ran], capfd: pytest.CaptureFixture[str]):
    """Output of print and io.write is captured."""
    run(body("print('printed')\nio.write('written')"))
    assert capfd.readouterr().out == "printed\nwritten"


def test_without_lupa_the_hint_is_said(run: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch):
    """Without lupa the error names the command that installs it."""
    monkeypatch.setitem(sys.modules, "lupa", None)
    ran = run(DATA / "classic.lua")
    assert "pip install 'rtf[lua]'" in ran.reported("error")[0][1]
    with pytest.raises(PluginError):
        lua_plugin.LuaTest(DATA / "classic.lua")


@pytest.mark.parametrize(
    "loop",
    [
        "while true do end",
        "while true do pcall(function() while true do end end) end",
        "coroutine.wrap(function() while true do end end)()",
        "while true do coroutine.resume(coroutine.create(function() while true do end end)) end",
        "while true do robottestingframework.testReport('busy') end",
        "while true do xpcall(function() while true do end end, function(e) return e end) end",
        "repeat local ok = pcall(function() while true do end end) until not ok",
    ],
)
def test_a_stop_comes_through_a_loop_that_never_ends(tmp_path: Path, loop: str):
    """A stop ends an endless loop, also if the script catches errors; tearDown runs."""
    script = tmp_path / "loop.lua"
    script.write_text(body(f"print('ready')\n{loop}"))
    command = [sys.executable, DATA / "stoppable.py", "lua", script, tmp_path / "files", tmp_path / "events"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=30)
        finally:
            process.kill()
    assert errors.rsplit(" ", 1)[0] == "passed stopped", errors
    events = (tmp_path / "events").read_text()
    assert '"down"' in events
    assert '"error"' not in events
