"""The explorer of schedules finds the known kinds of faults, and none in correct programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from schedules import ScheduleError, explore, start, together

if TYPE_CHECKING:
    from collections.abc import Callable

    from schedules import Control


class TestExplorer:
    """Small programs with a fault, which the explorer finds."""

    def test_lost_wake_up_is_found(self):
        """A notification between a check without the lock and the wait is found."""

        class Gate:
            def __init__(self, control: Control) -> None:
                self.open = False
                self.changed = control.Condition()

            def pass_through(self) -> None:
                if not self.open:
                    with self.changed:
                        self.changed.wait()

            def let_in(self) -> None:
                self.open = True
                with self.changed:
                    self.changed.notify_all()

        def program(control: Control) -> None:
            gate = Gate(control)
            together(control, gate.pass_through, gate.let_in)

        with pytest.raises(ScheduleError, match=r"nobody can go on: .*pass_through wants to be notified"):
            explore(program, shared={Gate: ("open",)})

    def test_locks_taken_in_two_orders_are_found(self):
        """Two threads that take two locks in opposite orders are found."""

        def program(control: Control) -> None:
            one, other = control.Lock(), control.Lock()
            together(control, both(one, other), both(other, one))

        def both(first: object, second: object) -> Callable[[], None]:
            def take() -> None:
                with first, second:  # type: ignore[attr-defined]
                    pass

            return take

        with pytest.raises(ScheduleError, match=r"main wants to take a lock, take wants to take a lock"):
            explore(program, preemptions=1)
        assert explore(program, preemptions=0) > 0, "without a preemption each of them has both"

    def test_update_that_is_lost_is_found(self):
        """Two threads that change a variable without a lock are found."""

        class Counter:
            count: int

            def __init__(self) -> None:
                self.count = 0

            def add(self) -> None:
                self.count = self.count + 1

        def program(control: Control) -> None:
            counter = Counter()
            together(control, counter.add, counter.add)
            assert counter.count == 2

        with pytest.raises(ScheduleError, match="AssertionError"):
            explore(program, preemptions=1, shared={Counter: ("count",)})

    def test_notification_of_one_whose_time_ran_out_is_found(self):
        """A notification that a thread receives after its timeout, and loses, is found."""

        def program(control: Control) -> None:
            changed, items = control.Condition(), []

            def take(timeout: float | None) -> None:
                with changed:
                    while not items:
                        if not changed.wait(timeout):
                            return  # without another look
                    items.pop()

            def put() -> None:
                with changed:
                    items.append(1)
                    changed.notify()

            def quickly() -> None:
                take(1.0)

            def patiently() -> None:
                take(None)

            quick, patient, putting = start(control, quickly, patiently, put)
            quick.join()
            putting.join()
            if not items:
                put()
            patient.join()

        with pytest.raises(ScheduleError, match=r"nobody can go on: .*patiently wants to be notified"):
            explore(program)

    def test_all_schedules_are_tried(self):
        """Two threads of two steps run in all six orders."""
        seen = set()

        def program(control: Control) -> None:
            order = []
            free = control.Lock()

            def steps(who: str) -> None:
                for _ in range(2):
                    with free:
                        order.append(who)

            threads = [control.Thread(target=steps, args=(who,)) for who in "ab"]
            with control.undisturbed():
                for thread in threads:
                    thread.start()
            for thread in threads:
                thread.join()
            seen.add("".join(order))

        explore(program, preemptions=3)
        assert seen == {"aabb", "abab", "abba", "baab", "baba", "bbaa"}

    def test_thread_that_is_left_is_found(self):
        """A thread that never ends is found."""

        def program(control: Control) -> None:
            control.Thread(target=control.Event().wait, name="left").start()

        with pytest.raises(ScheduleError, match="left wants to wait for an event"):
            explore(program)
