"""A host, such as pytest, chooses the next test: the runner keeps its rules in any order."""

from __future__ import annotations

import threading

from harness import run_suite
from rtf.testing.attempts import Attempts
from rtf.testing.events import FixtureChanged, SuiteEnded, TestEnded
from rtf.testing.verdict import FixtureState, Verdict

FINE = "from rtf.testing import TestCase\nclass Fine(TestCase):\n    def run(self): self.check(True, 'fine')\n"
HANGS = "import threading\n" + FINE.replace("Fine", "Hangs").replace(
    "self.check(True, 'fine')", "threading.Event().wait()"
)
UP = "from rtf.testing import FixtureManager\nclass Up(FixtureManager):\n    pass\n"
SUITE = "<fixture name='up'> up.py </fixture><test name='a'> fine.py </test><test name='b'> {second} </test>"


def conducted(tmp_path, conduct, *, second="fine.py", **options):
    """Run the suite with a function that gets the run, the suite worker and the planned suite."""
    runs = []

    def one_suite(worker):
        conduct(runs[0], worker, runs[0].suites[0])

    return run_suite(
        tmp_path,
        SUITE.format(second=second),
        interfere=runs.append,
        options=options,
        conduct=one_suite,
        fine__py=FINE,
        hangs__py=HANGS,
        up__py=UP,
    )


def test_tests_run_in_the_order_they_are_asked_for(tmp_path):
    """Tests run in the order of the requests; the fixture is up for both, and is torn down after the suite."""

    def backwards(run, worker, planned):
        with worker.at_work(), worker.suite(planned):
            for test in reversed(planned.tests):
                assert Attempts(worker, test).bring_up()
                run.run_test(worker, test)

    outcome = conducted(tmp_path, backwards)
    assert [event.test for event in outcome.of(TestEnded)] == ["s/b", "s/a"]
    states = [event.state for event in outcome.of(FixtureChanged)]
    assert states == [FixtureState.STARTING, FixtureState.READY, FixtureState.STOPPING, FixtureState.STOPPED]
    assert outcome.exit_code == 0


def test_what_is_not_asked_for_is_not_run(tmp_path):
    """A planned test that is not requested ends as not run."""

    def first_only(run, worker, planned):
        with worker.at_work(), worker.suite(planned):
            run.run_test(worker, planned.tests[0])

    outcome = conducted(tmp_path, first_only)
    assert (outcome.verdict("a"), outcome.verdict("b")) == (Verdict.PASSED, Verdict.NOT_RUN)


def test_plan_may_be_emitted_test_by_test(tmp_path):
    """Without planning ahead the journal has only the requested tests."""

    def first_only(run, worker, planned):
        from dataclasses import replace

        with worker.at_work():
            run.plan(replace(planned, tests=planned.tests[:1]))
            with worker.suite(planned):
                run.run_test(worker, planned.tests[0])

    outcome = conducted(tmp_path, first_only, plan_ahead=False)
    assert [*outcome.results.tests] == ["s/a"]
    assert outcome.of(SuiteEnded)[0].counts == {"passed": 1}


def test_abort_stops_one_test_and_no_other(tmp_path):
    """An abort stops the running test with its reason; after it is cleared the next one runs."""
    second = []

    def abort(run, worker, planned):
        hanging, fine = planned.tests[1], planned.tests[0]
        with worker.at_work(), worker.suite(planned):
            assert Attempts(worker, hanging).bring_up()
            timer = threading.Timer(0.2, worker.abort, ["it takes too long"])
            timer.start()
            run.run_test(worker, hanging)
            timer.join()
            second.append(Attempts(worker, fine).bring_up())
            worker.abort("")
            run.run_test(worker, fine)

    outcome = conducted(tmp_path, abort, second="hangs.py")
    assert second == [False]
    assert (outcome.verdict("b"), outcome.detail("b")) == (Verdict.ERROR, "it takes too long")
    assert outcome.verdict("a") is Verdict.PASSED


def test_waiting_ends_when_another_thread_wakes_it(tmp_path):
    """``wake`` from another thread ends a wait."""

    def wait(_run, worker, _planned):
        done = threading.Event()

        def finish():
            done.set()
            worker.wake()

        with worker.at_work():
            threading.Timer(0.05, finish).start()
            worker.wait(done.is_set)

    assert conducted(tmp_path, wait).verdict("a") is Verdict.NOT_RUN
