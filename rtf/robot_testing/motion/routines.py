"""Routines: generator coroutines that work with single joints, so that several joints can be tested in parallel.

A routine yields wherever time has to pass; it is resumed once a tick. :func:`run_to_end` runs a single routine,
:func:`run_queues` those of many joints: all queues in parallel, the groups of a queue one after the other. A routine
collects its measurements and judges them at its end, in a sub-result: sub-results of parallel routines must not
overlap. By convention a method named by a participle (``moving``) is the routine of the method that waits (``move``).
"""

from __future__ import annotations

import math
from contextlib import ExitStack
from typing import TYPE_CHECKING, Protocol, TypeAlias, TypeVar

from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.motion.joint_queues import queues

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Mapping, Sequence

    from rtf.clock import Clock
    from rtf.robot_testing.guard.motion_guard import MotionGuard

T = TypeVar("T")
#: A generator that yields once a tick and returns a result.
Routine: TypeAlias = "Generator[None, None, T]"


class Guarded(Protocol):
    """What routines are run with: the clock of the robot, and the guard that watches at every tick; None: no guard."""

    clock: Clock
    guard: MotionGuard | None


def until(clock: Clock, condition: Callable[[], bool], timeout: float) -> Routine[bool]:
    """Wait until a condition holds; return False if it does not within ``timeout`` s of the robot's time."""
    end = clock.now() + timeout
    while True:
        now = clock.now()  # before the check: a process suspended in between would time out without having checked
        if condition():
            return True
        if now >= end:
            return False
        yield None


def pause(clock: Clock, seconds: float) -> Routine[bool]:
    """Wait until the first tick after ``seconds`` of the robot's time."""
    return until(clock, lambda: False, seconds)


def run_to_end(part: Guarded, routine: Routine[T], *, pace: float) -> T:
    """Run one routine with a tick every ``pace`` s, and return its result. The guard watches; raises GuardError."""
    while True:
        try:
            next(routine)
        except StopIteration as end:
            result: T = end.value
            return result
        part.clock.sleep(pace)
        if part.guard is not None:
            part.guard.watch()


def one_at_a_time(
    names: Sequence[str], joints: Iterable[int], together: Sequence[Sequence[Sequence[str]]]
) -> list[list[list[int]]]:
    """Return the queues of joints with a single joint in each group: an arm beside its hand, a neck beside its eyes."""
    return [[[joint] for members in queue for joint in members] for queue in queues(names, joints, together)]


def run_queues(
    part: Guarded, joints: Sequence[Sequence[Sequence[int]]], routine: Callable[[int], Routine[None]], *, pace: float
) -> None:
    """Run the routines of joints with a tick every ``pace`` s; the guard watches.

    ``joints`` are the queues, each a list of groups of joints, see :mod:`rtf.robot_testing.motion.joint_queues`. A
    GuardError about a joint is raised inside its routine; if that one does not run, inside the running routine of its
    queue, or else in any. All other routines go on. A joint that the guard stops a second time is excluded, with those
    that share its motors, and only its own routine gets that error. Late ticks are skipped. Any other error closes all
    routines and is raised, and so is a GuardError if no routine is left to take it.
    """
    running: dict[int, Routine[None]] = {}
    try:
        _run_all(part, joints, routine, running, pace)
    finally:
        with ExitStack() as closing:
            for one in running.values():
                closing.callback(one.close)


def _run_all(
    part: Guarded,
    joints: Sequence[Sequence[Sequence[int]]],
    routine: Callable[[int], Routine[None]],
    running: dict[int, Routine[None]],
    pace: float,
) -> None:
    left = [list(queue) for queue in joints]
    queue_of = {joint: number for number, queue in enumerate(joints) for members in queue for joint in members}
    begin = part.clock.now()
    trip: GuardError | None = None
    while True:
        # Before new routines start: they have nothing to do with it.
        concerned = None if trip is None else _concerned(trip.joint, running, queue_of)
        busy = {queue_of[joint] for joint in running}
        for number, queue in enumerate(left):
            if queue and number not in busy:
                running.update((joint, routine(joint)) for joint in queue.pop(0))
        if not running:
            break
        for joint in list(running):
            if not _advance(running[joint], trip if joint == concerned else None):
                del running[joint]
        tick = math.floor((part.clock.now() - begin) / pace + _ROUNDING) + 1
        part.clock.sleep(begin + tick * pace - part.clock.now())
        unhandled = trip if concerned is None else None
        trip = _watch(part, running) or unhandled
    if trip is not None:
        raise trip


def _watch(part: Guarded, running: Iterable[int]) -> GuardError | None:
    """Let the guard watch. Return its error if a routine has to handle it."""
    if part.guard is None:
        return None
    try:
        part.guard.watch()
    except GuardError as error:
        again = part.guard.exclude_if_stopped_again(error.joint)
        return None if again and error.joint not in running else error
    return None


def _concerned(stopped: int, running: Iterable[int], queue_of: Mapping[int, int]) -> int | None:
    """Return the joint whose routine handles a stop: the same joint, one of its queue, or any; None without any."""
    candidates = [*running]
    if stopped in candidates or not candidates:
        return stopped if candidates else None
    return next((joint for joint in candidates if queue_of[joint] == queue_of.get(stopped)), candidates[0])


def _advance(routine: Routine[None], error: GuardError | None = None) -> bool:
    """Resume a routine until its next tick, or raise an error inside it; return whether it goes on."""
    try:
        if error is None:
            next(routine)
        else:
            routine.throw(error)
    except StopIteration:
        return False
    return True


#: Share of a period that clocks of millisecond resolution may be short of its multiple.
_ROUNDING = 1e-3
