"""``recv.priority``: which of several connections delivers, as YARP decides it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

import rtf.clock
from rtf.bottle import Bottle
from rtf.middleware.errors import ConnectError, ProtocolError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.priority import PriorityGroup, of_input
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.modifiers import split
from rtf.middleware.wire.outgoing_message import OutgoingMessage
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.priority import Priority
    from rtf.middleware.wire.incoming_message import IncomingMessage

DATA = Path(__file__).parents[1] / "data" / "yarp_wire"


def priority(sender: str, settings: str = "") -> Priority:
    """Return the priority of a connection with these settings."""
    made = of_input(sender, split("+".join(["tcp", "recv.priority", *filter(None, [settings])]))[1])
    assert made is not None
    return made


def group(*members: Priority) -> PriorityGroup:
    """Return a group of connections; a report fails the test."""
    made = PriorityGroup(pytest.fail)
    for member in members:
        made.add(member)
    return made


class TestDecisions:
    """The messages that are delivered."""

    @pytest.mark.parametrize("version", ["3.12.3", "4.0.0"])
    def test_are_those_of_yarp(self, version: str):
        """Decisions are those recorded at a port of YARP, with weights, rests, and a virtual connection."""
        lines = [line for line in (DATA / version / "priority.txt").read_text().splitlines() if line[:1] != "#"]
        settings = [line.split(" ", 1) for line in lines if line[0] == "/"]
        members = {name: of_input(name, split(f"tcp+{text}")[1]) for name, text in settings}
        chosen = group(*members.values())
        recorded = [line.split() for line in lines if line[0] != "/"]
        decided = [(at, name, f"{chosen.accepts(members[name], float(at)):d}") for at, name, _ in recorded]
        assert decided == [tuple(row) for row in recorded]
        assert len({(name, accepted) for _, name, accepted in decided}) > len(members)  # both decisions occur

    def test_larger_bias_takes_over_and_gives_back(self):
        """A connection with a larger bias blocks others for ``tc`` seconds after its last message."""
        high, low = priority("/high", "bs.20+tc.2"), priority("/low")
        chosen = group(low, high)
        assert chosen.accepts(low, 10.0)
        assert chosen.accepts(high, 10.1)
        assert not chosen.accepts(low, 12.0)
        assert chosen.accepts(low, 12.2)

    def test_oldest_of_equal_ones(self):
        """Of connections with equal bias the first active one delivers while it is active."""
        first, second = priority("/first"), priority("/second")
        chosen = group(first, second)
        assert chosen.accepts(first, 1.0)
        assert not chosen.accepts(second, 1.5)
        assert chosen.accepts(second, 2.1)
        assert chosen.accepts(first, 2.2)

    def test_stimulation_adds_up(self):
        """Stimulations of several messages add up, until the connection delivers."""
        shy = priority("/shy", "st.6")
        chosen = group(shy)
        assert [chosen.accepts(shy, at) for at in (1.0, 2.5, 2.6, 2.7)] == [False, False, True, True]

    def test_rest(self):
        """After ``tc`` seconds of activity nothing is delivered for ``tr`` seconds."""
        worker = priority("/worker", "tc.1+tr.2")
        chosen = group(worker)
        assert [chosen.accepts(worker, at) for at in (5.0, 5.9, 6.1, 7.9, 8.1)] == [True, True, False, False, True]

    def test_virtual_one_acts_on_others(self):
        """A virtual connection delivers nothing, and can inhibit others."""
        chosen = group(speaker := priority("/speaker"), mute := priority("/mute", "virtual+(ex (/speaker -10))"))
        assert chosen.accepts(speaker, 1.0)
        assert not chosen.accepts(mute, 1.1)
        assert not chosen.accepts(speaker, 1.2)
        assert chosen.accepts(speaker, 2.2)

    def test_gone_one_counts_no_more(self):
        """A removed connection does not block others any more."""
        chosen = group(high := priority("/high", "bs.20"), low := priority("/low"))
        assert chosen.accepts(high, 1.0)
        assert not chosen.accepts(low, 1.1)
        chosen.discard(high)
        assert chosen.accepts(low, 1.2)

    def test_contradicting_weights(self):
        """Connections that excite each other without bound deliver nothing, which is reported once."""
        said: list[str] = []
        chosen = PriorityGroup(said.append)
        one, two = priority("/one", "(ex (/two 10))"), priority("/two", "(ex (/one 10))")
        chosen.add(one)
        chosen.add(two)
        assert chosen.accepts(one, 1.0)
        assert not chosen.accepts(two, 1.1)
        assert not chosen.accepts(one, 1.2)
        assert said == ["the weights of its connections contradict each other: their messages are dropped"]

    @given(
        st.lists(st.tuples(st.floats(0.0, 3.0), st.integers(0, 2)), max_size=40),
        st.tuples(*[st.integers(0, 20)] * 3),
        st.tuples(*[st.integers(0, 3)] * 3),
    )
    def test_any_history(self, arrivals: list[tuple[float, int]], biases: tuple[int, ...], times: tuple[int, ...]):
        """Stimulations are within -1 and 1, and a lone active connection with a bias delivers."""
        members = [
            priority(f"/{number}", f"bs.{bias}+tc.{seconds}")
            for number, (bias, seconds) in enumerate(zip(biases, times, strict=True))
        ]
        chosen, now = group(*members), 0.0
        for pause, number in arrivals:
            now += pause
            source = members[number]
            accepted = chosen.accepts(source, now)
            rivals = [one for one in members if one is not source and one.active]
            assert source.active
            assert all(-1.0 <= one.level(now) <= 1.0 for one in members)
            assert not accepted or all(one.bias <= source.bias for one in rivals)
            assert accepted or source.bias == 0 or any(one.bias >= source.bias for one in rivals)


class TestSettings:
    """The modifiers of a priority."""

    @pytest.mark.parametrize(
        ("modifiers", "words"),
        [
            ("recv.else+file.x", r"no modifier recv\.else; there are recv\.priority and recv\.portmonitor"),
            ("recv.priority+level.15", r"recv\.priority has no setting 'level'; its settings are tc, tr, st"),
            ("recv.priority+tc.0.5", r"recv\.priority: tc is one whole number, as in tc\.2, not '0 5'"),
            ("recv.priority+bs.much", "bs is one whole number"),
            ("recv", r"no modifier recv\."),
        ],
    )
    def test_unknown_ones_are_refused(self, modifiers: str, words: str):
        """An unknown modifier or setting is refused by name."""
        with pytest.raises(ProtocolError, match=words):
            of_input("/a", split(f"tcp+{modifiers}")[1])

    def test_none(self):
        """A connection without receiving modifiers has no priority."""
        assert of_input("/a", "") is of_input("/a", "(send portmonitor) (file x)") is of_input("/a", "(ack)") is None
        assert of_input("/a", "(send portmonitor) (file x) (recv priority)") is not None
        assert of_input("/a", "(ack) (recv priority) (tc 1)") is not None


@pytest.fixture
def got() -> list[str]:
    """The delivered messages."""
    return []


@pytest.fixture
def reader(network: Network, got: list[str]) -> Iterator[Port]:
    """A port with several writers."""

    def receive(message: IncomingMessage) -> None:
        got.append(message.read().to_text())
        message.reply(Bottle(["taken"]))

    with Port("/reader", receive, network=network) as port:
        yield port


class Watch(rtf.clock.Clock):
    """A clock that the test sets."""

    at = 100.0

    def now(self) -> float:
        return self.at

    def sleep(self, seconds: float) -> None:
        self.at += seconds


class TestPorts:
    """Connections between ports."""

    @pytest.mark.parametrize("carrier", ["tcp", "text_ack", "unix_stream+ack"])
    def test_important_writer_takes_over(self, network: Network, reader: Port, got: list[str], carrier: str):
        """The priority applies to every carrier, by the robot's clock, and both ends list the modifiers."""
        with (
            Port("/high", network=network) as high,
            Port("/low", network=network) as low,
            rtf.clock.use(Watch()) as watch,
        ):
            high.add_output("/reader", f"{carrier}+recv.priority+bs.20")
            low.add_output("/reader", f"{carrier}+recv.priority+bs.10+tc.2")
            assert [one.carrier for one in high.outputs] == [f"{carrier}+recv.priority+bs.20"]
            eventually(
                lambda: (
                    [one.carrier for one in reader.inputs]
                    == [f"{carrier}+recv.priority+bs.20", f"{carrier}+recv.priority+bs.10+tc.2"]
                ),
                "the connections are not listed with modifiers",
            )
            low.write(Bottle(["low", 1]))
            high.write(Bottle(["high", 1]))
            low.write(Bottle(["low", 2]))
            watch.sleep(1.5)
            low.write(Bottle(["low", 3]))
            assert got == ["low 1", "high 1", "low 3"]

    def test_datagrams(self, network: Network, reader: Port, got: list[str]):
        """A connection by datagrams has its modifiers, too."""
        with Port("/writer", network=network) as writer:
            writer.add_output("/reader", "udp+recv.priority+virtual")
            assert [one.carrier for one in reader.inputs if one.peer == "/writer"] == ["udp+recv.priority+virtual"]

    def test_without_modifiers(self, network: Network, reader: Port, got: list[str]):
        """A connection without a priority always delivers."""
        with Port("/high", network=network) as high, Port("/plain", network=network) as plain:
            high.add_output("/reader", "tcp+recv.priority+bs.90")
            plain.add_output("/reader", "tcp")
            high.write(Bottle([1]))
            plain.write(Bottle([2]))
            assert got == ["1", "2"]

    def test_dropped_request(self, network: Network, reader: Port, got: list[str]):
        """A request that is not delivered has an empty reply, so that the client does not wait."""
        with Port("/writer", network=network) as writer:
            writer.add_output("/reader", "tcp+recv.priority+virtual")
            message = OutgoingMessage("d", Bottle([1]), BOTTLE, network.dialect)
            assert writer.outputs[0].call(message, BOTTLE, 5.0) == Bottle()
            assert got == []

    @pytest.mark.parametrize(
        ("carrier", "words"),
        [
            ("tcp+send.portmonitor+file.x", "has the type lua or py, not 'none'"),
            ("tcp+send.else", r"no modifier send\.else; there is send\.portmonitor"),
            ("tcp+log.in", r"no modifier log\.in"),
            ("tcp+colour.red", r"no modifier 'colour'; there are recv\.priority"),
            ("tcp+recv.priority+level.1", "no setting 'level'"),
            ("tcp+recv.else+file.x", "Cannot connect to /reader"),
            ("tcp+(recv", "cannot be read"),
            ("local+recv.priority", "local takes no modifiers"),
            ("nothing+recv.priority", "no carrier 'nothing'"),
            ("tcp+recv.priority+(ex (/" + 1000 * "a" + " 1))", "too long"),
        ],
    )
    def test_refused(self, network: Network, reader: Port, said: list[str], carrier: str, words: str):
        """An unknown modifier is refused, by the end that would have to know it."""
        with Port("/writer", network=network) as writer:
            with pytest.raises(ConnectError, match=words):
                writer.add_output("/reader", carrier)
            assert writer.outputs == ()
        if "recv.else" in carrier:
            eventually(lambda: any("no modifier recv.else" in line for line in said), "nothing is reported")

    def test_settings_are_asked_for_and_changed(self, network: Network, reader: Port):
        """Settings can be read and changed by administration, as with YARP's ports."""
        with Port("/writer", network=network) as writer:
            carrier = "tcp+recv.priority+tc.2+(ex (/b -20))"
            assert remote.connect(network, Contact(writer.name), Contact(reader.name), carrier).startswith(
                "Added connection"
            )
            ask = lambda text: remote.administer(network, reader.contact, Bottle.parse(text))  # noqa: E731
            settings = ask("[get] [in] /writer")[0]
            assert {str(pair[0]): pair[1] for pair in settings} == {
                "tc": 2.0,
                "tr": 0.0,
                "st": 1.0,
                "bs": 1.0,
                "virtual": 0,
                "ex": 'ex ("/b" -20.0)',
            }
            reply = ask("[set] [in] /writer (tc 0.5) (bs 3.5) (virtual 1) (ex (/c 5))")
            assert reply == Bottle([0, "Configured connection from /writer\r\n"])
            changed = {str(pair[0]): pair[1] for pair in ask("[get] [in] /writer")[0]}
            assert (changed["tc"], changed["tr"], changed["bs"], changed["virtual"]) == (0.5, 0.0, 3.5, 1)
            assert changed["ex"] == 'ex ("/c" 5.0)'
