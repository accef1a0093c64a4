"""A robot that is lost or becomes slow in the middle of a test: the verdicts of that test and of the next one.

A suite has the test once on a robot that is left alone, and then once for each strike; another, unrelated test follows
each strike. The strikes are timed by the run's journal: each falls when the test has been running for some part of the
time that it took on the robot that was left alone.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import psutil
from junitparser import xunit2

from harness import Command, Outcome, write_files
from rtf import clock
from rtf.middleware.naming import configuration
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.ports.network import Network
from rtf.simulator.control_client import SimulatorControl
from rtf.testing import journal
from rtf.testing.events import FixtureChanged, FixtureIncident, PhaseStarted, SubResultEnded, TestEnded, TestStarted
from rtf.testing.events import from_line as event_from_line
from rtf.testing.verdict import FixtureState, Phase, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from rtf.testing.events import Event

#: The beginning of a suite, with the defaults of suites/icubSim/robot.xml.
_HEAD = """<suite name="s" on-lost="error">
<fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names" {attributes}> {parameters} simulator </fixture>
"""
#: Answers slowly, so that a test of machines has something to wait for.
_SSH = "#!/bin/sh\nsleep 0.3\necho 8388608\n"
#: The test after each strike. It moves a part, brings its joints into several modes, and is short.
_NEXT = '<parameter name="part">head</parameter> MovementReferencesTest'
_ROBOT = "robot"
#: Seconds: the longest that a test may take, that a strike of slowness lasts, and that one turn of it lasts.
_LIMIT, _SLOW, _STOPPED, _GOING = 300.0, 3.0, 0.4, 0.1
#: The greatest part of a test's time before a strike; one that missed is tried again with the next part.
REACHES = (0.9, 0.4, 0.1)
#: The real-time factor of a slow robot.
_FACTOR = 0.2
#: The runner asks a fixture at this period (s), which then has this long (s) to answer, as in robot.xml.
_NOTICED = 0.5 + 2.0
#: Seconds after which a test under which the robot was lost has ended at the latest, on a busy machine, too: it waits
#: for no answer of a robot that is gone.
_PROMPT = 10.0


@dataclass(frozen=True, slots=True)
class Subject:
    """A robot test, with the parameters of its simulator and the attributes of its fixture."""

    test: str
    parameters: dict[str, str] = field(default_factory=dict)
    simulator: dict[str, str] = field(default_factory=dict)
    attributes: str = ""

    def head(self) -> str:
        """Return the beginning of a suite."""
        return _HEAD.format(attributes=self.attributes, parameters=_rows(self.simulator))

    def entry(self, name: str) -> str:
        """Return the test's line in a suite."""
        return f'<test name="{name}" timeout="{_LIMIT:g}"> {_rows(self.parameters)} {self.test} </test>'


def _rows(parameters: dict[str, str]) -> str:
    return "".join(f'<parameter name="{name}">{value}</parameter>' for name, value in parameters.items())


@dataclass(slots=True)
class Finding:
    """The result of a strike. Times in seconds; ``wrong`` is empty when all expectations hold.

    ``missed``: the test had ended before the strike, so that nothing was found out.
    """

    subject: str
    strike: str
    healthy: str = ""
    duration: float = 0.0
    moment: float = 0.0
    verdict: str = ""
    stopped_after: float = 0.0
    back_after: float = 0.0
    missed: bool = False
    wrong: list[str] = field(default_factory=list)


# Following a run ---------------------------------------------------------------------------------------------------


class Follower:
    """The events of a run, read from its journal while the run goes on."""

    def __init__(self, command: Command) -> None:
        self.events: list[Event] = []
        self._command = command
        self._path = command.folder / "rtf-runs" / "latest" / journal.FILE_NAME
        self._read = 0

    def look(self) -> None:
        """Read the events that the journal has gained since the last time."""
        if not self._path.exists():
            return
        with self._path.open("rb") as stream:
            stream.seek(self._read)
            data = stream.read()
        whole = data[: data.rfind(b"\n") + 1]
        self._read += len(whole)
        self.events += map(event_from_line, whole.splitlines())

    def until(self, condition: Callable[[Event], bool], deadline: clock.Deadline) -> Event | None:
        """Return the first event that fulfils the condition, past or to come; None when time or run has ended."""
        seen = 0
        while True:
            over = self._command.process.poll() is not None
            self.look()
            for event in self.events[seen:]:
                if condition(event):
                    return event
            seen = len(self.events)
            if over or deadline.expired:
                return None
            clock.sleep(0.002)

    def simulator(self) -> psutil.Process:
        """Return the process of the simulator that is up now."""
        host = next(
            event.pid
            for event in reversed(self.events)
            if isinstance(event, FixtureChanged) and event.fixture == _ROBOT and event.state is FixtureState.READY
        )
        (program,) = [child for child in psutil.Process(host).children() if "simulator" in child.cmdline()]
        return program

    @contextlib.contextmanager
    def control(self) -> Iterator[SimulatorControl]:
        """Open the control port of the simulator."""
        variables = {"YARP_CONFIG_HOME": str(self._path.parent / "yarp")}
        place = configuration.read_place(configuration.NAMESPACE, variables)
        assert place is not None
        with contextlib.closing(RemoteNames(place.contact)) as names:
            network = Network(names, report=lambda _sentence: None)
            with SimulatorControl(network=network) as control:
                yield control


def ended(test: str) -> Callable[[Event], bool]:
    """Return a condition on events: the final end of a test."""
    return lambda event: isinstance(event, TestEnded) and event.test == f"s/{test}" and event.final


def running(test: str) -> Callable[[Event], bool]:
    """Return a condition on events: the beginning of a test's body."""
    return lambda event: isinstance(event, PhaseStarted) and event.test == f"s/{test}" and event.phase is Phase.RUN


# Strikes -----------------------------------------------------------------------------------------------------------


def kill(follower: Follower, _test: str) -> None:
    """Kill the simulator with SIGKILL."""
    follower.simulator().send_signal(signal.SIGKILL)


def freeze(follower: Follower, _test: str) -> None:
    """Stop the simulator with SIGSTOP: its connections stay, and it does nothing any more."""
    follower.simulator().send_signal(signal.SIGSTOP)


def slow(follower: Follower, test: str) -> None:
    """Slow the simulator's time down for a while."""
    with follower.control() as control:
        control.set_factor(_FACTOR)
        follower.until(ended(test), clock.Deadline.after(_SLOW))
        control.set_factor(float("inf"))


def stutter(follower: Follower, test: str) -> None:
    """Stop the simulator most of the time for a while, as on a machine that is much too busy."""
    program = follower.simulator()
    while_it_lasts = clock.Deadline.after(_SLOW)
    try:
        while not while_it_lasts.expired and follower.until(ended(test), clock.Deadline.after(_GOING)) is None:
            program.send_signal(signal.SIGSTOP)
            clock.sleep(_STOPPED)
            program.send_signal(signal.SIGCONT)
    finally:
        with contextlib.suppress(psutil.NoSuchProcess):
            program.send_signal(signal.SIGCONT)


STRIKES = {strike.__name__: strike for strike in (kill, freeze, slow, stutter)}
#: Strikes after which the robot is lost.
DEADLY = frozenset({"kill", "freeze"})


# A suite -----------------------------------------------------------------------------------------------------------


def findings(
    folder: Path, subject: Subject, strikes: Sequence[str], seed: object, reaches: Sequence[float] = REACHES
) -> list[Finding]:
    """Return what comes of a test under each of these strikes, in runs below a folder; try missed strikes again."""
    chance = random.Random(f"{seed} {subject.test}")
    found: dict[str, Finding] = {}
    for reach in reaches:
        left = [strike for strike in strikes if strike not in found or found[strike].missed]
        if left:
            found |= {one.strike: one for one in Ordeal(folder / f"{reach}", subject, left).run(chance, reach)}
    return [found[strike] for strike in strikes]


class Ordeal:
    """One run of a test that is struck once by each strike, at a moment of its own."""

    def __init__(self, folder: Path, subject: Subject, strikes: Sequence[str]) -> None:
        tests = "".join(
            f'{subject.entry(strike)}<test name="after {strike}" timeout="60"> {_NEXT} </test>' for strike in strikes
        )
        suite = f"{subject.head()}{subject.entry('healthy')}{tests}</suite>"
        write_files(folder, {"suite.xml": suite, "bin/ssh": _SSH})
        self._folder = folder
        self._subject = subject
        self._strikes = strikes

    def run(self, chance: random.Random, reach: float) -> list[Finding]:
        """Strike each time before the part ``reach`` of the test's time is over; return one finding a strike."""
        path = f"{self._folder / 'bin'}:{os.environ['PATH']}"
        words = ("--suite", "suite.xml", "--junit", "junit.xml", "--answer", "default", "-q")
        self._command = Command(self._folder, *words, PATH=path)
        try:
            return self._judged(self._struck(chance, reach), self._command.wait(_LIMIT))
        finally:
            if self._command.process.poll() is None:
                self._command.process.kill()
                self._command.process.communicate()
            assert self._command.left_over() == []

    def _struck(self, chance: random.Random, reach: float) -> list[_Blow]:
        follower = Follower(self._command)
        begun = self._event(follower, running("healthy"), "healthy did not begin")
        whole = self._event(follower, ended("healthy"), "healthy did not end").time - begun.time
        blows = []
        for strike in self._strikes:
            blow = _Blow(strike, chance.uniform(0.0, reach) * whole)
            begun = self._event(follower, running(strike), f"{strike} did not begin")
            early = follower.until(ended(strike), clock.Deadline.after(begun.time + blow.moment - clock.now()))
            if early is None:
                blow.time = clock.now()
                STRIKES[strike](follower, strike)
            self._event(follower, ended(strike), f"{strike} did not end")
            blows.append(blow)
        return blows

    @staticmethod
    def _event(follower: Follower, condition: Callable[[Event], bool], complaint: str) -> Event:
        event = follower.until(condition, clock.Deadline.after(_LIMIT))
        assert event is not None, complaint
        return event

    # Judging -----------------------------------------------------------------------------------------------------

    def _judged(self, blows: Sequence[_Blow], outcome: Outcome) -> list[Finding]:
        return [_Judge(self._subject, blow, outcome).finding() for blow in blows]


@dataclass(slots=True)
class _Blow:
    """A strike: planned ``moment`` seconds after the test's body began, and when it fell (since 1970), or 0."""

    strike: str
    moment: float
    time: float = 0.0


class _Judge:
    """Judges one strike by the journal of the run and by its JUnit file."""

    def __init__(self, subject: Subject, blow: _Blow, outcome: Outcome) -> None:
        self._blow = blow
        self._outcome = outcome
        healthy = self._end("healthy")
        self._found = Finding(
            subject.test, blow.strike, str(healthy.verdict), healthy.duration, blow.moment, str(self._struck.verdict)
        )

    def _end(self, name: str) -> TestEnded:
        (end,) = self._outcome.of(TestEnded, test=f"s/{name}", final=True)
        return end

    @property
    def _struck(self) -> TestEnded:
        return self._end(self._blow.strike)

    def finding(self) -> Finding:
        """Return the finding of the strike."""
        found = self._found
        found.missed = not self._blow.time or self._blow.time >= self._struck.time
        if found.missed:
            return found
        found.stopped_after = self._struck.time - self._blow.time
        if self._blow.strike in DEADLY:
            self._judge_lost()
        else:
            self._judge_slow()
        self._judge_next()
        self._expect("Traceback" not in self._outcome.stderr, f"the runner complains: {self._outcome.stderr[-300:]}")
        return found

    def _expect(self, holds: object, complaint: str) -> None:
        if not holds:
            self._found.wrong.append(complaint)

    def _judge_lost(self) -> None:
        struck, blow = self._struck, self._blow
        self._expect(struck.verdict is Verdict.FIXTURE_LOST, f"it is {struck.verdict}: {struck.detail}")
        self._expect(struck.reason == "fixture", f"the reason is {struck.reason!r}")
        self._expect(struck.detail.startswith(f"{_ROBOT}: "), f"the fixture is not named: {struck.detail!r}")
        patience = _PROMPT + (_NOTICED if blow.strike == "freeze" else 0.0)
        self._expect(self._found.stopped_after < patience, f"it ended {self._found.stopped_after:.1f} s after that")
        incidents = self._outcome.of(FixtureIncident, test=struck.test)
        self._expect([one.fixture for one in incidents] == [_ROBOT], f"incidents: {incidents}")
        word = "SIGKILL" if blow.strike == "kill" else "does not answer"
        self._expect(any(word in one.cause for one in incidents), f"the cause is not reported: {incidents}")
        (case,) = [case for case in self._junit_cases() if case.name == blow.strike]
        said = [f"{result.type}: {result.message}" for result in case.result]
        self._expect(case.is_error and any(_ROBOT in text for text in said), f"JUnit says {said}")

    def _judge_slow(self) -> None:
        struck = self._struck
        same = str(struck.verdict) == self._found.healthy
        self._expect(same, f"it is {struck.verdict}: {struck.detail or struck.reason}")
        self._expect(self._failed(self._blow.strike) == self._failed("healthy"), "other parts failed than without it")
        self._expect(not self._outcome.of(FixtureIncident, test=struck.test), "the fixture was taken for lost")

    def _failed(self, test: str) -> list[str]:
        return [one.subject for one in self._outcome.of(SubResultEnded, test=f"s/{test}") if not one.verdict.good]

    def _judge_next(self) -> None:
        """Expect that the next test passes, on a new generation if the robot was lost."""
        name = f"after {self._blow.strike}"
        after = self._end(name.replace(" ", "-"))
        self._expect(after.verdict is Verdict.PASSED, f"{name} is {after.verdict}: {after.detail}")
        (stood,) = self._outcome.of(TestStarted, test=self._struck.test)
        (stands,) = self._outcome.of(TestStarted, test=after.test)
        more = stands.fixtures[_ROBOT] - stood.fixtures[_ROBOT]
        self._expect(more == (self._blow.strike in DEADLY), f"{name} stands on a robot that was restarted {more} times")
        self._expect(stands.fixtures["names"] == 1, "the name server was restarted")
        self._found.back_after = stands.time - self._blow.time
        (case,) = [case for case in self._junit_cases() if case.name == name.replace(" ", "-")]
        self._expect(case.is_passed, f"JUnit says of {name}: {case.result}")

    def _junit_cases(self) -> list[xunit2.TestCase]:
        path = self._outcome.folder.parents[1] / "junit.xml"
        return [xunit2.TestCase.fromelem(case) for suite in xunit2.JUnitXml.fromfile(str(path)) for case in suite]
