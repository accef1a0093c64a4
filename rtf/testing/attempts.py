"""The attempts at one test, up to its final verdict.

This module decides whether a test can start, whether it is tried again, and how a lost fixture, a retry or an
expectation changes its verdict. One attempt is ``isolation.attempt``.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.cases import CaseTests
from rtf.testing.events import TestEnded
from rtf.testing.isolation.attempt import Attempt, Outcome, Stop, run_in_process
from rtf.testing.isolation.messages import FailedTest, Job, Use
from rtf.testing.suite.model import TEST_REQUIREMENT, Expected, Isolation, LostPolicy
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from rtf.testing.results import RunResult, TestResult
    from rtf.testing.suite.model import TestEntry
    from rtf.testing.suite_worker import SuiteWorker

_RETRIED = frozenset({Verdict.FAILED, Verdict.ERROR})
#: Seconds in which the end of a program becomes known after its last connection was closed.
_SETTLING = 0.1


class Attempts:
    """All attempts at one test of a suite worker's current suite. For one thread."""

    def __init__(self, worker: SuiteWorker, test: TestEntry) -> None:
        self._worker = worker
        self._run = worker.whole_run
        self._supervisor = worker.supervisor
        self._emit = worker.emit
        self._test = test
        self._names = [fixture.name for fixture in worker.current.fixtures_of(test)]
        self._failed: list[Verdict] = []  # the verdicts of earlier attempts, which nothing hides
        self._cases = CaseTests(
            test,
            self._run.results.tests[test.id].planned,
            self._emit,
            self._verdict_of_case,
            live=not (self._names or self._run.retries_of(test) or self._run.repetition_of(test)),
        )

    def run(self) -> int:
        """Run the test up to its final end. Returns how many of the test and its cases did not pass."""
        obstacle = self._obstacle()
        if obstacle is not None:
            self._never_started(*obstacle)
        else:
            self._run_attempts()
        verdict = self._run.results.tests[self._test.id].verdict
        return self._cases.failures + (verdict is not None and not verdict.good)

    def bring_up(self) -> bool:
        """Bring up the fixtures of the test. False: it cannot start, and :meth:`run` only reports why."""
        return self._obstacle() is None and not self._bring_up()

    def _bring_up(self) -> str:
        return self._supervisor.bring_up(self._names) if self._names else ""

    def _obstacle(self) -> tuple[Verdict, str, str] | None:
        """Return the verdict of a test that cannot start, the reason, and a sentence for people; None if it can."""
        reason = self._worker.stop_reason()
        if reason:
            return Verdict.NOT_RUN, "not run", reason
        if self._test.found is None:
            return Verdict.ERROR, "load", self._test.problem
        unmet = _unmet(self._test, self._run.results, self._run.options.features)
        return None if unmet is None else (unmet[0], "requirement", unmet[1])

    def _never_started(self, verdict: Verdict, reason: str, detail: str) -> None:
        self._cases.give_up(verdict, reason, detail)
        test = self._test.id
        self._emit(TestEnded(test=test, verdict=verdict, outcome=verdict, attempt=0, reason=reason, detail=detail))

    def _run_attempts(self) -> None:
        retries = self._run.retries_of(self._test) if self._test.expected is Expected.PASS else 0
        reruns = 1
        attempt = 0
        retried = 0
        while True:
            problem = self._bring_up()
            if problem:
                self._not_up(attempt, problem)
                return
            attempt += 1
            outcome = self._attempt(attempt)
            if outcome.verdict is Verdict.FIXTURE_LOST:
                again = reruns > 0 and self._lost_policy() is LostPolicy.RERUN
                reruns -= 1
            else:
                bad = outcome.verdict in _RETRIED or (outcome.verdict.good and self._cases.any_bad)
                again = bad and retried < retries
                retried += 1
            again = again and not self._worker.stop_reason()
            self._cases.end_attempt(outcome.verdict, outcome.detail, again=again)
            self._ended(attempt, outcome, final=not again)
            if not again:
                return
            if outcome.verdict in _RETRIED:
                self._failed.append(outcome.verdict)

    def _not_up(self, attempt: int, problem: str) -> None:
        """Report the final end of a test that cannot be started, or not once more."""
        reason = self._worker.stop_reason()
        if self._failed:
            detail = f"it did not pass, and was not tried again: {reason or problem}"
            self._never_started(_worst(self._failed), "fixture", detail)
        elif reason:
            verdict = Verdict.INTERRUPTED if attempt else Verdict.NOT_RUN
            self._never_started(verdict, "interrupted" if attempt else "not run", reason)
        else:
            self._never_started(Verdict.FIXTURE_LOST if attempt else Verdict.BLOCKED, "fixture", problem)

    def _lost_policy(self) -> LostPolicy:
        for entry in self._worker.current.fixtures:
            if entry.name in self._names and entry.on_lost is not None and self._supervisor.lost([entry.name]):
                return entry.on_lost
        return self._test.on_lost

    # One attempt -------------------------------------------------------------------------------------------------

    def _attempt(self, count: int) -> Outcome:
        worker = self._worker
        worker.running = self._test.id
        isolation = self._run.options.isolation or self._test.isolation
        job = self._job(count, last=isolation is not Isolation.SUITE)
        began = clock.now()
        if isolation is Isolation.NONE:
            outcome = run_in_process(job, self._emit, self._cases.take)
        else:
            attempt = Attempt(
                job,
                self._run.limits_of(worker.current, self._test),
                worker.fork_server,
                self._emit,
                tick=self._tick,
                next_tick=worker.next_tick,
                kill_now=worker.kills_test,
                take_case=self._cases.take,
                ask=self._run.control.ask,
                fixtures=self._supervisor.generations(self._names),
            )
            outcome = attempt.run(worker.shared_child if isolation is Isolation.SUITE else None)
            if attempt.stop and isolation is Isolation.SUITE:
                worker.end_shared()  # what stopped this test must not reach the next one
        outcome = self._confirmed(outcome)
        if outcome.cut_short:
            self._supervisor.enter_safe_state(self._names)
        if not outcome.verdict.good and outcome.verdict is not Verdict.INTERRUPTED:
            failed = FailedTest(test=job.id, folder=job.folder, began=began, ended=clock.now())
            self._supervisor.explain(self._names, failed)
        worker.running = ""
        return outcome

    def _tick(self) -> Stop | None:
        self._supervisor.watch()
        lost = self._supervisor.lost(self._names) if self._names else ""
        return Stop(Verdict.FIXTURE_LOST, "fixture", lost) if lost else self._worker.stop_of_test()

    def _confirmed(self, outcome: Outcome) -> Outcome:
        """Return the outcome, or *fixture lost* if a fixture of the test is not up any more."""
        if not self._names or outcome.verdict in (Verdict.FIXTURE_LOST, Verdict.INTERRUPTED):
            return outcome
        if outcome.verdict in _RETRIED:
            self._settle()
        self._supervisor.confirm(self._names)
        lost = self._supervisor.lost(self._names)
        if not lost:
            return outcome
        detail = f"{lost} (the test itself had come to: {outcome.verdict})"
        return replace(outcome, verdict=Verdict.FIXTURE_LOST, reason="fixture", detail=detail, cut_short=True)

    def _settle(self) -> None:
        """Wait a moment, because a program that dies closes its connections before its end can be seen.

        A test that failed only because of this must not be blamed for it.
        """
        deadline = clock.Deadline.after(_SETTLING)
        while not deadline.expired and not self._supervisor.lost(self._names):
            self._worker.reactor.run_once(deadline)

    def _job(self, attempt: int, *, last: bool) -> Job:
        test, options = self._test, self._run.options
        if test.found is None:
            raise RuntimeError(f"test {test.id} has no plug-in and cannot be run")
        folder = f"{options.run_folder}/files/{test.id}"
        return Job(
            kind="test",
            id=test.id,
            name=test.name,
            plugin=test.found,
            folder=folder if attempt == 1 else f"{folder}.attempt{attempt}",
            run_folder=str(options.run_folder),
            use=Use.of(test, options.overrides),
            repetition=self._run.repetition_of(test),
            attempt=attempt,
            memory=options.memory,
            can_ask=self._run.control.attended,
            last=last,
            variables=self._supervisor.variables(self._names),
            values=self._worker.fixture_values(self._names),
            terminal=options.terminal,
            core_dumps=options.core_dumps,
            cases=self._cases.begin(attempt),
        )

    # The verdict -------------------------------------------------------------------------------------------------

    def _ended(self, attempt: int, outcome: Outcome, *, final: bool) -> None:
        verdict = outcome.verdict
        if final:
            as_expected = self._test.expected is Expected.FAIL and verdict.good and self._cases.any_bad
            verdict = self._final_verdict(Verdict.FAILED if as_expected else verdict, self._failed)
        detail, why = outcome.detail, self._test.expected_reason
        if verdict is Verdict.EXPECTED_FAILURE and why:
            detail = f"{why}: {detail}"
        elif verdict is Verdict.UNEXPECTED_PASS:
            detail = f"expected to fail{': ' + why if why else ''}"
        self._emit(
            TestEnded(
                test=self._test.id,
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

    def _verdict_of_case(self, verdict: Verdict, failed: list[Verdict]) -> Verdict:
        """Return the final verdict of a case. If a program is expected to fail, some of its cases may still pass."""
        return verdict if verdict.good and not failed else self._final_verdict(verdict, failed)

    def _final_verdict(self, verdict: Verdict, failed: list[Verdict]) -> Verdict:
        """Return the verdict of the test if its last attempt has ``verdict`` and earlier ones ended with ``failed``."""
        passed = verdict in (Verdict.PASSED, Verdict.MEASURED)
        if self._test.expected is Expected.FAIL:
            if verdict is Verdict.FAILED:
                return Verdict.EXPECTED_FAILURE
            return Verdict.UNEXPECTED_PASS if passed else verdict
        if failed:
            return Verdict.FLAKY if passed else _worst([*failed, verdict])
        if verdict is Verdict.FIXTURE_LOST and self._lost_policy() is LostPolicy.SKIP:
            return Verdict.SKIPPED
        return verdict


def _worst(verdicts: list[Verdict]) -> Verdict:
    """Return the verdict of several attempts that all ended badly: a failure counts more than an error."""
    return Verdict.FAILED if Verdict.FAILED in verdicts else Verdict.ERROR


# Requirements --------------------------------------------------------------------------------------------------------


def _unmet(test: TestEntry, results: RunResult, features: frozenset[str]) -> tuple[Verdict, str] | None:
    """Return the verdict of a test of which a requirement does not hold, and a sentence for people.

    A test that requires another one (``test:``) is blocked when that did not pass; all else is a reason to skip:
    ``program:NAME`` on the PATH, ``module:NAME`` to import, ``env:NAME`` set, ``file:PATH`` there, or a bare word that
    the command line grants with ``--feature``.
    """
    for token in test.requires:
        kind, separator, name = token.partition(":")
        if token.startswith(TEST_REQUIREMENT):
            other = results.tests.get(name)
            if other is None or not other.good or other.verdict is Verdict.SKIPPED:
                return (Verdict.BLOCKED, f"needs test {name}, which {_state(other)}")
        elif separator and not _there(kind, name, test):
            return (Verdict.SKIPPED, f"requires {_WORDS.get(kind, kind)} {name!r}, which is not there")
        elif not separator and token not in features:
            return (Verdict.SKIPPED, f"requires {token!r}; grant it with --feature {token}")
    return None


def _state(other: TestResult | None) -> str:
    if other is None:
        return "is not in this run"
    bad = next((case for case in other.cases if not case.good), None)
    if bad is not None and other.verdict is not None and other.verdict.good:
        return f"has a case that came to: {bad.verdict} ({bad.name})"
    return f"came to: {other.verdict or 'nothing yet'}"


_WORDS = {"program": "program", "module": "Python module", "env": "environment variable", "file": "file"}


def _there(kind: str, name: str, test: TestEntry) -> bool:
    if kind == "program":
        return shutil.which(name) is not None
    if kind == "module":
        try:
            return importlib.util.find_spec(name) is not None
        except (ImportError, ValueError):
            return False
    if kind == "env":
        return name in os.environ
    if kind == "file":
        beside = Path(test.location.file).parent if test.location.file else Path()
        return (beside / Path(name).expanduser()).exists()
    return False
