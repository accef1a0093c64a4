"""Courses: what is done with a joint, written so that several joints are worked with at the same time.

A course is a generator that yields where time has to pass, a beat at a time. :func:`finish` goes through a single one;
:func:`work` goes through those of many joints, in queues that are all worked through at once, each of them round after
round. What a course finds out it judges at its end, in a sub-result, for until then others have their turns.
"""

from __future__ import annotations

import math
from contextlib import ExitStack
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from rtf.robot_testing.companions import queues
from rtf.robot_testing.guard import GuardError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Mapping, Sequence

    from rtf.clock import Clock
    from rtf.robot_testing.part import Part

T = TypeVar("T")
#: What yields at every beat, and returns something in the end.
Course: TypeAlias = "Generator[None, None, T]"


def until(clock: Clock, condition: Callable[[], bool], timeout: float) -> Course[bool]:
    """Wait until a condition holds; False when it does not within ``timeout`` s of the robot's time."""
    end = clock.now() + timeout
    while True:
        now = clock.now()  # before the look, or a process that was held up in between would never have looked
        if condition():
            return True
        if now >= end:
            return False
        yield None


def pause(clock: Clock, seconds: float) -> Course[bool]:
    """Let time pass, to the first beat after so many seconds."""
    return until(clock, lambda: False, seconds)


def finish(part: Part, course: Course[T], *, pace: float) -> T:
    """Go through one course with beats ``pace`` s apart; the guard looks on. Raises GuardError."""
    while True:
        try:
            next(course)
        except StopIteration as end:
            result: T = end.value
            return result
        part.clock.sleep(pace)
        if part.guard is not None:
            part.guard.watch()


def singly(names: Sequence[str], joints: Iterable[int]) -> list[list[list[int]]]:
    """Queues in each of which a single joint has its turn at a time: an arm and its hand, a neck and its eyes."""
    return [[[joint] for members in queue for joint in members] for queue in queues(names, joints)]


def work(
    part: Part, rounds: Sequence[Sequence[Sequence[int]]], course: Callable[[int], Course[None]], *, pace: float
) -> None:
    """Go through the courses of joints with beats ``pace`` s apart; the guard looks on.

    ``rounds`` are the queues, each with its rounds, each with its joints, see :mod:`rtf.robot_testing.companions`. A
    joint that the guard has to stop ends its course with GuardError, raised where that one waits, or the course that
    has its turn in its queue; all others go on. A joint that it stops once more is left without power, which nobody but
    its own course hears of. Nothing is made up for beats that come late. Any other error ends, and closes, all courses,
    and so does GuardError when there is no course left to hear of it.
    """
    running: dict[int, Course[None]] = {}
    try:
        _go_on(part, rounds, course, running, pace)
    finally:
        with ExitStack() as closing:
            for one in running.values():
                closing.callback(one.close)


def _go_on(
    part: Part,
    rounds: Sequence[Sequence[Sequence[int]]],
    course: Callable[[int], Course[None]],
    running: dict[int, Course[None]],
    pace: float,
) -> None:
    left = [list(queue) for queue in rounds]
    queue_of = {joint: number for number, queue in enumerate(rounds) for members in queue for joint in members}
    begin, stopped = part.clock.now(), set[int]()
    trip: GuardError | None = None
    while True:
        # Courses that begin now are not there yet to hear of it.
        struck = None if trip is None else _concerned(trip.joint, running, queue_of)
        busy = {queue_of[joint] for joint in running}
        for number, queue in enumerate(left):
            if queue and number not in busy:
                running.update((joint, course(joint)) for joint in queue.pop(0))
        if not running:
            break
        for joint in list(running):
            if not _advance(running[joint], trip if joint == struck else None):
                del running[joint]
        beat = math.floor((part.clock.now() - begin) / pace + _ROUNDING) + 1
        part.clock.sleep(begin + beat * pace - part.clock.now())
        unheard = trip if struck is None else None
        trip = _look(part, stopped, running) or unheard
    if trip is not None:
        raise trip


def _look(part: Part, stopped: set[int], running: Iterable[int]) -> GuardError | None:
    """Have the guard look; what it says that courses have to hear, and in ``stopped`` which joint that was."""
    if part.guard is None:
        return None
    try:
        part.guard.watch()
    except GuardError as error:
        if error.joint in stopped:
            part.guard.give_up(error.joint, "it does again what it may not")
            return error if error.joint in running else None
        stopped.add(error.joint)
        return error
    return None


def _concerned(stopped: int, running: Iterable[int], queue_of: Mapping[int, int]) -> int | None:
    """The joint whose course has to do with one that was stopped: it, one of its queue, or any; None without any."""
    candidates = [*running]
    if stopped in candidates or not candidates:
        return stopped if candidates else None
    return next((joint for joint in candidates if queue_of[joint] == queue_of.get(stopped)), candidates[0])


def _advance(course: Course[None], error: GuardError | None = None) -> bool:
    """Go on to the next beat, or raise an error there; whether the course goes on after that."""
    try:
        if error is None:
            next(course)
        else:
            course.throw(error)
    except StopIteration:
        return False
    return True


#: Of a beat: what clocks that count milliseconds make of a multiple of a period.
_ROUNDING = 1e-3
