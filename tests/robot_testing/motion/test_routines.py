"""Courses of joints: beats, queues, and what becomes of a queue in which the guard stops a joint."""

import pytest

from rtf.robot_testing import GuardError
from rtf.robot_testing.motion.routines import one_at_a_time, pause, run_queues, run_to_end, until

NAMES = ["neck_pitch", "neck_roll", "eyes_tilt", "eyes_version"]


class Scripted:
    """A part without joints: a clock that only sleeps, and a guard that trips when it is told to."""

    def __init__(self, trips=()):
        self.clock = self.guard = self
        self.names = NAMES
        self.time, self.trips, self.idle = 0.0, dict(trips), []

    def now(self):
        """Seconds."""
        return self.time

    def sleep(self, seconds):
        """No time but this passes."""
        assert seconds > 0
        self.time += seconds

    def watch(self):
        """Trip at the beats that were given, for their joints."""
        joint = self.trips.get(round(self.time / 0.1))
        if joint is not None:
            raise GuardError(f"{NAMES[joint]} is too fast", joint)

    def exclude(self, joint, reason):
        """Keep who was left without power."""
        assert reason
        self.idle.append(joint)


def journal(part, beats):
    """A course of so many beats that writes down when it does what, and errors that come meanwhile."""
    lines = []

    def course(joint):
        lines.append((round(part.now(), 3), joint, "begins"))
        try:
            for _ in range(beats):
                yield None
        except GuardError as error:
            lines.append((round(part.now(), 3), joint, str(error)))
            yield None
        lines.append((round(part.now(), 3), joint, "ends"))

    return lines, course


def test_a_course_returns_what_it_finds():
    """A wait ends with what it waits for, or at its time."""
    part = Scripted()
    assert run_to_end(part, until(part, lambda: part.time > 0.25, 1.0), pace=0.1)
    assert part.time == pytest.approx(0.3)
    assert not run_to_end(part, pause(part, 0.15), pace=0.1)
    assert part.time == pytest.approx(0.5)


def test_what_the_guard_stops_ends_a_single_course():
    """Its error is that of the caller."""
    part = Scripted({1: 0})
    with pytest.raises(GuardError, match="neck_pitch"):
        run_to_end(part, pause(part, 1.0), pace=0.1)


def test_queues_go_at_the_same_time_and_their_joints_in_turn():
    """An eye does not wait for the neck, but for the eye before it; the next joint begins when one has ended."""
    part = Scripted()
    lines, course = journal(part, beats=2)
    run_queues(part, one_at_a_time(NAMES, range(4)), course, pace=0.1)
    assert one_at_a_time(NAMES, range(4)) == [[[0], [1]], [[2], [3]]]
    assert [(when, joint) for when, joint, what in lines if what == "begins"] == [(0, 0), (0, 2), (0.3, 1), (0.3, 3)]
    assert part.time == pytest.approx(0.6)


def test_a_trip_concerns_the_queue_of_its_joint_only():
    """The course that has its turn there hears of it, whichever joint of the queue it was; it may still clean up."""
    part = Scripted({1: 3})
    lines, course = journal(part, beats=2)
    run_queues(part, one_at_a_time(NAMES, range(4)), course, pace=0.1)
    assert (0.1, 2, "eyes_version is too fast") in lines
    assert [joint for _, joint, what in lines if what == "ends"] == [0, 2, 1, 3]
    assert part.idle == []


def test_a_round_is_over_when_all_its_joints_are():
    """Joints of a round go together; a trip of one is its own business."""
    part = Scripted({1: 1})
    lines, course = journal(part, beats=2)
    run_queues(part, [[[0, 1], [2]]], course, pace=0.1)
    assert [(when, joint) for when, joint, what in lines if what == "begins"] == [(0, 0), (0, 1), (0.3, 2)]
    assert [(when, joint) for when, joint, what in lines if "fast" in what] == [(0.1, 1)]


def test_a_joint_that_is_stopped_again_is_left_without_power():
    """Once may be an accident; and it is no fault of the joints that have their turns then."""
    part = Scripted({1: 0, 4: 0})
    lines, course = journal(part, beats=3)
    run_queues(part, one_at_a_time(NAMES, range(4)), course, pace=0.1)
    assert part.idle == [0]
    assert [(when, joint) for when, joint, what in lines if "fast" in what] == [(0.1, 0)]


def test_a_joint_of_no_queue_ends_a_course_all_the_same():
    """Nothing that the guard finds is lost."""
    part = Scripted({1: 3})
    lines, course = journal(part, beats=2)
    run_queues(part, [[[0]]], course, pace=0.1)
    assert (0.1, 0, "eyes_version is too fast") in lines


def test_a_course_that_has_just_begun_hears_of_a_trip_at_its_first_beat():
    """A joint that trips as its course has ended is a failure all the same: of the next one, or of all."""
    part = Scripted({3: 0})
    lines, course = journal(part, beats=2)
    run_queues(part, [[[0], [1]]], course, pace=0.1)
    assert [(when, joint) for when, joint, what in lines if "fast" in what] == [(0.4, 1)]
    part = Scripted({3: 0})
    _, course = journal(part, beats=2)
    with pytest.raises(GuardError):
        run_queues(part, [[[0]]], course, pace=0.1)


def test_other_errors_end_all():
    """What a course does not handle is nobody else's to handle; those that wait are closed, and clean up."""
    closed = []

    def course(joint):
        try:
            yield None
            if joint == 0:
                raise ValueError("broken")
            yield None
        finally:
            closed.append(joint)

    with pytest.raises(ValueError, match="broken"):
        run_queues(Scripted(), one_at_a_time(NAMES, range(4)), course, pace=0.1)
    assert closed == [0, 2]


def test_a_late_beat_is_not_made_up_for():
    """The beats after it are where they would have been."""
    part, beats = Scripted(), []

    def course(_joint):
        for number in range(5):
            beats.append(part.time)
            if number == 1:
                part.time += 0.25
            yield None

    run_queues(part, [[[0]]], course, pace=0.1)
    assert beats == pytest.approx([0.0, 0.1, 0.4, 0.5, 0.6])
