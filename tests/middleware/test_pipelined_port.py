"""The pipelined port: it writes without waiting, and waits for all readers at once."""

from __future__ import annotations

import threading
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.ports.pipelined_port import PipelinedPort
from rtf.middleware.ports.port import Port
from waiting import eventually

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network


class Reader:
    """A reader that keeps messages, and can be made to wait."""

    def __init__(self, name: str, network: Network) -> None:
        self.heard: list[int] = []
        self.go_on = threading.Event()
        self.go_on.set()
        self.port = Port(name, self._hear, network=network, outputs=False)

    def _hear(self, delivery) -> None:
        self.go_on.wait(20.0)
        self.heard.append(int(delivery.read().get(0)))

    def close(self) -> None:
        """End the waiting, and close the port."""
        self.go_on.set()
        self.port.close()


def test_it_does_not_wait_until_it_settles(network: Network):
    """``write`` returns at once; after ``settle`` every reader has all messages, in order."""
    with ExitStack() as opened:
        readers = [opened.enter_context(closing(Reader(f"/reader{number}", network))) for number in range(3)]
        port = opened.enter_context(closing(PipelinedPort("/post", network=network)))
        for reader in readers:
            port.add_output(reader.port.name)
        readers[1].go_on.clear()
        assert port.write(Bottle([0])) == 3
        assert readers[1].heard == []
        readers[1].go_on.set()
        port.settle()
        assert [reader.heard for reader in readers] == [[0]] * 3
        for number in range(1, 50):
            port.write(Bottle([number]))
        port.settle()
        assert [reader.heard for reader in readers] == [[*range(50)]] * 3
        assert port.settle(), "with nothing to wait for it settles at once"


def test_messages_are_kept_until_there_are_enough_of_them(network: Network):
    """A batch is sent when it is full, or by ``flush`` or ``settle``, in order and as it was written."""
    with ExitStack() as opened:
        reader = opened.enter_context(closing(Reader("/reader", network)))
        keeps = opened.enter_context(closing(PipelinedPort("/keeps", network=network, together=3)))
        other = opened.enter_context(closing(PipelinedPort("/other", network=network)))
        for port in (keeps, other):
            port.add_output(reader.port.name)
        message = Bottle([0])
        keeps.write(message)
        message[0] = 7
        keeps.write(Bottle([1]))
        other.write(Bottle([100]))
        other.settle()
        assert reader.heard == [100]
        keeps.flush()
        eventually(lambda: reader.heard == [100, 0, 1], "what was kept does not come")
        for number in range(2, 5):
            keeps.write(Bottle([number]))
        eventually(lambda: reader.heard == [100, *range(5)], "there were enough, and they do not come")
        keeps.write(Bottle([5]))
        keeps.settle()
        assert reader.heard == [100, *range(6)]


def test_a_reader_that_is_too_slow_is_cut_off(network: Network, said: list[str]):
    """A reader that exceeds the patience is disconnected with a report; others get all messages."""
    with ExitStack() as opened:
        slow, quick = (opened.enter_context(closing(Reader(name, network))) for name in ("/slow", "/quick"))
        port = opened.enter_context(closing(PipelinedPort("/post", network=network, patience=0.2)))
        for reader in (slow, quick):
            port.add_output(reader.port.name)
        slow.go_on.clear()
        quick_one = next(output for output in port.outputs if output.target.name == "/quick")
        quick_one.link.limit_waiting(20.0)  # however busy the machine is: only the slow one has the short patience
        begin = clock.monotonic()
        for number in range(3):
            port.write(Bottle([number]))
            port.settle()
        assert clock.monotonic() - begin < 15.0
        assert quick.heard == [0, 1, 2]
        assert [output.target.name for output in port.outputs] == ["/quick"]
        assert any("/slow" in sentence for sentence in said)


def test_a_reader_that_goes_away_is_let_go(network: Network):
    """A closed reader is removed, and the others get all messages."""
    with ExitStack() as opened:
        gone, stays = (opened.enter_context(closing(Reader(name, network))) for name in ("/gone", "/stays"))
        port = opened.enter_context(closing(PipelinedPort("/post", network=network, patience=1.0)))
        for reader in (gone, stays):
            port.add_output(reader.port.name)
        port.write(Bottle([0]))
        gone.close()
        port.settle()
        port.write(Bottle([1]))
        port.settle()
        eventually(lambda: len(port.outputs) == 1, "the output to who is gone is still there")
        assert stays.heard == [0, 1]
