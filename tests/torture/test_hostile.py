"""Hostile tests: each has a defined verdict, keeps its output, and leaves neither a process nor a change behind.

Each case runs in a suite of its own, before a peaceful test that looks for anything that it could have changed.
"""

from __future__ import annotations

import os
import shutil
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from harness import Outcome, run_suite
from rtf.testing.events import Message, OutputCaptured, PhaseStarted, StackDumped, TestEnded
from rtf.testing.isolation import attempt, child, transcript
from rtf.testing.suite.model import Timeouts
from rtf.testing.verdict import Phase, Severity, Verdict

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [pytest.mark.torture, pytest.mark.usefixtures("no_process_left")]

GRACE = 0.3

PRELUDE = """
import ctypes, json, os, signal, struct, subprocess, sys, threading, time
from pathlib import Path
from rtf.testing import TestCase, events
from rtf.testing.isolation.messages import Finished, pack

def hang_in(library):
    mutex = ctypes.create_string_buffer(128)
    library.pthread_mutex_lock(mutex)
    library.pthread_mutex_lock(mutex)  # unlike a sleep, no signal ends this wait

def ignore_all_signals():
    for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
        try:
            signal.signal(number, signal.SIG_IGN)
        except (OSError, ValueError):
            pass
"""

PEACEFUL = (
    PRELUDE
    + '''
class Peaceful(TestCase):
    """Sees whether something is left of the test before it."""

    def run(self):
        import builtins
        from rtf.testing import events, session
        from rtf.testing.isolation import worker
        self.assert_equal(os.environ.get("HOSTILE"), None, "the environment")
        mask = os.umask(0o22)
        self.assert_equal(mask, MASK, "the umask")
        self.assert_equal(os.getcwd(), FOLDER, "the working directory")
        self.assert_equal(signal.pthread_sigmask(signal.SIG_BLOCK, []), set(), "the signal mask")
        self.assert_equal(signal.getsignal(signal.SIGTERM), signal.SIG_DFL, "the handler of SIGTERM")
        self.assert_equal(threading.active_count(), 1, "the number of threads")
        self.assert_equal(sorted(os.listdir("/proc/self/fd"))[:5], ["0", "1", "2", "3", "4"], "the descriptors")
        self.assert_true(not hasattr(TestCase, "hostile"), "the framework's classes")
        self.assert_true(not hasattr(builtins, "hostile"), "Python's own names")
        self.assert_true(events.to_line.__module__ == "rtf.testing.events", "the framework's functions")
        self.assert_equal(sys.getrecursionlimit(), 1000, "the recursion limit")
        print("peaceful words")
'''
)


@dataclass(frozen=True)
class Case:
    """A hostile test, and the verdict and texts that are expected of it.

    ``run`` is the body of ``run()``; ``code`` replaces the class body where more is needed. ``stack`` must occur in the
    dumped stacks. ``words`` says whether its first words must be in the journal.
    """

    run: str = "pass"
    verdict: Verdict = Verdict.ERROR
    reason: str = ""
    detail: str = ""
    code: str = ""
    stack: str = ""
    words: bool = True
    memory: int = 0
    limit: float = 0.3
    signal: str = ""
    exit_status: int | None = None

    def text(self) -> str:
        """Return the plug-in's file."""
        body = textwrap.dedent(self.code) or f"def run(self):\n{textwrap.indent(textwrap.dedent(self.run), '    ')}"
        body = body.replace("def run(self):\n", 'def run(self):\n    print("last words", flush=True)\n', 1)
        return f"{PRELUDE}\nclass Hostile(TestCase):\n{textwrap.indent(body, '    ')}\n"


HANG = {"reason": "timeout", "detail": "run() did not end within 0.3 s"}
KILLED = {"reason": "timeout", "detail": "did not react to being stopped and was killed"}


def crash(name: str) -> dict[str, str]:
    """Return the expectations of a test that a signal ended."""
    return {"reason": "crash", "detail": f"killed by {name} in run()", "signal": name}


CASES = {
    # It does not end.
    "hangs in Python": Case("while True:\n    time.sleep(60)", **HANG, stack="in run"),
    "spins in Python": Case("while True:\n    pass", **HANG, stack="in run"),
    "swallows every exception": Case(
        "while True:\n    try:\n        time.sleep(60)\n    except BaseException:\n        pass",
        **KILLED,
        stack="in run",
    ),
    "hangs in C with the interpreter's lock": Case("hang_in(ctypes.PyDLL(None))", **KILLED, stack="hang_in"),
    "hangs in C without the interpreter's lock": Case("hang_in(ctypes.CDLL(None))", **KILLED, stack="hang_in"),
    "sleeps in C": Case("ctypes.CDLL(None).sleep(60)", **HANG, stack="in run"),
    "waits for a thread that never ends": Case(
        "thread = threading.Thread(target=lambda: time.sleep(60))\nthread.start()\nthread.join()",
        **HANG,
        stack="in run",
    ),
    "waits for a process that never ends": Case('subprocess.run(["sleep", "60"])', **HANG, stack="subprocess"),
    "stops itself": Case(
        "os.kill(os.getpid(), signal.SIGSTOP)\ntime.sleep(60)",
        reason="timeout",
        detail="the process had been stopped by a signal",
        stack="in run",
    ),
    "ignores all signals": Case("ignore_all_signals()\nwhile True:\n    time.sleep(60)", **KILLED),
    "blocks all signals": Case(
        "signal.pthread_sigmask(signal.SIG_BLOCK, set(signal.Signals))\ntime.sleep(60)",
        **KILLED,
        stack="did not answer the request for its stacks; the kernel says",
    ),
    # It closes or abuses what it was given.
    "closes its channel and goes on": Case(
        "os.close(3)\ntime.sleep(60)", reason="channel", detail="closed the channel to its runner"
    ),
    "closes its channel and ends": Case("os.close(3)", reason="channel", detail="closed the channel to its runner"),
    "closes all descriptors": Case("os.closerange(0, 64)\ntime.sleep(60)", reason="channel"),
    "closes its output": Case("os.close(1)\nos.close(2)", Verdict.PASSED),
    "writes garbage on its channel": Case(
        "os.write(3, bytes(range(255, -1, -1)) * 16)", reason="channel", detail="wrote what is no message"
    ),
    "writes messages that are no events": Case(
        r"""
        named = b"\x81\xa5event"
        for data in (b"", b"\xc0", b"garbage", b"\x80", named + b"\x03", named + b"\xa7message", b"\x91" * 100000):
            os.write(3, struct.pack("=I", len(data)) + data)
        """,
        reason="error",
        detail="said something unintelligible",
    ),
    "speaks for another test": Case(
        "os.write(3, pack(events.Message(severity='failure', title='x', test='s/peaceful')))",
        reason="error",
        detail="may not say message of 's/peaceful'",
    ),
    "speaks for the runner": Case(
        "os.write(3, pack(events.RunEnded(verdict='passed', exit_code=0, duration=1.0)))",
        reason="error",
        detail="may not say run_ended",
    ),
    "starts its own time again and again": Case(
        """
        while True:
            os.write(3, pack(events.PhaseStarted(test="s/hostile", phase="run")))
            time.sleep(0.01)
        """,
        **HANG,
        stack="in run",
    ),
    "writes an endless message on its channel": Case(
        "while True:\n    os.write(3, b'x' * 1000000)", reason="channel", detail="wrote what is no message"
    ),
    "breaks off in the middle of a message": Case(
        "os.write(3, pack(events.Progressed(test='s/hostile', fraction=0.5))[:-1])\nos._exit(0)",
        reason="exit",
        detail="exit status 0 in run()",
    ),
    # It ends where it should not.
    "exits with 0": Case("os._exit(0)", reason="exit", detail="exit status 0 in run(), before", exit_status=0),
    "exits with 1": Case("os._exit(1)", reason="exit", detail="exit status 1 in run(), before", exit_status=1),
    "claims success and exits with 3": Case(
        "os.write(3, pack(Finished('passed')))\nos._exit(3)",
        reason="crash",
        detail="ended badly: exit status 3",
    ),
    "calls sys.exit": Case("sys.exit(0)", reason="error", detail="SystemExit(0)"),
    "raises KeyboardInterrupt": Case("raise KeyboardInterrupt", reason="error", detail="KeyboardInterrupt()"),
    "raises a bare BaseException": Case(
        "class Odd(BaseException):\n    pass\nraise Odd('odd')", reason="error", detail="Odd(odd)"
    ),
    "raises an exception that cannot be printed": Case(
        "class Odd(Exception):\n    def __str__(self):\n        raise ValueError('no text')\nraise Odd", reason="error"
    ),
    "raises GeneratorExit": Case("raise GeneratorExit", reason="error", detail="GeneratorExit()"),
    "segfaults": Case("ctypes.string_at(0)", **crash("SIGSEGV"), stack="string_at"),
    "aborts": Case("os.abort()", **crash("SIGABRT"), stack="in run"),
    "divides by zero in C": Case("os.kill(os.getpid(), signal.SIGFPE)", **crash("SIGFPE"), stack="in run"),
    "has a bus error": Case(
        """
        import mmap
        path = self.folder / "map"
        path.write_bytes(b"x" * 4096)
        with open(path, "r+b") as stream:
            view = mmap.mmap(stream.fileno(), 4096)
            stream.truncate(0)
            view[0]
        """,
        **crash("SIGBUS"),
        stack="in run",
    ),
    "kills itself": Case("os.kill(os.getpid(), signal.SIGKILL)", **crash("SIGKILL")),
    "kills its process group": Case("os.killpg(0, signal.SIGKILL)", **crash("SIGKILL")),
    "calls itself for ever": Case(
        "def again():\n    again()\nagain()", reason="error", detail="RecursionError: maximum recursion depth"
    ),
    "calls itself for ever in C": Case(
        "sys.setrecursionlimit(10**9)\ndef again(x):\n    sorted([x], key=again)\nagain(1)",
        reason="crash",
        signal="SIGSEGV",
    ),
    "exhausts memory": Case(
        "hoard = []\nwhile True:\n    hoard.append(bytearray(1 << 24))",
        reason="error",
        detail="MemoryError",
        memory=512 << 20,
        limit=10,
    ),
    # It leaves something behind.
    "leaves a child": Case('subprocess.Popen(["sleep", "60"])', Verdict.PASSED),
    "leaves a daemon": Case(
        """
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                time.sleep(60)
            os._exit(0)
        os.wait()
        """,
        Verdict.PASSED,
    ),
    "leaves a daemon that knows nothing of us": Case(
        'subprocess.Popen(["env", "-i", shutil.which("sleep"), "60"], start_new_session=True)'.replace(
            'shutil.which("sleep")', repr(shutil.which("sleep"))
        ),
        Verdict.PASSED,
    ),
    "leaves a child that ignores signals": Case(
        """
        if os.fork() == 0:
            ignore_all_signals()
            os.setpgid(0, 0)
            while True:
                time.sleep(60)
        """,
        Verdict.PASSED,
    ),
    "leaves a child that is stopped": Case(
        """
        if os.fork() == 0:
            os.kill(os.getpid(), signal.SIGSTOP)
            os._exit(0)
        os.waitpid(-1, os.WUNTRACED)
        """,
        Verdict.PASSED,
    ),
    "leaves a child that holds its channel": Case(
        "os.set_inheritable(3, True)\nsubprocess.Popen(['sleep', '60'], close_fds=False)", Verdict.PASSED
    ),
    "leaves a family": Case(
        """
        for _ in range(3):
            if os.fork() == 0:
                os.setsid()
                while os.fork() == 0:
                    if len(os.listdir("/proc/self/task")) and os.getpid() % 5 == 0:
                        break
                time.sleep(60)
                os._exit(0)
        """,
        Verdict.PASSED,
    ),
    "leaves a thread": Case("threading.Thread(target=time.sleep, args=(60,)).start()", Verdict.PASSED),
    "crashes with children": Case(
        'subprocess.Popen(["sleep", "60"], start_new_session=True)\nos.abort()', **crash("SIGABRT"), stack="in run"
    ),
    "hangs with children": Case(
        'subprocess.Popen(["sleep", "60"], start_new_session=True)\nignore_all_signals()\ntime.sleep(60)', **KILLED
    ),
    "comes back twice from a fork": Case("if os.fork():\n    os.wait()", Verdict.PASSED),
    # It changes what others use.
    "deletes its working directory": Case(
        "path = self.folder / 'gone'\npath.mkdir()\nos.chdir(path)\npath.rmdir()", Verdict.PASSED
    ),
    "changes directory, umask, environment": Case(
        "os.chdir('/')\nos.umask(0)\nos.environ['HOSTILE'] = '1'\nsys.setrecursionlimit(500)", Verdict.PASSED
    ),
    "patches the framework": Case(
        """
        import builtins
        from rtf.testing import events, session
        from rtf.testing.isolation import worker
        TestCase.hostile = builtins.hostile = True
        events.to_line = lambda event: b""
        session.Session.emit = lambda *_: None
        """,
        Verdict.PASSED,
    ),
    "takes the exit away": Case("os._exit = lambda status: None", reason="crash", detail="ended badly"),
    "changes its handlers": Case(
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\nsignal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])",
        Verdict.PASSED,
    ),
    # It says strange things.
    "says strange words": Case(
        r"""
        for text in ("\ud800", "\x00\x01\x1b[31m\x7f", "\ufffe\uffff", "]]>", "\u202e", "x" * 3000000, ""):
            self.report(text)
        self.measure("odd\x00name", float("nan"), "deg", low=float("-inf"), high=float("inf"))
        self.rename("\ud800 \x1b]0;title\x07")
        os.write(1, bytes(range(256)))
        """,
        Verdict.FAILED,
        reason="failure",
    ),
}

PHASES = {
    "raises in setup": Case(
        code="def setup(self):\n    raise OSError('setup')\ndef teardown(self):\n    print('down')",
        reason="error",
        detail="OSError: setup",
        words=False,
    ),
    "raises in teardown": Case(
        code="def run(self):\n    self.add_cleanup(print, 'clean')\ndef teardown(self):\n    raise OSError('teardown')",
        reason="error",
        detail="OSError: teardown",
    ),
    "raises in every clean-up": Case(
        code="""
        def boom(self, text):
            raise OSError(text)
        def run(self):
            self.add_cleanup(print, "clean")
            self.add_cleanup(self.boom, "second")
            self.add_cleanup(self.boom, "first")
        def teardown(self):
            print("down")
        """,
        reason="error",
        detail="OSError: first",
    ),
    "raises while loading": Case(
        code="raise OSError('loading')", reason="error", detail="OSError: loading", words=False
    ),
    "hangs while loading": Case(
        code="time.sleep(60)",
        reason="timeout",
        detail="loading did not end within 0.3 s",
        words=False,
        stack="hostile.py",
    ),
    "exits while loading": Case(code="os._exit(0)", reason="exit", detail="exit status 0 while loading", words=False),
    "hangs in setup": Case(
        code="def setup(self):\n    time.sleep(60)\ndef run(self):\n    pass\ndef teardown(self):\n    print('down')",
        reason="timeout",
        detail="setup() did not end within 1 s",
        stack="in setup",
        words=False,
    ),
    "hangs in teardown": Case(
        code="def run(self):\n    self.add_cleanup(print, 'clean')\ndef teardown(self):\n    time.sleep(60)",
        reason="timeout",
        detail="teardown() did not end within 0.3 s",
        stack="in teardown",
    ),
    "hangs in a clean-up": Case(
        code="def run(self):\n    self.add_cleanup(print, 'clean')\n    self.add_cleanup(time.sleep, 60)",
        reason="timeout",
        detail="cleanup() did not end within 0.3 s",
        stack="worker.py",
    ),
    "hangs in run and in teardown": Case(
        code="def run(self):\n    time.sleep(60)\ndef teardown(self):\n    time.sleep(60)",
        reason="timeout",
        detail="run() did not end within 0.3 s; it did not react to being stopped and was killed",
        stack="in teardown",
    ),
    "crashes in teardown": Case(
        code="def run(self):\n    pass\ndef teardown(self):\n    os.abort()",
        reason="crash",
        detail="killed by SIGABRT in teardown()",
        signal="SIGABRT",
        stack="in teardown",
    ),
    "fails, then crashes": Case(
        "self.check(False, 'wrong')\nos.abort()",
        Verdict.FAILED,
        reason="crash",
        detail="wrong; then: killed by SIGABRT in run()",
        signal="SIGABRT",
    ),
    "fails, then hangs": Case(
        "self.check(False, 'wrong')\ntime.sleep(60)",
        Verdict.FAILED,
        reason="timeout",
        detail="wrong; then: run() did not end within 0.3 s",
    ),
}
#: Output that must be there although something went wrong before it.
STILL_DONE = {
    "raises in setup": ["down"],
    "raises in teardown": ["clean"],
    "raises in every clean-up": ["down", "clean"],
    "hangs in setup": ["down"],
    "hangs in teardown": ["clean"],
    "hangs in a clean-up": ["clean"],
}


def run_hostile(tmp_path: Path, case: Case, *, again: int = 1) -> Outcome:
    """Run a hostile test, and a peaceful one after it."""
    mask = os.umask(0o22)
    os.umask(mask)
    # The others have the time that a busy machine needs.
    hangs = case.reason == "timeout" or "did not end" in case.detail
    peaceful = PEACEFUL.replace("MASK", repr(mask)).replace("FOLDER", repr(os.getcwd()))  # noqa: PTH109 - as text
    return run_suite(
        tmp_path,
        '<test name="hostile">hostile.py</test><test name="peaceful">peaceful.py</test>' * again,
        options={
            "grace": GRACE,
            "limits": Timeouts(
                # Loading, which a busy machine does in some tenths of a second, has the limit of setup.
                setup=0.3 if "loading" in case.detail else 1.0 if "setup" in case.detail else 10,
                run=case.limit if hangs else 10,
                teardown=0.3 if hangs else 10,
            ),
            "memory": case.memory,
        },
        hostile__py=case.text(),
        peaceful__py=peaceful,
    )


def output_of(outcome: Outcome, test: str = "s/hostile") -> str:
    """Return all that the test wrote."""
    return "".join(event.text for event in outcome.of(OutputCaptured, test=test))


@pytest.mark.parametrize("name", [*CASES, *PHASES])
def test_hostile_test_has_its_verdict_and_the_next_one_passes(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A hostile test has a defined verdict and reason, its output is kept, and the next test passes."""
    case = (CASES | PHASES)[name]
    outcome = run_hostile(tmp_path, case)
    (ended,) = outcome.of(TestEnded, test="s/hostile")
    assert (ended.verdict, ended.reason) == (case.verdict, case.reason), ended
    assert case.detail in ended.detail
    if case.signal:
        assert ended.signal == case.signal
    if case.exit_status is not None:
        assert ended.exit_status == case.exit_status
    if case.words:
        assert "last words" in output_of(outcome)
    stacks = "".join(event.text for event in outcome.of(StackDumped, test="s/hostile"))
    assert case.stack in stacks
    assert all(word in output_of(outcome) for word in STILL_DONE.get(name, []))
    assert outcome.verdict("peaceful") is Verdict.PASSED, outcome.detail("peaceful")
    assert "peaceful words" in output_of(outcome, "s/peaceful")
    assert outcome.exit_code == (0 if case.verdict is Verdict.PASSED else 1)


@pytest.mark.parametrize("whom", ["os.getsid(0)", "os.getppid()"])
@pytest.mark.parametrize("signum", ["SIGKILL", "SIGSTOP"])
def test_test_that_kills_or_stops_what_it_was_forked_from(
    signum: str, whom: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A test that kills or stops its fork server or template is an error or passes; the next tests pass.

    Tests of a file that is used twice are forked from its template, so that they outlive a fork server that is stopped.
    """
    monkeypatch.setattr(attempt, "_LEAVING", 0.5)
    monkeypatch.setattr(child, "_VANISH", 1.0)
    outcome = run_hostile(tmp_path, Case(f"os.kill({whom}, signal.{signum})\ntime.sleep(0.2)"), again=2)
    attackers = [event for event in outcome.of(TestEnded) if "hostile" in event.test]
    verdict = Verdict.PASSED if (signum, whom) == ("SIGSTOP", "os.getsid(0)") else Verdict.ERROR
    assert [event.verdict for event in attackers] == [verdict] * 2
    assert {event.reason for event in attackers} <= ({"internal", "crash"} if signum == "SIGKILL" else {"timeout", ""})
    assert [event.verdict for event in outcome.of(TestEnded) if "peaceful" in event.test] == [Verdict.PASSED] * 2
    assert outcome.events[-1].duration < 15


def test_a_hundred_crashes_in_one_run(tmp_path: Path):
    """A hundred tests that crash are a hundred errors, each its own, and every test between them passes."""
    outcome = run_hostile(tmp_path, Case("os.abort()"), again=100)
    counts = outcome.results.counts()
    assert counts == {Verdict.ERROR: 100, Verdict.PASSED: 100}
    ends = outcome.of(TestEnded, verdict=Verdict.ERROR)
    assert {(end.reason, end.signal) for end in ends} == {("crash", "SIGABRT")}
    assert len({end.test for end in ends}) == 100


def test_a_gigabyte_on_the_output_is_bounded_and_counted(tmp_path: Path):
    """Of a gigabyte, beginning and end are kept and the rest is counted; runner and journal stay small."""
    code = """
    block = b"x" * 99 + b"\\n"
    block *= 10000
    for _ in range(1000):
        os.write(1, block)
    print("the end")
    """
    before = _memory()
    outcome = run_suite(tmp_path, '<test name="hostile">hostile.py</test>', hostile__py=Case(code).text())
    assert outcome.verdict("hostile") is Verdict.PASSED
    text = output_of(outcome)
    assert text.startswith("last words")
    assert text.endswith("the end\n")
    omitted = sum(event.omitted for event in outcome.of(OutputCaptured))
    assert omitted + len(text) == 1000 * 1000000 + len("last words\nthe end\n")
    assert (outcome.folder / "journal.jsonl").stat().st_size < 1 << 20
    assert _memory() - before < 64 << 20


def _memory() -> int:
    import psutil

    return psutil.Process().memory_info().rss


def test_flood_of_events_is_bounded_and_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Beyond a limit, messages that only inform are left out and counted; failures and the time-out still count."""
    monkeypatch.setattr(transcript, "EVENT_BYTES", 1 << 20)
    code = "self.check(False, 'wrong')\nwhile True:\n    self.progress(0.5, 'x' * 1000)\n    self.report('y' * 1000)"
    outcome = run_hostile(tmp_path, Case(code, reason="timeout"))
    assert outcome.verdict("hostile") is Verdict.FAILED
    assert outcome.verdict("peaceful") is Verdict.PASSED
    assert (outcome.folder / "journal.jsonl").stat().st_size < 2 << 20
    assert outcome.of(Message, severity=Severity.WARNING, title="journal")


def test_flood_of_garbage_is_bounded_and_counted(tmp_path: Path):
    """Of a million unintelligible messages a few are quoted; the rest are counted."""
    outcome = run_hostile(
        tmp_path, Case("while True:\n    os.write(3, (struct.pack('=I', 7) + b'garbage') * 1000)", reason="timeout")
    )
    assert outcome.verdict("hostile") is Verdict.ERROR
    assert outcome.verdict("peaceful") is Verdict.PASSED
    assert len(outcome.of(Message, title="protocol")) == 20
    assert (outcome.folder / "journal.jsonl").stat().st_size < 1 << 20


def test_phases_are_entered_once_each_and_in_order(tmp_path: Path):
    """A test that was stopped in ``run`` still enters ``teardown`` and its clean-ups, each with its limit."""
    body = "    self.add_cleanup(print, 'clean')\n    time.sleep(60)\n"
    code = f"def run(self):\n{body}def teardown(self):\n    print('down')"
    outcome = run_hostile(tmp_path, Case(code=code, reason="timeout"))
    phases = [(event.phase, event.limit) for event in outcome.of(PhaseStarted, test="s/hostile")]
    assert phases == [(Phase.RUN, 0.3), (Phase.TEARDOWN, 0.3), (Phase.CLEANUP, 0.3)]
    assert "down\nclean\n" in output_of(outcome)
