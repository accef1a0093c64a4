"""The name server's commands, in the words of a transcript of the real one; and whatever else anybody may type."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.middleware.naming.commands import Commands
from rtf.middleware.naming.pools import Numbers
from rtf.middleware.naming.subscriptions import Subscriptions
from rtf.middleware.naming.table import Table
from rtf.middleware.wire.contact import Contact

END = "*** end of message\r\n"


class Typed:
    """A server without a network: what is typed is answered."""

    def __init__(self) -> None:
        self.events: list[tuple[str, str]] = []
        self.said: list[str] = []
        self.table = Table(Numbers.above(10000))
        self.table.register("/root", "tcp", "127.0.0.1", 10000)
        self.subscriptions = Subscriptions(self.table)
        server = Contact("/root", "127.0.0.1", 10000, "tcp")
        self.commands = Commands(
            self.table, self.subscriptions, server, lambda *event: self.events.append(event), self.said.append
        )

    def __call__(self, line: str, origin: str = "127.0.0.1") -> str:
        """The answer to a line."""
        return self.commands.answer(Bottle.parse(line), origin).to_text()


@pytest.fixture
def typed() -> Typed:
    """A server that gives numbers from 10002."""
    return Typed()


def registration(name: str, number: int, host: str = "127.0.0.1", carrier: str = "tcp") -> str:
    """What a registration is answered by."""
    return f"registration name {name} ip {host} port {number} type {carrier}\r\n"


def test_transcript(typed: Typed):
    """Everything that was tried on the real server, in order."""
    assert typed("query /root") == registration("/root", 10000) + END
    assert typed("query /nosuch") == END
    assert typed("register /t1") == registration("/t1", 10002) + END
    assert typed("register /t2 tcp 127.0.0.1 20001") == registration("/t2", 20001) + END
    assert typed("register ...") == registration("/tmp/port/1", 10003) + END
    assert typed("register ... mcast ... ...") == registration("/tmp/port/2", 10004, "224.1.1.3", "mcast") + END
    assert typed("register /t3 ... ... ... yarp/bottle") == registration("/t3", 10005) + END
    assert typed("set /t1 ips 127.0.0.1 10.0.0.1") == f"port /t1 property ips = 10.0.0.1 127.0.0.1\r\n{END}"
    assert typed("check /t1 ips 10.0.0.1") == f"port /t1 property ips value 10.0.0.1 present true\r\n{END}"
    assert typed("check /t1 ips 10.0.0.2") == f"port /t1 property ips value 10.0.0.2 present false\r\n{END}"
    assert typed("get /t1 nokey") == f"port /t1 property nokey =\r\n{END}"
    assert typed("route /t1 /t2") == f"port /t1 route /t2 = tcp://t2\r\n{END}"
    assert typed("announce /t1") == "[ok]\r\n"
    assert typed("subscribe /a /b") == "[ok]\r\n"
    assert typed("subscribe") == 'subscriptions (subscription (src "/a") (dest "/b"))\r\n'
    assert typed("topic /tt") == "[ok]\r\n"
    assert typed("topic") == '"/tt"\r\n'
    assert typed("type") == "[fail]\r\n"
    assert typed("gc") == f"garbage collection done.\r\n{END}"
    assert typed("bot query /t1") == 'port (name "/t1") (ip "127.0.0.1") (port_number 10002) (carrier tcp)\r\n'
    assert typed("bot query /nosuch") == 'port (error -2 "port not known")\r\n'
    assert typed("bot get /t1 ips") == '"10.0.0.1" "127.0.0.1"\r\n'
    assert typed("bot get /t1 nokey") == "\r\n"
    assert typed("bot set /t1 k b a") == "a b\r\n"
    assert typed("bot runners") == "ports\r\n"
    assert typed("bot check /t1 k a") == f"port /t1 property k value a present true\r\n{END}"
    assert typed("query /t1 (format json)") == typed("bot query /t1")
    for unknown in "foo", "ping", "", "bot", "bot subscribe", "bot announce /t1", "bot topic", "NAME_SERVER":
        assert typed(unknown) == END
    assert typed("unregister /t1") == END
    assert typed("unregister /nosuch") == END
    assert typed("query /t1") == END


def test_help(typed: Typed):
    """The lines, and for machines the same as strings without the heading."""
    lines = typed("help").split("\r\n")
    assert lines[0] == "Here are some ways to use the name server:"
    assert lines[5] == "  (if you want a field set automatically, write '...')"
    assert (len(lines), lines[-2]) == (16, END.strip())
    assert typed("bot help").startswith('"+ help" "+ list [$prefix]" "+ register $portname" ')


def test_lists(typed: Typed):
    """Sorted, by whole parts, plain and for machines; the fallback's name is no string that needs quotes."""
    for line in (
        "register /reader",
        "register /re/b",
        "register fallback mcast 224.2.1.1 10000",
        "set /re/b yarprun true",
    ):
        typed(line)
    assert typed("list /re") == registration("/re/b", 10003) + END
    everything = registration("/re/b", 10003) + registration("/reader", 10002) + registration("/root", 10000)
    assert typed("list") == everything + registration("fallback", 10000, "224.2.1.1", "mcast") + END
    assert typed("list /nosuch") == END
    assert typed("runners") == registration("/re/b", 10003) + END
    assert typed("bot list fallback") == (
        'ports (port (name fallback) (ip "224.2.1.1") (port_number 10000) (carrier mcast))\r\n'
    )
    assert typed("bot list") == typed("list (format json)")


def test_names_with_carriers_and_networks(typed: Typed):
    """The carrier that is asked for is not the one that is registered; a network picks an address."""
    typed("register /t1")
    typed("set /t1 ips 127.0.0.1 10.0.0.1")
    for name in "tcp:/t1", "tcp://t1", "udp://t1":
        assert typed(f"query {name}") == registration("/t1", 10002) + END
    assert typed("query /net=10.0/t1") == registration("/t1", 10002, "10.0.0.1") + END
    assert typed("query /NET=172/t1") == registration("/t1", 10002) + END
    assert typed("query tcp://net=10/t1") == registration("/t1", 10002, "10.0.0.1") + END


def test_where_ports_are(typed: Typed):
    """A port that does not say where it is, is where it was registered from; a topic is at the server."""
    assert typed("register /a", "10.1.2.3") == registration("/a", 10002, "10.1.2.3") + END
    assert typed("register /b tcp ... 5", "10.1.2.3") == registration("/b", 5, "10.1.2.3") + END
    assert typed("register /c udp 10.9.9.9 -1", "10.1.2.3") == registration("/c", 10003, "10.9.9.9", "udp") + END
    assert typed("register /d tcp ... 0", "10.1.2.3") == registration("/d", 10004, "10.1.2.3") + END
    assert typed("register /t topic", "10.1.2.3") == registration("/t", 10000, "127.0.0.1", "topic") + END


def test_types_of_ports(typed: Typed):
    """What a port promises is noted."""
    typed("register /a ... ... -1 yarp/image")
    assert typed("get /a type") == f"port /a property type = yarp/image\r\n{END}"
    typed("register /b ... ... -1 *")
    assert typed("get /b type") == f"port /b property type =\r\n{END}"


def test_machines_get_lines_after_changes(typed: Typed):
    """An odd form of the real server, which is mirrored."""
    assert typed("bot register /zz") == f"port\r\nname /zz\r\nip 127.0.0.1\r\nport_number 10002\r\ncarrier tcp\r\n{END}"
    assert typed("bot unregister /zz") == f"port\r\nerror -2 port not known\r\n{END}"


def test_what_is_owned_goes_too(typed: Typed):
    """The real server says a word for each that is owned."""
    for line in "register /a", "register /b", "set /a owns /b /nosuch":
        typed(line)
    assert typed("unregister /a") == f"old\r\nold\r\n{END}"
    assert typed("list /b") == END


def test_relations_of_types(typed: Typed):
    """Three words note, two ask."""
    assert typed("type a b c") == "[ok]\r\n"
    assert typed("type a b") == "type a b c\r\n"
    assert typed("type a x") == "[fail]\r\n"


def test_events(typed: Typed):
    """Anyone who listens hears of every change, but not of multicast groups."""
    for line in "register /a", "register ... mcast", "set /a owns /tmp/port/1", "unregister /a", "unregister /nosuch":
        typed(line)
    assert typed.events == [("add", "/a"), ("del", "/a")]


def test_values_are_kept_as_they_are_written(typed: Typed):
    """Numbers, lists, quotes: on the way back the same for machines, without quotes for people."""
    typed("register /a")
    assert typed('set /a k 5 (1 2) "two words" 1.0 [ok]') == f"port /a property k = 1 2 1.0 5 ok two words\r\n{END}"
    assert typed("bot get /a k") == "(1 2) 1.0 5 ok (two words)\r\n"


@pytest.mark.parametrize(
    "line", ["register /" + "x" * 2000, 'register "/a b"', 'register "/a\\nb"', "register /a tcp 1.2.3.4 70000"]
)
def test_what_cannot_be_registered(typed: Typed, line: str):
    """It is answered as if it were not known, and nothing is."""
    before = typed("list")
    assert typed(line) == END
    assert typed("list") == before
    assert len(typed.said) == 1
    assert "cannot be registered" in typed.said[0] or "not a port number" in typed.said[0]


_KNOWN = (
    "register unregister query list set get check route runners gc help bot announce subscribe unsubscribe"
    " topic untopic type NAME_SERVER ... -1 0 /a /b /c tcp mcast topic topic:/t from to 127.0.0.1"
    " owns yarprun true /net=1/a =x [ok] () 5 1e9"
)
_WORDS = st.sampled_from([*_KNOWN.split(), "(format json)", "{1 2}"]) | st.text(max_size=20)


@pytest.mark.fuzz
@given(st.lists(st.lists(_WORDS, max_size=7).map(" ".join), max_size=12))
@example(["set /a owns /a", "register /a", "set /a owns /a /b", "register /b", "set /b owns /a", "unregister /a"])
def test_anything_is_answered(lines: list[str]):
    """Whatever is typed: an answer that ends as answers do, in lines that only the server ends."""
    typed = Typed()
    for line in [*lines, "query /root"]:
        answer = typed(line)
        assert answer.endswith("\r\n")
        assert "\n" not in answer.replace("\r\n", "")
        assert answer.count(END) <= 1
    if not any("/root" in line for line in lines):
        assert answer == registration("/root", 10000) + END
