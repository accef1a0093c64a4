"""Routines of joints: ticks, queues, and a queue in which the guard stops a joint."""

import pytest

from rtf.robot_testing import GuardError
from rtf.robot_testing.motion.routines import one_at_a_time, pause, run_queues, run_to_end, until

NAMES = ["neck_pitch", "neck_roll", "eyes_tilt", "eyes_version"]
TOGETHER = [[], [["eyes_tilt", "eyes_version"]]]


class Scripted:
    """A part without joints: a clock that only advances by sleeping, and a guard that raises scripted errors."""

    def __init__(self, trips=()):
        self.clock = self.guard = self
        self.names = NAMES
        self.time, self.trips, self.idle = 0.0, dict(trips), []
        self.stopped = []

    def now(self):
        """Return the time, in s."""
        return self.time

    def sleep(self, seconds):
        """Advance the time; nothing else does."""
        assert seconds > 0
        self.time += seconds

    def watch(self):
        """Raise the errors that are scripted for this tick."""
        joint = self.trips.get(round(self.time / 0.1))
        if joint is not None:
            self.stopped.append(joint)
            raise GuardError(f"{NAMES[joint]} is too fast", joint)

    def exclude_if_stopped_again(self, joint):
        """Keep the number of a joint that was stopped twice."""
        again = self.stopped.count(joint) > 1
        self.idle += [joint] * again
        return again


def journal(part, ticks):
    """Return the lines of a log, and a routine with ``ticks`` ticks that logs its begin, its end and the errors."""
    lines = []

    def routine(joint):
        lines.append((round(part.now(), 3), joint, "begins"))
        try:
            for _ in range(ticks):
                yield None
        except GuardError as error:
            lines.append((round(part.now(), 3), joint, str(error)))
            yield None
        lines.append((round(part.now(), 3), joint, "ends"))

    return lines, routine


def test_a_routine_returns_its_result():
    """A wait ends when its condition holds, or at its time-out."""
    part = Scripted()
    assert run_to_end(part, until(part, lambda: part.time > 0.25, 1.0), pace=0.1)
    assert part.time == pytest.approx(0.3)
    assert not run_to_end(part, pause(part, 0.15), pace=0.1)
    assert part.time == pytest.approx(0.5)


def test_a_stop_ends_a_single_routine():
    """The caller gets the error of the guard."""
    part = Scripted({1: 0})
    with pytest.raises(GuardError, match="neck_pitch"):
        run_to_end(part, pause(part, 1.0), pace=0.1)


def test_queues_run_in_parallel_and_their_joints_in_turn():
    """An eye waits for the eye before it and not for the neck; a joint begins when the one before has ended."""
    part = Scripted()
    lines, routine = journal(part, ticks=2)
    run_queues(part, one_at_a_time(NAMES, range(4), TOGETHER), routine, pace=0.1)
    assert one_at_a_time(NAMES, range(4), TOGETHER) == [[[0], [1]], [[2], [3]]]
    assert [(when, joint) for when, joint, what in lines if what == "begins"] == [(0, 0), (0, 2), (0.3, 1), (0.3, 3)]
    assert part.time == pytest.approx(0.6)


def test_a_stop_concerns_the_queue_of_its_joint_only():
    """The running routine of the queue gets the error, whichever joint of it was stopped, and may clean up."""
    part = Scripted({1: 3})
    lines, routine = journal(part, ticks=2)
    run_queues(part, one_at_a_time(NAMES, range(4), TOGETHER), routine, pace=0.1)
    assert (0.1, 2, "eyes_version is too fast") in lines
    assert [joint for _, joint, what in lines if what == "ends"] == [0, 2, 1, 3]
    assert part.idle == []


def test_a_group_ends_with_its_last_joint():
    """The joints of a group move together, and each gets its own errors only."""
    part = Scripted({1: 1})
    lines, routine = journal(part, ticks=2)
    run_queues(part, [[[0, 1], [2]]], routine, pace=0.1)
    assert [(when, joint) for when, joint, what in lines if what == "begins"] == [(0, 0), (0, 1), (0.3, 2)]
    assert [(when, joint) for when, joint, what in lines if "fast" in what] == [(0.1, 1)]


def test_a_joint_that_is_stopped_twice_is_excluded():
    """The first time may be an accident; the joints that run then have not failed."""
    part = Scripted({1: 0, 4: 0})
    lines, routine = journal(part, ticks=3)
    run_queues(part, one_at_a_time(NAMES, range(4), TOGETHER), routine, pace=0.1)
    assert part.idle == [0]
    assert [(when, joint) for when, joint, what in lines if "fast" in what] == [(0.1, 0)]


def test_a_stop_of_a_joint_in_no_queue_ends_a_routine():
    """No error of the guard is lost."""
    part = Scripted({1: 3})
    lines, routine = journal(part, ticks=2)
    run_queues(part, [[[0]]], routine, pace=0.1)
    assert (0.1, 0, "eyes_version is too fast") in lines


def test_a_routine_that_has_just_begun_gets_the_error_at_its_first_tick():
    """A joint that is stopped when its routine has ended is a failure of the next one, or of all."""
    part = Scripted({3: 0})
    lines, routine = journal(part, ticks=2)
    run_queues(part, [[[0], [1]]], routine, pace=0.1)
    assert [(when, joint) for when, joint, what in lines if "fast" in what] == [(0.4, 1)]
    part = Scripted({3: 0})
    _, routine = journal(part, ticks=2)
    with pytest.raises(GuardError):
        run_queues(part, [[[0]]], routine, pace=0.1)


def test_other_errors_end_all_routines():
    """An error that a routine does not handle is raised; the other routines are closed, and clean up."""
    closed = []

    def routine(joint):
        try:
            yield None
            if joint == 0:
                raise ValueError("broken")
            yield None
        finally:
            closed.append(joint)

    with pytest.raises(ValueError, match="broken"):
        run_queues(Scripted(), one_at_a_time(NAMES, range(4), TOGETHER), routine, pace=0.1)
    assert closed == [0, 2]


def test_late_ticks_are_skipped():
    """The following ones keep their times."""
    part, ticks = Scripted(), []

    def routine(_joint):
        for number in range(5):
            ticks.append(part.time)
            if number == 1:
                part.time += 0.25
            yield None

    run_queues(part, [[[0]]], routine, pace=0.1)
    assert ticks == pytest.approx([0.0, 0.1, 0.4, 0.5, 0.6])
