"""The carrier ``human``: two people at two keyboards, each a pipe."""

from __future__ import annotations

import os
import pty
import threading
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator


class Person:
    """A person: the lines that the terminal shows, and a keyboard."""

    def __init__(self, network: Network) -> None:
        self.seen: list[str] = []
        keyboard, self._keys = os.pipe()
        self.network = Network(network.names, report=self.seen.append, keyboard=keyboard)

    def sees(self, *lines: str) -> None:
        """Wait until the person has seen all these, in any order."""
        eventually(lambda: set(lines) <= set(self.seen), f"{lines} are not all in {self.seen}")

    def types(self, *lines: str) -> None:
        """Type lines at the keyboard."""
        os.write(self._keys, "".join(f"{line}\n" for line in lines).encode())

    def close(self) -> None:
        """Close the keyboard."""
        os.close(self._keys)
        assert self.network.keyboard is not None
        os.close(self.network.keyboard)


@pytest.fixture
def people(network: Network) -> Iterator[tuple[Person, Person]]:
    """The persons at the writer and at the reader."""
    both = Person(network), Person(network)
    yield both
    for person in both:
        person.close()


def test_message_is_carried_by_people(people: tuple[Person, Person]):
    """A message and its acknowledgement travel as lines that people type; the writer waits for them."""
    here, there = people
    with Port("/reader", network=there.network) as reader, Port("/writer", network=here.network) as writer:
        writer.add_output("/reader", "human")
        there.sees("/writer sends to /reader by human: type here what its terminal shows")
        written: list[int] = []
        writing = threading.Thread(
            target=lambda: written.append(writer.write(Bottle(["hello", 1, [2.5]]), envelope="7"))
        )
        writing.start()
        here.sees("Type this at the other terminal: human says D 7", "Type this at the other terminal: hello 1 (2.5)")
        there.types("D 7")
        there.sees("Begin with 'human says '")
        there.types("human says D 7", "hello 1 (2.5)")
        with reader.request(5.0) as message:
            assert (message.read(), message.envelope, message.sender) == (Bottle(["hello", 1, [2.5]]), "7", "/writer")
        there.sees("Type this at the other terminal: computers rule!")
        assert written == []
        here.types("computers rule!")
        writing.join(5.0)
        assert written == [1]
        writer.remove_output("/reader")
        eventually(lambda: not reader.inputs, "the reader is not told of the end")


def test_ends_without_input(people: tuple[Person, Person]):
    """Removing an output, or closing a port, ends the wait for typed lines."""
    here, there = people
    with Port("/reader", network=there.network), Port("/writer", network=here.network) as writer:
        writer.add_output("/reader", "human")
        writing = threading.Thread(target=writer.write, args=(Bottle([1]),))
        writing.start()
        here.sees("Type this at the other terminal: 1")
        writer.remove_output("/reader")
        writing.join(5.0)
        assert not writing.is_alive()


def test_end_of_what_is_typed(people: tuple[Person, Person], network: Network):
    """The end of the keyboard's input ends the connection."""
    here = people[0]
    keyboard = os.open(os.devnull, os.O_RDONLY)
    there = Network(network.names, keyboard=keyboard)
    with Port("/reader", network=there) as reader, Port("/writer", network=here.network) as writer:
        writer.add_output("/reader", "human")
        eventually(lambda: not reader.inputs, "the input is left")
    os.close(keyboard)


def test_no_keyboard(people: tuple[Person, Person], network: Network, said: list[str]):
    """A program without a keyboard refuses the carrier, so that no peer can make it read its terminal."""
    with Port("/reader", network=network) as reader, Port("/writer", network=people[0].network) as writer:
        writer.add_output("/reader", "human")
        eventually(lambda: said, "nothing is reported")
        assert "nobody is at the keyboard of this program, as at that of rtf read and rtf write" in said[0]
        assert not reader.inputs


def test_program_in_the_background(network: Network, people: tuple[Person, Person]):
    """A program in the background is recognized; it must not read the terminal, or the kernel would stop it."""
    master, terminal = pty.openpty()
    child = os.fork()
    if child == 0:  # the leader of a session with this terminal; its child is in the background
        os.setsid()
        os.close(os.open(os.ttyname(terminal), os.O_RDWR))
        background = os.fork()
        if background == 0:
            os.setpgid(0, 0)
            from rtf.middleware.carriers.human import _in_background

            os._exit(7 if _in_background(terminal) else 1)
        os._exit(os.waitstatus_to_exitcode(os.waitpid(background, 0)[1]))
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    os.close(master)
    os.close(terminal)
    assert status == 7
