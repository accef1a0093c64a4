"""The pools of numbers, names and groups that a server hands out, and their order."""

from __future__ import annotations

import pytest

from rtf.middleware.errors import ConnectError
from rtf.middleware.naming.pools import Numbers, Slots, group, group_slots


class TestNumbers:
    """The numbers of TCP ports."""

    def test_begin_two_above_the_server(self):
        """A server at 10000 hands out 10002 to 19999."""
        numbers = Numbers.above(10000)
        assert (numbers.first, numbers.last) == (10002, 19999)
        assert numbers.take("/a") == 10002

    def test_there_are_always_enough(self):
        """A server near the end of the range hands out the standard numbers."""
        assert Numbers.above(60000).first == 10002
        assert Numbers.above(55536).last == 65535

    def test_beside_a_server_that_the_system_placed(self):
        """A server on a port of the system's choice hands out standard numbers, each server from another one on."""
        first, second = Numbers.beside(40001), Numbers.beside(40002)
        assert (first.first, first.last) == (10002, 19999)
        assert first.take("/a") + 1 == second.take("/a")

    def test_a_name_gets_its_number_back(self):
        """A name gets its former number, unless that is held."""
        numbers = Numbers(1, 9)
        assert numbers.take("/a") == 1
        assert numbers.take("/b") == 2
        assert numbers.take("/a") == 1
        numbers.hold(1)
        assert numbers.take("/a") == 3

    def test_free_ones_are_used_again_only_when_all_were_used(self):
        """A released number goes to another name only when no unused one is left."""
        numbers = Numbers(1, 3)
        for name in "/a", "/b":
            number = numbers.take(name)
            numbers.hold(number)
            numbers.release(number)
        assert numbers.take("/c") == 3
        numbers.hold(3)
        assert numbers.take("/d") == 1
        numbers.hold(1)
        assert numbers.take("/a") == 2, "its number belongs to another now"

    def test_what_others_chose_is_passed_over(self):
        """A number that a port chose itself is not handed out."""
        numbers = Numbers(1, 9)
        numbers.hold(1)
        numbers.hold(2)
        assert numbers.take("/a") == 3

    def test_the_end(self):
        """When all numbers are held, the error names the command that removes dead ports."""
        numbers = Numbers(1, 2)
        numbers.hold(1)
        numbers.hold(2)
        with pytest.raises(ConnectError, match="rtf clean"):
            numbers.take("/a")
        numbers.release(2)
        assert numbers.take("/a") == 2

    def test_remembers_no_more_than_there_are(self):
        """The pool remembers at most as many names as it has numbers."""
        numbers = Numbers(1, 5)
        for index in range(100):
            numbers.take(f"/{index}")
        assert len(numbers.owner) == len(numbers._preferred) == 5


class TestSlots:
    """The pool of temporary names and multicast groups."""

    def test_free_ones_first(self):
        """Returned slots are handed out before new ones, in the order of their return."""
        slots = Slots(5)
        assert [slots.take() for _ in range(3)] == [1, 2, 3]
        slots.give_back(2)
        slots.give_back(1)
        assert [slots.take() for _ in range(3)] == [2, 1, 4]

    def test_the_end(self):
        """When all slots are in use, taking one is an error until one is returned."""
        slots = Slots(1)
        slots.take()
        with pytest.raises(ConnectError, match="rtf clean"):
            slots.take()
        slots.give_back(1)
        assert slots.take() == 1

    def test_go_on_after_a_restart(self):
        """After a restart used slots stay taken, and the others are free."""
        slots = Slots(9)
        slots.resume(4, {2, 4})
        assert [slots.take() for _ in range(4)] == [1, 3, 5, 6]

    def test_do_not_believe_what_cannot_be(self):
        """A stored counter beyond the last slot is ignored."""
        slots = Slots(3)
        slots.resume(10**12, set())
        assert [slots.take() for _ in range(3)] == [1, 2, 3]


def test_groups_of_two_servers():
    """Two servers on ports of the system's choice begin with different groups."""
    assert group(group_slots(40001).take()) != group(group_slots(40002).take())
    assert group(group_slots(65535).take()).startswith("224.1.")


def test_groups():
    """Groups begin at 224.1.1.3, as YARP's server counts them, without zero bytes."""
    assert [group(1), group(2), group(252), group(253), group(254)] == [
        "224.1.1.3",
        "224.1.1.4",
        "224.1.1.254",
        "224.1.1.255",
        "224.1.2.1",
    ]
    assert group(255 * 255 - 2) == "224.1.255.255"
