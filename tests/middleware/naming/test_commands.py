"""The commands of the name server, as in a transcript of YARP's server, and any other lines."""

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
    """A name server without a network, which answers lines."""

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
        """Return the answer to a line."""
        return self.commands.answer(Bottle.parse(line), origin).to_text()


@pytest.fixture
def typed() -> Typed:
    """A server whose first number is 10002."""
    return Typed()


def registration(name: str, number: int, host: str = "127.0.0.1", carrier: str = "tcp") -> str:
    """Return the line that answers a registration."""
    return f"registration name {name} ip {host} port {number} type {carrier}\r\n"


def test_transcript(typed: Typed):
    """The commands of the transcript have the recorded answers, in order."""
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
    """Help lists the commands, for machines as strings without the heading."""
    lines = typed("help").split("\r\n")
    assert lines[0] == "Here are some ways to use the name server:"
    assert lines[5] == "  (if you want a field set automatically, write '...')"
    assert (len(lines), lines[-2]) == (16, END.strip())
    assert typed("bot help").startswith('"+ help" "+ list [$prefix]" "+ register $portname" ')


def test_lists(typed: Typed):
    """Lists are sorted and filtered by whole parts of names; machines get them as bottles."""
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
    """A carrier before a name does not change the answer; a network chooses the address."""
    typed("register /t1")
    typed("set /t1 ips 127.0.0.1 10.0.0.1")
    for name in "tcp:/t1", "tcp://t1", "udp://t1":
        assert typed(f"query {name}") == registration("/t1", 10002) + END
    assert typed("query /net=10.0/t1") == registration("/t1", 10002, "10.0.0.1") + END
    assert typed("query /NET=172/t1") == registration("/t1", 10002) + END
    assert typed("query tcp://net=10/t1") == registration("/t1", 10002, "10.0.0.1") + END


def test_where_ports_are(typed: Typed):
    """A port without a host is at the address of the caller, a topic at the address of the server."""
    assert typed("register /a", "10.1.2.3") == registration("/a", 10002, "10.1.2.3") + END
    assert typed("register /b tcp ... 5", "10.1.2.3") == registration("/b", 5, "10.1.2.3") + END
    assert typed("register /c udp 10.9.9.9 -1", "10.1.2.3") == registration("/c", 10003, "10.9.9.9", "udp") + END
    assert typed("register /d tcp ... 0", "10.1.2.3") == registration("/d", 10004, "10.1.2.3") + END
    assert typed("register /t topic", "10.1.2.3") == registration("/t", 10000, "127.0.0.1", "topic") + END


def test_types_of_ports(typed: Typed):
    """The type of a registration is the property ``type`` of the port."""
    typed("register /a ... ... -1 yarp/image")
    assert typed("get /a type") == f"port /a property type = yarp/image\r\n{END}"
    typed("register /b ... ... -1 *")
    assert typed("get /b type") == f"port /b property type =\r\n{END}"


def test_machines_get_lines_after_changes(typed: Typed):
    """Changes by ``bot`` are answered with a line for each field, as by YARP's server."""
    assert typed("bot register /zz") == f"port\r\nname /zz\r\nip 127.0.0.1\r\nport_number 10002\r\ncarrier tcp\r\n{END}"
    assert typed("bot unregister /zz") == f"port\r\nerror -2 port not known\r\n{END}"


def test_what_is_owned_goes_too(typed: Typed):
    """Unregistering a port unregisters those that it owns, with a word for each, as by YARP's server."""
    for line in "register /a", "register /b", "set /a owns /b /nosuch":
        typed(line)
    assert typed("unregister /a") == f"old\r\nold\r\n{END}"
    assert typed("list /b") == END


def test_relations_of_types(typed: Typed):
    """``type`` with three words stores a relation, and with two words returns it."""
    assert typed("type a b c") == "[ok]\r\n"
    assert typed("type a b") == "type a b c\r\n"
    assert typed("type a x") == "[fail]\r\n"


def test_events(typed: Typed):
    """Every registration and removal is an event, but for multicast groups."""
    for line in "register /a", "register ... mcast", "set /a owns /tmp/port/1", "unregister /a", "unregister /nosuch":
        typed(line)
    assert typed.events == [("add", "/a"), ("del", "/a")]


def test_values_are_kept_as_they_are_written(typed: Typed):
    """Machines get values as they were set, people get them without quotes and brackets."""
    typed("register /a")
    assert typed('set /a k 5 (1 2) "two words" 1.0 [ok]') == f"port /a property k = 1 2 1.0 5 ok two words\r\n{END}"
    assert typed("bot get /a k") == "(1 2) 1.0 5 ok (two words)\r\n"


@pytest.mark.parametrize(
    "line", ["register /" + "x" * 2000, 'register "/a b"', 'register "/a\\nb"', "register /a tcp 1.2.3.4 70000"]
)
def test_what_cannot_be_registered(typed: Typed, line: str):
    """An invalid registration changes nothing, is answered with the end line, and is reported."""
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
    """Any line has an answer with complete lines and at most one end line."""
    typed = Typed()
    for line in [*lines, "query /root"]:
        answer = typed(line)
        assert answer.endswith("\r\n")
        assert "\n" not in answer.replace("\r\n", "")
        assert answer.count(END) <= 1
    if not any("/root" in line for line in lines):
        assert answer == registration("/root", 10000) + END
