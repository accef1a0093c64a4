"""What is handed out, and in which order."""

from __future__ import annotations

import pytest

from rtf.middleware.errors import ConnectError
from rtf.middleware.naming.pools import Numbers, Slots, group, group_slots


class TestNumbers:
    """TCP ports."""

    def test_begin_two_above_the_server(self):
        """The server at 10000 hands out 10002 to 19999."""
        numbers = Numbers.above(10000)
        assert (numbers.first, numbers.last) == (10002, 19999)
        assert numbers.take("/a") == 10002

    def test_there_are_always_enough(self):
        """A server near the end of the range hands out the standard ones."""
        assert Numbers.above(60000).first == 10002
        assert Numbers.above(55536).last == 65535

    def test_beside_a_server_that_the_system_placed(self):
        """They are not the system's, and two servers begin at different ones."""
        first, second = Numbers.beside(40001), Numbers.beside(40002)
        assert (first.first, first.last) == (10002, 19999)
        assert first.take("/a") + 1 == second.take("/a")

    def test_a_name_gets_its_number_back(self):
        """While nobody has it."""
        numbers = Numbers(1, 9)
        assert numbers.take("/a") == 1
        assert numbers.take("/b") == 2
        assert numbers.take("/a") == 1
        numbers.hold(1)
        assert numbers.take("/a") == 3

    def test_free_ones_are_used_again_only_when_all_were_used(self):
        """So that a name finds its own for as long as possible."""
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
        """A number that somebody registered himself is not given to anybody else."""
        numbers = Numbers(1, 9)
        numbers.hold(1)
        numbers.hold(2)
        assert numbers.take("/a") == 3

    def test_the_end(self):
        """When all are held, the error says how to get rid of dead ports."""
        numbers = Numbers(1, 2)
        numbers.hold(1)
        numbers.hold(2)
        with pytest.raises(ConnectError, match="rtf clean"):
            numbers.take("/a")
        numbers.release(2)
        assert numbers.take("/a") == 2

    def test_remembers_no_more_than_there_are(self):
        """However many names come by."""
        numbers = Numbers(1, 5)
        for index in range(100):
            numbers.take(f"/{index}")
        assert len(numbers.owner) == len(numbers._preferred) == 5


class TestSlots:
    """Names for the nameless, and groups."""

    def test_free_ones_first(self):
        """In the order in which they were given back."""
        slots = Slots(5)
        assert [slots.take() for _ in range(3)] == [1, 2, 3]
        slots.give_back(2)
        slots.give_back(1)
        assert [slots.take() for _ in range(3)] == [2, 1, 4]

    def test_the_end(self):
        """It is an error, and over when one is given back."""
        slots = Slots(1)
        slots.take()
        with pytest.raises(ConnectError, match="rtf clean"):
            slots.take()
        slots.give_back(1)
        assert slots.take() == 1

    def test_go_on_after_a_restart(self):
        """Those in use stay so, the others are free."""
        slots = Slots(9)
        slots.resume(4, {2, 4})
        assert [slots.take() for _ in range(4)] == [1, 3, 5, 6]

    def test_do_not_believe_what_cannot_be(self):
        """A counter beyond the end costs nothing."""
        slots = Slots(3)
        slots.resume(10**12, set())
        assert [slots.take() for _ in range(3)] == [1, 2, 3]


def test_groups_of_two_servers():
    """Whose numbers the system chose are not the same, and the first of them is one."""
    assert group(group_slots(40001).take()) != group(group_slots(40002).take())
    assert group(group_slots(65535).take()).startswith("224.1.")


def test_groups():
    """As the real server counts them: the first is 224.1.1.3, and no byte is 0 or more than 255."""
    assert [group(1), group(2), group(252), group(253), group(254)] == [
        "224.1.1.3",
        "224.1.1.4",
        "224.1.1.254",
        "224.1.1.255",
        "224.1.2.1",
    ]
    assert group(255 * 255 - 2) == "224.1.255.255"
