"""Executables as tests: arguments, environment, and the verdict from TAP, a JUnit file or the exit status."""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rtf.testing.events import Attached, Message
from rtf.testing.isolation.messages import Case, Finished, Job, Use
from rtf.testing.isolation.worker import run_test
from rtf.testing.languages.case_report import wanted_cases
from rtf.testing.languages.executable import ExecutableTest
from rtf.testing.languages.program import LineCutter
from rtf.testing.plugins import PluginRef
from rtf.testing.session import Session
from waiting import alive

if TYPE_CHECKING:
    from collections.abc import Callable

DATA = Path(__file__).parents[2] / "data" / "plugins"
MIB = 1024  # in kilobytes, as rusage has it


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

    def cases(self) -> list[tuple[str, str]]:
        """Return name and verdict of the cases."""
        return [(case.name, str(case.verdict)) for case in self.of(Case)]


@pytest.fixture
def write(tmp_path: Path):
    """Return a function that writes an executable file."""

    def of(text: str, name: str = "program", mode: int = 0o755) -> Path:
        path = tmp_path / name
        path.write_text(text)
        path.chmod(mode)
        return path

    return of


@pytest.fixture
def run(tmp_path: Path, write: Callable[..., Path]):
    """Return a function that runs a program, or the body of a shell script, as a worker does."""

    def carry_out(
        program: Path | str, mode: str = "", param: str = "", how: dict[str, Any] | None = None, **more: Any
    ) -> Ran:
        path = write(f"#!/bin/sh\n{program}\n") if isinstance(program, str) else program
        events: list[object] = []
        language = f"executable:{mode}" if mode else "executable"
        job = Job(
            kind="test",
            id="suite/test",
            name="test",
            plugin=PluginRef("test", path.name, str(path), language),
            folder=str(tmp_path / "files"),
            run_folder=str(tmp_path),
            use=Use(param=param, **more),
            **(how or {}),
        )
        session = Session(job.id, events.append, folder=Path(job.folder), run_folder=tmp_path)
        return Ran(run_test(job, session), events)

    return carry_out


# What a program gets -------------------------------------------------------------------------------------------------


def test_a_program_gets_the_words_of_the_parameter_string(run: Callable[..., Ran], tmp_path: Path):
    """The words of the parameter string, and parameters as options, are the arguments, without a shell."""
    ran = run(
        f'for word; do echo "[$word]"; done > {tmp_path}/words',
        param='--joints "(0 1 2)" $HOME *',
        parameters=(("speed", "1 2"),),
        overrides=(("flag", ""),),
    )
    assert ran.outcome == "passed"
    assert (tmp_path / "words").read_text().splitlines() == [
        "[--joints]",
        "[(0 1 2)]",
        "[$HOME]",
        "[*]",
        "[--speed]",
        "[1 2]",
        "[--flag]",
    ]


def test_a_program_gets_its_environment(run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The program has the worker's environment, with variables for its id, folder and parameters."""
    monkeypatch.setenv("MINE", "kept")
    run(
        f"env > {tmp_path}/env; readlink /proc/self/fd/0 > {tmp_path}/stdin",
        environment="--robotname icubSim",
        parameters=(("Max-Speed", "3"),),
    )
    environ = dict(line.partition("=")[::2] for line in (tmp_path / "env").read_text().splitlines())
    junit = str(tmp_path / "files" / "junit.xml")
    assert {
        "RTF_TEST": "suite/test",
        "RTF_ENVIRONMENT": "--robotname icubSim",
        "RTF_FOLDER": str(tmp_path / "files"),
        "RTF_JUNIT": junit,
        "RTF_PARAM_MAX_SPEED": "3",
        "GTEST_OUTPUT": f"xml:{junit}",
        "GTEST_COLOR": "no",
        "MINE": "kept",
    }.items() <= environ.items()
    assert (tmp_path / "stdin").read_text().strip() == "/dev/null"


@pytest.mark.parametrize("mode", ["tap", "exit"])
def test_a_program_that_is_read_otherwise_is_not_asked_for_a_file(run: Callable[..., Ran], tmp_path: Path, mode: str):
    """Variables for a JUnit file are set only where it may decide."""
    run(f"env > {tmp_path}/env", mode)
    assert "JUNIT" not in (tmp_path / "env").read_text()
    assert "GTEST" not in (tmp_path / "env").read_text()


def test_what_a_program_leaves_is_attached(run: Callable[..., Ran]):
    """Files that the program leaves in its folder are attached; links are not followed."""
    ran = run('cd "$RTF_FOLDER"; mkdir a; echo 1 > a/x.csv; echo 22 > y.txt; ln -s /etc/passwd link')
    assert [(event.name, event.path, event.media_type, event.size) for event in ran.of(Attached)] == [
        ("y.txt", "files/y.txt", "text/plain", 3),
        ("a/x.csv", "files/a/x.csv", "text/csv", 2),
    ]


def test_a_program_that_leaves_nothing_leaves_no_folder(run: Callable[..., Ran], tmp_path: Path):
    """An empty folder of a test is removed."""
    run("exit 0")
    assert not (tmp_path / "files").exists()


def test_output_is_the_tests_output(run: Callable[..., Ran], capfd: pytest.CaptureFixture[str]):
    """Both streams of the program are the output of the test."""
    run("echo 1..1; echo ok 1; echo noise; echo problem >&2")
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("1..1\nok 1\nnoise\n", "problem\n")


# The exit status -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["", "exit"])
@pytest.mark.parametrize(
    ("status", "outcome"), [(0, "passed"), (1, "failed"), (77, "skipped"), (99, "error"), (255, "failed")]
)
def test_the_exit_status_decides_as_with_automake(run: Callable[..., Ran], mode: str, status: int, outcome: str):
    """Without other results the exit status decides, as in automake."""
    ran = run(f"echo ok; exit {status}", mode)
    assert outcome == ran.outcome
    if status:
        assert f"program: exit status {status}" == ran.detail


@pytest.mark.parametrize("mode", ["", "exit", "tap", "junit"])
@pytest.mark.parametrize("name", ["SEGV", "ABRT", "KILL"])
def test_death_by_a_signal_is_an_error_with_its_name(run: Callable[..., Ran], mode: str, name: str):
    """Death by a signal is an error, whatever the program reported."""
    ran = run(f"{'echo 1..2; echo ok 1;' if mode == 'tap' else ''} kill -{name} $$", mode)
    assert ("error", f"program: killed by SIG{name}") == (ran.outcome, ran.detail)
    assert [("the program crashed", f"program: killed by SIG{name}")] == ran.reported("failure", "error")


def test_each_repetition_runs_the_program_anew(run: Callable[..., Ran], tmp_path: Path):
    """Each repetition runs the program with a JUnit file of its own."""
    ran = run(
        f"echo x >> {tmp_path}/runs; echo \"<testsuite><testcase name='a'/></testsuite>\" > $RTF_JUNIT",
        how={"repetition": 2},
    )
    assert len((tmp_path / "runs").read_text()) / 2 == 3
    assert ran.outcome == "passed"
    assert [event.name for event in ran.of(Attached)] == ["junit.xml", "junit~2.xml", "junit~3.xml"]


# TAP -----------------------------------------------------------------------------------------------------------------


def test_a_tap_stream_becomes_cases(run: Callable[..., Ran]):
    """Each point of TAP is a case, with the place of its YAML block; TODO and SKIP do not fail."""
    ran = run(f"cat {DATA}/nested.tap")
    assert ran.cases() == [
        ("power is on", "passed"),
        ("left arm/shoulder", "passed"),
        ("left arm/elbow", "failed"),
        ("left arm", "failed"),
        ("right arm", "skipped"),
        ("hand", "expected failure"),
    ]
    (elbow,) = next(case for case in ran.of(Case) if case.name == "left arm/elbow").messages
    assert (elbow.title, elbow.severity) == ("checks", "failure")
    assert (
        elbow.detail,
        elbow.file,
        elbow.line,
    ) == ("left arm/elbow\nmessage: stuck\nfile: 'arm.c'\nline: 42", "arm.c", 42)
    assert ("reports", "the arm is cold") in ran.reported("info")
    assert ran.outcome == "passed"


@pytest.mark.parametrize(
    ("lines", "outcome", "detail"),
    [
        ("echo 1..1; echo ok 1", "passed", ""),
        ("echo 1..1; echo not ok 1 - x; exit 1", "passed", ""),
        ("echo ok 1; echo 1..1; exit 3", "error", "program: exit status 3, although nothing failed"),
        ("echo 1..2; echo ok 1", "failed", "2 test points planned, 1 came; missing: 2"),
        ("echo 1..2; echo ok 1; exit 1", "failed", "2 test points planned, 1 came; missing: 2"),
        ("echo 1..2; echo ok 1; echo Bail out! on fire", "error", "on fire"),
        ("echo 1..2; echo ok 1; echo Bail out!; exit 9", "error", "the program gave no reason"),
        ("echo '1..0 # SKIP no robot'", "skipped", "no robot"),
        ("echo '1..0 # SKIP no robot'; exit 1", "error", "although nothing failed"),
        ("echo 1..2; echo 'ok # SKIP a'; echo 'ok # SKIP b'", "skipped", "a"),
        ("echo 1..1; echo 'not ok # TODO a'", "passed", ""),
        ("echo 1..1; printf 'ok 1'", "passed", ""),
    ],
)
def test_a_tap_stream_decides(run: Callable[..., Ran], lines: str, outcome: str, detail: str):
    """Plan, points, bail-out and exit status decide; a failed point explains the exit status."""
    for mode in ("", "tap"):
        ran = run(lines, mode)
        assert outcome == ran.outcome, ran.messages
        assert detail in ran.detail


def test_a_program_that_must_speak_tap_and_does_not_fails(run: Callable[..., Ran]):
    """A program without a plan fails where TAP is required."""
    assert run("echo hello", "tap").outcome == "failed"
    assert run("echo hello; echo not ok 1").outcome == "passed"  # by itself it is no TAP: the first line decides


def test_points_of_one_name_are_kept_apart(run: Callable[..., Ran]):
    """Points of one name are numbered, and those without a name get their number."""
    ran = run("echo 1..4; echo ok; echo ok - a; echo ok - a; echo ok - a")
    assert [name for name, _ in ran.cases()] == ["test 1", "a", "a (2)", "a (3)"]


def test_points_are_reported_while_the_program_runs(run: Callable[..., Ran], tmp_path: Path):
    """Points are reported while the program runs."""
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    path = tmp_path / "waits"
    path.write_text(f"#!/bin/sh\necho 1..2; echo ok 1; echo '# next'; cat {gate}; echo ok 2\n")
    path.chmod(0o755)
    seen = []

    def send(event: object) -> None:
        if isinstance(event, Case):
            seen.append(event.name)
            if len(seen) == 1:
                gate.write_text("")  # opens only when the program reads

    job = Job(
        kind="test",
        id="s/t",
        name="t",
        plugin=PluginRef("test", "waits", str(path), "executable"),
        folder=str(tmp_path / "files"),
        run_folder=str(tmp_path),
    )
    session = Session(job.id, send, folder=tmp_path / "files", run_folder=tmp_path)
    assert run_test(job, session).outcome == "passed"
    assert seen == ["test 1", "test 2"]


# JUnit ---------------------------------------------------------------------------------------------------------------


def test_the_file_of_googletest_becomes_cases(run: Callable[..., Ran]):
    """The JUnit file of GoogleTest is read into cases, and attached."""
    ran = run(DATA / "gtest_like.py", param="--fail")
    assert ran.cases() == [
        ("Joint.Moves", "passed"),
        ("Joint.Stops", "failed"),
        ("Joint.Brakes", "skipped"),
        ("Joint.DISABLED_Burns", "skipped"),
    ]
    moves, stops, *_ = ran.of(Case)
    (failure,) = stops.messages
    assert (failure.file, failure.line, failure.severity) == ("/src/joint_test.cc", 12, "failure")
    assert (moves.duration, moves.file, moves.line) == (0.25, "/src/joint_test.cc", 5)
    assert [event.name for event in ran.of(Attached)] == ["junit.xml"]
    assert ran.outcome == "passed"
    assert run(DATA / "gtest_like.py", "junit").outcome == "passed"


def junit(content: str, status: int = 0) -> str:
    """Return a script that writes this file."""
    return f"cat > $RTF_JUNIT <<'END'\n{content}\nEND\nexit {status}"


@pytest.mark.parametrize(
    ("script", "outcome", "detail"),
    [
        ("exit 0", "error", "did not write"),
        ("exit 1", "error", "ended with exit status 1 and did not write"),
        (junit("<testsuite/>"), "error", "without a test case"),
        (junit("<html/>"), "error", "no root of a JUnit file"),
        (junit('<testsuite><testcase name="a"/></testsuite>', 3), "error", "although nothing failed"),
        (junit('<testsuite><testcase name="a"><error message="e"/></testcase></testsuite>', 1), "passed", ""),
        (junit('<testsuite><testcase name="a"><failure/></testcase></testsuite>'), "passed", ""),
        (junit('<testsuite><testcase name="a"><skipped message="r"/></testcase></testsuite>'), "skipped", "r"),
        (junit('<testsuite><testcase name="a"><skipped/></testcase></testsuite>', 1), "error", "nothing failed"),
    ],
)
def test_a_junit_file_decides(run: Callable[..., Ran], script: str, outcome: str, detail: str):
    """The file and the exit status decide; a missing or broken file is an error."""
    ran = run(script, "junit")
    assert outcome == ran.outcome
    assert detail in ran.detail


@pytest.mark.parametrize(
    ("problem", "verdict", "detail"),
    [
        ('<error message="e"/>', "error", "e"),
        ("<failure/>", "failed", "a: failure"),
        ('<error message="e"/><failure message="f"/>', "failed", "e"),
        ('<skipped message="r"/>', "skipped", "r"),
        ("", "passed", ""),
    ],
)
def test_the_verdict_of_a_junit_case(run: Callable[..., Ran], problem: str, verdict: str, detail: str):
    """A failure outweighs an error in a case."""
    ran = run(junit(f'<testsuite><testcase name="a">{problem}</testcase></testsuite>'), "junit")
    assert [(case.verdict, case.detail) for case in ran.of(Case)] == [(verdict, detail)]


def test_no_time_that_a_program_writes_is_too_long(run: Callable[..., Ran]):
    """The duration of a case is limited, so that the journal has a valid number."""
    ran = run(junit('<testsuite><testcase name="a" time="1e300"/></testsuite>'), "junit")
    assert [case.duration for case in ran.of(Case)] == [1e9]


# Wanted cases --------------------------------------------------------------------------------------------------------


def test_a_program_gets_the_wanted_cases(run: Callable[..., Ran], tmp_path: Path):
    """Selected cases are passed by RTF_CASES, and by GTEST_FILTER with special characters as ``?``."""
    run(f"env > {tmp_path}/env", how={"cases": ("Joint.Stops", "a-b:c (2)")})
    text = (tmp_path / "env").read_text()
    assert "RTF_CASES=Joint.Stops\na-b:c (2)\na-b:c\n" in text
    assert "GTEST_FILTER=Joint.Stops:a?b?c (2):a?b?c\n" in text
    run(f"env > {tmp_path}/env")
    assert "RTF_CASES" not in (tmp_path / "env").read_text()


@pytest.mark.parametrize("name", ["a\nb", "a\0b", "\ufffd", "x" * 500])
def test_names_that_no_variable_can_hold_are_not_passed_on(name: str):
    """Names that no variable can hold are not passed; the program then runs whole."""
    assert wanted_cases(["good", name]) == {}


def test_too_many_names_are_not_passed_on():
    """More names than Linux allows in a variable are not passed."""
    assert wanted_cases([f"case number {number}" for number in range(10_000)]) == {}
    assert wanted_cases([f"case number {number}" for number in range(1000)])


# What cannot be started ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "mode", "part"),
    [
        ("#!/bin/sh\n", 0o644, "is not executable; chmod +x"),
        ("#!/no/such/interpreter -x\n", 0o755, "the interpreter /no/such/interpreter, which does not exist"),
        ("#!/bin/sh\r\nexit 0\r\n", 0o755, "dos2unix"),
        ("#!/etc/passwd\n", 0o755, "the interpreter /etc/passwd, which cannot be run"),
        ("just text\n", 0o755, "nor has it a first line such as #!/bin/sh"),
    ],
)
def test_a_program_that_cannot_be_started_is_an_error_with_its_hint(
    run: Callable[..., Ran], write: Callable[..., Path], text: str, mode: int, part: str
):
    """A program that cannot be started is an error with the reason and a hint."""
    if mode == 0o755 or os.geteuid() != 0 or not os.access(write(text, mode=mode), os.X_OK):
        ran = run(write(text, mode=mode))
        ((title, detail),) = ran.reported("error")
        assert title == "the program cannot be started"
        assert part in detail
        assert "program" in detail


def test_a_program_that_is_gone_is_an_error(run: Callable[..., Ran], tmp_path: Path):
    """A program that was removed after the suite was read is an error."""
    ran = run(tmp_path / "gone")
    assert ("the program cannot be started", f"{tmp_path}/gone: No such file or directory") in ran.reported("error")


def test_an_unknown_way_of_reading_is_refused():
    """ExecutableTest refuses an unknown format."""
    with pytest.raises(ValueError, match="not as 'xml'"):
        ExecutableTest(Path("x"), "xml")


def test_a_binary_that_crashes_in_the_middle_of_its_stream(run: Callable[..., Ran], tmp_path: Path):
    """A binary that crashes is an error with the signal; its flushed points count."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    source = tmp_path / "crash.c"
    source.write_text(
        "#include <signal.h>\n#include <stdio.h>\n"
        'int main(void) { puts("1..3\\nok 1 - a"); fflush(stdout); raise(SIGFPE); }\n'
    )
    subprocess.run([compiler, "-o", tmp_path / "crash", source], check=True)
    ran = run(tmp_path / "crash")
    assert ran.cases() == [("a", "passed")]
    assert (ran.outcome, ran.detail) == ("error", "crash: killed by SIGFPE")


# Processes -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def stoppable(tmp_path: Path):
    """Return a function that starts a test in a process, and returns the process."""
    started = []

    def start(program: Path, mode: str = "", **more: object) -> subprocess.Popen:
        language = f"executable:{mode}" if mode else "executable"
        command = [sys.executable, DATA / "stoppable.py", language, program, tmp_path / "files", tmp_path / "events"]
        process = subprocess.Popen(command, **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | more)
        started.append(process)
        return process

    yield start
    for process in started:
        with process:
            process.kill()


def test_a_stop_ends_the_program_first(stoppable: Callable[..., subprocess.Popen[bytes]], write: Callable[..., Path]):
    """A stop sends the program SIGTERM, and its last output is captured."""
    program = write(
        "#!/usr/bin/env python3\nimport os, signal, sys\n"
        "signal.signal(signal.SIGTERM, lambda *_: sys.exit(print('bye')))\n"
        "print(os.getpid(), flush=True)\nsignal.pause()\n"
    )
    process = stoppable(program)
    pid = int(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=30)
    assert out == b"bye\n"
    assert errors.startswith(b"passed stopped"), errors
    assert not alive(pid)


def test_a_program_that_will_not_end_is_killed(
    stoppable: Callable[..., subprocess.Popen[bytes]], write: Callable[..., Path]
):
    """A program that ignores SIGTERM is killed after two seconds."""
    program = write(
        "#!/usr/bin/env python3\nimport os, signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "print(os.getpid(), flush=True)\nsignal.pause()\n"
    )
    process = stoppable(program)
    pid = int(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert not alive(pid)


def test_a_program_is_in_the_workers_group_and_dies_with_it(
    stoppable: Callable[..., subprocess.Popen[bytes]], write: Callable[..., Path]
):
    """The program is in the worker's process group, and is killed with the worker."""
    program = write(
        "#!/usr/bin/env python3\nimport os, signal\nprint(os.getpid(), os.getpgrp(), flush=True)\nsignal.pause()\n"
    )
    process = stoppable(program, process_group=0)
    pid, group = map(int, process.stdout.readline().split())
    assert process.pid == group
    watch = os.pidfd_open(pid)
    process.kill()
    assert select.select([watch], [], [], 30)[0]
    os.close(watch)


def test_a_grandchild_that_holds_the_output_is_not_waited_for(run: Callable[..., Ran], tmp_path: Path):
    """The test ends with the program, also if a child of it holds the output."""
    os.mkfifo(tmp_path / "gate")
    ran = run(f"read x < {tmp_path}/gate & echo $! > {tmp_path}/pid; echo done")
    pid = int((tmp_path / "pid").read_text())
    try:
        assert ran.outcome == "passed"
        assert alive(pid)
    finally:
        os.kill(pid, signal.SIGKILL)


def test_a_program_that_closes_its_output_is_waited_for(run: Callable[..., Ran]):
    """A program that closes its output is waited for, and its exit status decides."""
    assert run("exec >&-; exec 2>&-; exit 5").outcome == "failed"


@pytest.mark.parametrize(
    ("mode", "script"),
    [
        ("", "head -c 268435456 /dev/zero"),
        ("tap", "head -c 268435456 /dev/zero"),
        ("tap", "echo 1..1; echo ok; yes " + "x" * 1000 + " | head -c 134217728"),
        ("", "echo 1..1; echo not ok; echo '  ---'; yes '  aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa' | head -c 33554432"),
    ],
)
def test_a_flood_of_output_does_not_grow_memory(
    stoppable: Callable[..., subprocess.Popen[bytes]], write: Callable[..., Path], mode: str, script: str
):
    """Output that is more than the memory a worker may have does not grow its memory."""
    process = stoppable(write(f"#!/bin/sh\n{script}\n"), mode, stdout=subprocess.DEVNULL)
    _, errors = process.communicate(timeout=100)
    assert int(errors.split()[-1]) < 100 * MIB
    assert all(len(json.loads(line)) for line in (Path(process.args[-1])).read_bytes().splitlines())


def test_lines_are_cut_out_of_any_pieces():
    """Lines are the same for any pieces; long ones are cut, and invalid UTF-8 is replaced."""
    for size in (1, 2, 3, 100):
        cutter = LineCutter(limit=4)
        data = b"ab\n\nabcdefgh\n\xff\xc3\xa9\nlast"
        pieces = [data[at : at + size] for at in range(0, len(data), size)]
        lines = [line for piece in pieces for line in cutter.feed(piece)]
        assert [*lines, *cutter.finish()] == ["ab", "", "abcd", "�é", "last"]
