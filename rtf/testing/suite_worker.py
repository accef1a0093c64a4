"""A suite worker: suites that share a fixture, worked through one after the other.

It decides what becomes of each test: whether it may start, which attempts are made, what a lost fixture, a time-out or
an interrupt means for it. It has a fork server, a reactor and a supervisor of its own, and runs in one thread.
"""

from __future__ import annotations

import json
from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.cases import CaseTests
from rtf.testing.dispatch import copy_suffix
from rtf.testing.events import (
    Diagnosed,
    SuiteEnded,
    SuiteStarted,
    TestEnded,
)
from rtf.testing.interrupts import KILL_STAGE, alarm
from rtf.testing.isolation.attempt import Attempt, Outcome, Stop
from rtf.testing.isolation.messages import STOP_LIMIT, Job
from rtf.testing.isolation.reactor import Reactor
from rtf.testing.isolation.worker_pool import ForkServerClient
from rtf.testing.requirements import unmet
from rtf.testing.suite.model import Expected, Isolation, LostPolicy, Scope
from rtf.testing.supervision.supervisor import Fixture, Supervisor
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rtf.testing.isolation.worker_pool import Child
    from rtf.testing.plan import PlannedSuite, PlannedTest
    from rtf.testing.runner import Run
    from rtf.testing.suite.model import FixtureEntry, TestSuite

_RETRIED = frozenset({Verdict.FAILED, Verdict.ERROR})
#: Seconds in which the end of a program becomes known after its last connection was closed.
_SETTLING = 0.1


class SuiteWorker:
    """Works through suites one after the other, with one fork server and one set of fixtures.

    :meth:`run` keeps to the order of the plan. Whoever knows the order only as it comes uses what :meth:`run` is made
    of instead: inside :meth:`at_work` and :meth:`suite` tests are run one by one, and :meth:`wait` stands for the time
    between them. All but :meth:`wake` and :meth:`abort` belong to one thread.
    """

    def __init__(self, run: Run, suites: Sequence[PlannedSuite]) -> None:
        self._run = run
        self._suites = suites
        self._emit = run.emit
        self._dispatcher = run.dispatcher
        self._reactor = Reactor()
        self._test = ""
        self._run_folder = str(run.options.run_folder)
        self._files = str(run.options.run_folder / "files")
        self._suite_folder = ""
        self._suite: PlannedSuite = suites[0] if suites else None  # type: ignore[assignment]  # no suite, no test
        self._suite_deadline = clock.Deadline()
        self._fixtures_deadline = clock.Deadline()  # of a run that has to end at once
        self._interrupts_before = 0  # what comes after these ends a fixture's teardown by force
        self._aborted = ""
        self._cases: CaseTests  # of the test that runs
        self._shared: Child | None = None
        preload = tuple(dict.fromkeys(name for planned in suites for name in planned.suite.preload))
        self._fork_server = ForkServerClient(
            self._reactor,
            preload=preload,
            uses=Counter(test.plugin.path for planned in suites for test in planned.tests if test.plugin is not None),
            launched=run.take_launched(),
            stop_now=lambda: run.interrupts.stage > 0,
        )
        self._supervisor = Supervisor(
            self._fork_server,
            self._emit,
            self._fixture_job,
            running_test=lambda: self._test,
            stop_now=self._start_nothing,
            kill_now=self._use_force,
            stop_by=self._stop_by,
        )

    def run(self) -> None:
        """Run the suites; afterwards everything of this suite worker is gone."""
        done = self._run.options.done
        with self.at_work():
            for index, planned in enumerate(self._suites):
                if planned.tests and all(test.entry.id in done for test in planned.tests):
                    self._end_suite(planned, 0.0)
                elif not planned.tests or not self._dispatcher.is_empty(planned.suite.id):
                    with self.suite(planned, self._suites[index + 1 :]):
                        self._run_tests(planned)

    def _run_tests(self, planned: PlannedSuite) -> None:
        """Run the tests of a suite that nobody else runs."""
        dispatcher, suite = self._dispatcher, planned.suite.id
        tests = {test.entry.id: test for test in planned.tests}
        while not dispatcher.is_empty(suite):
            taken = dispatcher.take(suite, stopping=bool(self._stop_reason()))
            if not taken:
                self._supervisor.watch()
                self._reactor.run_once(self._next_tick())
                continue
            try:
                self.run_test(tests[taken])
            finally:
                dispatcher.ended(suite, taken)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Have a fork server in the block; afterwards everything of this suite worker is gone."""
        self._run.interrupts.attend(self._reactor)
        try:
            if any(test.plugin is not None for planned in self._suites for test in planned.tests):
                self._fork_server.start()
            yield
        finally:
            try:
                self._take_down(self._supervisor.names())
            finally:
                self._fork_server.close()
                self._run.interrupts.leave(self._reactor)
                self._reactor.close()
                for problem in self._fork_server.problems:
                    self._emit(Diagnosed(severity=Severity.WARNING, text=problem))

    def wait(self, until: Callable[[], bool]) -> None:
        """Watch over the fixtures until something holds; what makes it hold must call :meth:`wake`."""
        while not until():
            self._supervisor.watch()
            self._reactor.run_once(self._supervisor.deadline())

    def wake(self) -> None:
        """Have :meth:`wait` look again. Any thread."""
        self._reactor.wake()

    def abort(self, reason: str) -> None:
        """Stop the running test, and start nothing until this is taken back with an empty reason. Any thread."""
        self._aborted = reason
        self._reactor.wake()

    # Suites ------------------------------------------------------------------------------------------------------

    @contextmanager
    def suite(self, planned: PlannedSuite, later: Sequence[PlannedSuite] = ()) -> Iterator[None]:
        """Run tests of a suite in the block; afterwards its fixtures are down but for those that a ``later`` one needs.

        What its tests stand on comes up with the first of them that needs it.
        """
        suite = planned.suite
        self._suite = planned
        self._suite_folder = str(Path(suite.file).parent) if suite.file else ""
        self._supervisor.suite = suite.id
        self._supervisor.adopt(
            Fixture(entry, ref if not isinstance(ref, str) else None, ref if isinstance(ref, str) else "")
            for entry, ref in planned.fixtures
        )
        first, self._suite_deadline = self._dispatcher.enter(suite, self._reactor.wake)
        if self._run.options.terminal:
            self._suite_deadline = clock.Deadline()
        if first:
            self._emit(SuiteStarted(suite=suite.id))
        try:
            with alarm(suite.timeout, self._reactor.wake):
                yield
        finally:
            self._suite_deadline = clock.Deadline()
            self._end_shared()
            kept = _kept_for(suite, [other.suite for other in later])
            mine = [entry.name for entry in suite.fixtures if entry.name not in kept]
            self._take_down(mine)
            self._supervisor.forget(mine)
            last, duration = self._dispatcher.leave(suite.id, self._reactor.wake)
            if last:
                self._end_suite(planned, duration)

    # What the supervisor asks each time something happened while it waits; so an interrupt is told of at once.

    def _start_nothing(self) -> bool:
        self._run.interrupts.announce(self._emit)
        return self._run.interrupts.stage > 0 or self._suite_deadline.expired or bool(self._aborted)

    def _use_force(self) -> bool:
        interrupts = self._run.interrupts
        interrupts.announce(self._emit)
        forced = interrupts.stage >= KILL_STAGE and interrupts.count > self._interrupts_before
        return forced or self._stop_by().expired

    def _stop_by(self) -> clock.Deadline:
        """When fixtures have to be down, once the run has to end at once. It is told if that is later than usual."""
        interrupts = self._run.interrupts
        if interrupts.in_a_hurry and self._fixtures_deadline.at == clock.FOREVER:
            slow = self._supervisor.slow_to_stop()
            more = sum(slow.values()) - len(slow) * STOP_LIMIT
            self._fixtures_deadline = interrupts.fixtures_deadline(more)
            for name, seconds in slow.items():
                text = f"fixture {name} needs up to {seconds:g} s to be brought down safely; the run waits for it"
                self._emit(Diagnosed(severity=Severity.WARNING, text=text, suite=self._suite.suite.id))
        return self._fixtures_deadline

    def _kill_test(self) -> bool:
        interrupts = self._run.interrupts
        return interrupts.stage >= KILL_STAGE or interrupts.test_deadline.expired

    def _take_down(self, names: list[str]) -> None:
        """Tear fixtures down. The force that ended the running test is not used on them; they must be asked first."""
        self._interrupts_before = self._run.interrupts.count
        self._supervisor.take_down(names)

    def _end_suite(self, planned: PlannedSuite, duration: float) -> None:
        result = self._run.results.suites[planned.suite.id]
        counts = result.counts()
        bad = any(not verdict.good for verdict in counts) or result.problems
        verdict = Verdict.FAILED if bad else Verdict.PASSED
        done = self._run.options.done  # tests of earlier parts of this run, whose time is the suite's too
        earlier = sum(test.duration for test in result.tests.values() if test.id in done and not test.planned.parent)
        self._emit(
            SuiteEnded(
                suite=planned.suite.id,
                verdict=verdict,
                duration=earlier + duration,
                counts={str(key): count for key, count in counts.items()},
            ),
        )

    # Tests -------------------------------------------------------------------------------------------------------

    def run_test(self, test: PlannedTest) -> None:
        """Run a test of the suite, up to its final end."""
        obstacle = self._obstacle(test)
        self._cases = self._cases_of(test)
        if obstacle is not None:
            self._never_started(test, *obstacle)
        else:
            self._run_attempts(test)
        self._run.count_failures(self._cases.failures + (not self._verdict_is_good(test)))

    def bring_up(self, test: PlannedTest) -> bool:
        """Have what a test stands on up. False when it cannot be started; :meth:`run_test` then says at once why."""
        if self._obstacle(test) is not None:
            return False
        names = self._fixtures_of(test)
        return not names or not self._supervisor.bring_up(names)

    def _obstacle(self, test: PlannedTest) -> tuple[Verdict, str, str] | None:
        """Why a test is not to be started: its verdict, the reason, and the sentence for people."""
        reason = self._stop_reason()
        if reason:
            return Verdict.NOT_RUN, "not run", reason
        if test.plugin is None:
            return Verdict.ERROR, "load", test.problem
        missing = unmet(test, self._run.results, self._run.options.features)
        return None if missing is None else (missing.verdict, "requirement", missing.text)

    def _fixtures_of(self, test: PlannedTest) -> list[str]:
        return [fixture.name for fixture in self._suite.suite.fixtures_of(test.entry)]

    def _stop_reason(self) -> str:
        """Why nothing more of this suite is to be started, or an empty text."""
        reason = self._run.stop_reason() or self._aborted
        if not reason and self._suite_deadline.expired:
            reason = self._suite_overdue()
        return reason

    def _suite_overdue(self) -> str:
        return f"the suite did not end within {self._suite_deadline.limit:g} s"

    def _verdict_is_good(self, test: PlannedTest) -> bool:
        verdict = self._run.results.tests[test.entry.id].verdict
        return verdict is None or verdict.good

    def _cases_of(self, test: PlannedTest) -> CaseTests:
        """What becomes of the cases of a test that is a program."""
        names = self._fixtures_of(test)
        several = names or self._run.retries_of(test.entry) or self._run.repetition_of(test.entry)
        return CaseTests(
            test.entry,
            self._run.results.tests[test.entry.id].planned,
            self._emit,
            lambda verdict, failed: self._verdict_of_case(test, verdict, failed, names),
            live=not several,
        )

    def _verdict_of_case(self, test: PlannedTest, verdict: Verdict, failed: list[Verdict], names: list[str]) -> Verdict:
        """The final verdict of a case. Where a program is expected to fail, not each of its cases is."""
        return verdict if verdict.good and not failed else self._final_verdict(test, verdict, failed, names)

    def _never_started(self, test: PlannedTest, verdict: Verdict, reason: str, detail: str) -> None:
        self._cases.give_up(verdict, reason, detail)
        self._emit(
            TestEnded(test=test.entry.id, verdict=verdict, outcome=verdict, attempt=0, reason=reason, detail=detail),
        )

    def _run_attempts(self, test: PlannedTest) -> None:
        entry = test.entry
        names = self._fixtures_of(test)
        retries = self._run.retries_of(entry) if entry.expected is Expected.PASS else 0
        reruns = 1
        attempt = 0
        retried = 0
        failed: list[Verdict] = []
        while True:
            problem = self._supervisor.bring_up(names) if names else ""
            if problem:
                self._not_up(test, attempt, failed, problem)
                return
            attempt += 1
            outcome = self._attempt(test, attempt, names)
            if outcome.verdict is Verdict.FIXTURE_LOST:
                again = reruns > 0 and self._lost_policy(test, names) is LostPolicy.RERUN
                reruns -= 1
            else:
                bad = outcome.verdict in _RETRIED or (outcome.verdict.good and self._cases.any_bad)
                again = bad and retried < retries
                retried += 1
            again = again and not (self._run.interrupts.stage or self._suite_deadline.expired or self._aborted)
            self._cases.end_attempt(outcome.verdict, outcome.detail, again=again)
            self._ended(test, attempt, outcome, final=not again, failed=failed, names=names)
            if not again:
                return
            if outcome.verdict in _RETRIED:
                failed.append(outcome.verdict)

    def _not_up(self, test: PlannedTest, attempt: int, failed: list[Verdict], problem: str) -> None:
        """The last word on a test that cannot be started, or not once more."""
        reason = self._stop_reason()
        if failed:
            detail = f"it did not pass, and was not tried again: {reason or problem}"
            self._never_started(test, _worst(failed), "fixture", detail)
        elif reason:
            verdict = Verdict.INTERRUPTED if attempt else Verdict.NOT_RUN
            self._never_started(test, verdict, "interrupted" if attempt else "not run", reason)
        else:
            self._never_started(test, Verdict.FIXTURE_LOST if attempt else Verdict.BLOCKED, "fixture", problem)

    def _lost_policy(self, test: PlannedTest, names: Iterable[str]) -> LostPolicy:
        for entry in self._suite.suite.fixtures:
            if entry.name in names and entry.on_lost is not None and self._supervisor.lost([entry.name]):
                return entry.on_lost
        return test.entry.on_lost

    def _attempt(self, test: PlannedTest, count: int, names: list[str]) -> Outcome:
        entry = test.entry
        self._test = entry.id
        isolation = self._run.options.isolation or entry.isolation
        job = self._test_job(test, count, names, last=isolation is not Isolation.SUITE)
        if isolation is Isolation.NONE:
            from rtf.testing.isolation.attempt import run_in_process

            outcome = run_in_process(job, self._emit, self._cases.take)
        else:
            attempt = Attempt(
                job,
                self._run.limits_of(self._suite, test),
                self._fork_server,
                self._emit,
                tick=lambda: self._tick(names),
                next_tick=self._next_tick,
                kill_now=self._kill_test,
                take_case=self._cases.take,
                ask=self._run.options.ask,
                fixtures=self._supervisor.generations(names),
            )
            outcome = attempt.run(self._shared_child if isolation is Isolation.SUITE else None)
            if attempt.stopped and isolation is Isolation.SUITE:
                self._end_shared()  # what stopped this test is not to reach the next one
        outcome = self._confirmed(outcome, names)
        if outcome.cut_short:
            self._supervisor.enter_safe_state(names)
        self._test = ""
        return outcome

    def _shared_child(self) -> Child:
        if self._shared is None or self._shared.end is not None:
            self._shared = self._fork_server.take()
        return self._shared

    def _end_shared(self) -> None:
        if self._shared is not None:
            self._shared.dismiss()
            self._shared = None

    def _confirmed(self, outcome: Outcome, names: list[str]) -> Outcome:
        """A verdict on a robot counts only if what the test stood on is still there."""
        if not names or outcome.verdict in (Verdict.FIXTURE_LOST, Verdict.INTERRUPTED):
            return outcome
        if outcome.verdict in _RETRIED:
            self._settle(names)
        self._supervisor.confirm(names)
        lost = self._supervisor.lost(names)
        if not lost:
            return outcome
        detail = f"{lost} (the test itself had come to: {outcome.verdict})"
        return _changed(outcome, Verdict.FIXTURE_LOST, "fixture", detail)

    def _settle(self, names: list[str]) -> None:
        """Wait a moment for bad news: a program that dies drops its connections before its end can be seen.

        A test that failed only because of this must not be blamed for it.
        """
        deadline = clock.Deadline.after(_SETTLING)
        while not deadline.expired and not self._supervisor.lost(names):
            self._reactor.run_once(deadline)

    def _tick(self, names: list[str]) -> Stop | None:
        run = self._run
        self._supervisor.watch()
        lost = self._supervisor.lost(names) if names else ""
        if lost:
            return Stop(Verdict.FIXTURE_LOST, "fixture", lost)
        reason = run.stop_reason() if run.interrupts.stage else ""
        if run.interrupts.stage > 1:
            return Stop(Verdict.INTERRUPTED, "interrupted", reason)
        if self._suite_deadline.expired:
            return Stop(Verdict.ERROR, "timeout", self._suite_overdue())
        return Stop(Verdict.ERROR, "aborted", self._aborted) if self._aborted else None

    def _next_tick(self) -> clock.Deadline:
        deadline = self._supervisor.deadline().earliest(self._suite_deadline)
        hurry = self._run.interrupts.test_deadline
        return deadline if hurry.expired else deadline.earliest(hurry)

    def _ended(
        self,
        test: PlannedTest,
        attempt: int,
        outcome: Outcome,
        *,
        final: bool,
        failed: list[Verdict],
        names: list[str],
    ) -> None:
        verdict = outcome.verdict
        if final:
            as_expected = test.entry.expected is Expected.FAIL and verdict.good and self._cases.any_bad
            verdict = self._final_verdict(test, Verdict.FAILED if as_expected else verdict, failed, names)
        detail = outcome.detail
        if verdict is Verdict.EXPECTED_FAILURE and test.entry.expected_reason:
            detail = f"{test.entry.expected_reason}: {detail}"
        elif verdict is Verdict.UNEXPECTED_PASS:
            detail = f"expected to fail{': ' + test.entry.expected_reason if test.entry.expected_reason else ''}"
        self._emit(
            TestEnded(
                test=test.entry.id,
                verdict=verdict,
                outcome=outcome.verdict,
                attempt=attempt,
                final=final,
                reason=outcome.reason,
                detail=detail,
                duration=outcome.duration,
                exit_status=outcome.exit_status,
                signal=outcome.signal,
                cpu_time=outcome.cpu_time,
                max_rss=outcome.max_rss,
            ),
        )

    def _final_verdict(self, test: PlannedTest, verdict: Verdict, failed: list[Verdict], names: list[str]) -> Verdict:
        """What is said of a test that came to ``verdict``; nothing hides those of the attempts before, ``failed``."""
        if test.entry.expected is Expected.FAIL:
            if verdict is Verdict.FAILED:
                return Verdict.EXPECTED_FAILURE
            return Verdict.UNEXPECTED_PASS if verdict in (Verdict.PASSED, Verdict.MEASURED) else verdict
        if failed:
            return Verdict.FLAKY if verdict in (Verdict.PASSED, Verdict.MEASURED) else _worst([*failed, verdict])
        if verdict is Verdict.FIXTURE_LOST and self._lost_policy(test, names) is LostPolicy.SKIP:
            return Verdict.SKIPPED
        return verdict

    # Jobs --------------------------------------------------------------------------------------------------------

    def _test_job(self, test: PlannedTest, attempt: int, names: list[str], *, last: bool) -> Job:
        entry = test.entry
        options = self._run.options
        if test.plugin is None:
            raise RuntimeError(f"test {entry.id} has no plug-in and cannot be run")
        folder = f"{self._files}/{entry.id}"
        return Job(
            kind="test",
            id=entry.id,
            name=entry.name,
            plugin=test.plugin,
            folder=folder if attempt == 1 else f"{folder}.attempt{attempt}",
            run_folder=self._run_folder,
            param=entry.param,
            parameters=entry.parameters,
            overrides=options.overrides,
            suite_place=str(entry.location) if entry.location.file else "",
            suite_folder=self._suite_folder,
            environment=entry.environment,
            repetition=self._run.repetition_of(entry),
            attempt=attempt,
            memory=options.memory,
            can_ask=options.ask is not None,
            last=last,
            variables=self._supervisor.variables(names),
            values=self._values(names),
            terminal=options.terminal,
            core_dumps=options.core_dumps,
            cases=self._cases.begin(attempt),
        )

    def _fixture_job(self, fixture: Fixture) -> Job:
        entry = fixture.entry
        options = self._run.options
        if fixture.plugin is None:
            raise RuntimeError(f"fixture {entry.name} has no plug-in and cannot be set up")
        return Job(
            kind="fixture",
            id=entry.name,
            name=entry.name,
            plugin=fixture.plugin,
            folder=str(options.run_folder / "files" / self._suite.suite.id / f"fixture-{entry.name}"),
            run_folder=str(options.run_folder),
            param=entry.param,
            parameters=entry.parameters,
            suite_place=str(entry.location) if entry.location.file else "",
            suite_folder=str(Path(entry.location.file).parent) if entry.location.file else "",
            environment=entry.environment or self._suite.suite.environment,
            attempt=fixture.generation,
            check_period=entry.check_period,
            variables=self._supervisor.variables(entry.depends),
            values=self._values(entry.depends),
        )

    def _values(self, names: Iterable[str]) -> str:
        """What the fixtures hand on, by the names that the suite gives them."""
        values = self._supervisor.values(names)
        suffix = copy_suffix(self._suite.copy)
        return json.dumps({name.removesuffix(suffix): value for name, value in values.items()}) if values else ""


def _changed(outcome: Outcome, verdict: Verdict, reason: str, detail: str) -> Outcome:
    return replace(outcome, verdict=verdict, reason=reason, detail=detail, cut_short=True)


def _worst(verdicts: list[Verdict]) -> Verdict:
    """What several attempts say together when none of them settled it: that something failed is never hidden."""
    return Verdict.FAILED if Verdict.FAILED in verdicts else Verdict.ERROR


def _kept_for(suite: TestSuite, later: Sequence[TestSuite]) -> set[str]:
    """The fixtures of a suite that stay up for a later one: run-scoped, the same there, and all they stand on kept."""
    kept: set[str] = set()
    for entry in suite.fixtures:
        others = (other for following in later for other in following.fixtures if other.name == entry.name)
        following = next(others, None)
        if following is not None and _same(entry, following) and kept.issuperset(entry.depends):
            kept.add(entry.name)
    return kept


def _same(one: FixtureEntry, other: FixtureEntry) -> bool:
    return one.scope is Scope.RUN and replace(one, location=other.location) == other
