"""The lines between clients and name servers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.middleware.errors import AddressError
from rtf.middleware.naming.network_interfaces import own_addresses
from rtf.middleware.naming.port_query import PortQuery
from rtf.middleware.wire.contact import Contact, is_host
from rtf.middleware.wire.name_server_lines import command, read_registration, register_command, registration

_NAMES = st.text(st.characters(exclude_categories=("Cc", "Cs", "Z")), min_size=1, max_size=30)


@given(_NAMES, st.from_regex(r"[a-z0-9-]{1,20}(\.[a-z0-9-]{1,20}){0,3}", fullmatch=True), st.integers(0, 65535), _NAMES)
def test_registrations_are_read_as_they_are_written(name: str, host: str, port: int, carrier: str):
    """A contact whose fields have no blanks is the same after writing and reading."""
    contact = Contact(f"/{name}", host, port, carrier)
    assert read_registration(registration(contact)) == contact


@given(
    st.text(max_size=80)
    | st.lists(st.sampled_from(["registration", "name", "ip", "port", "type", "/a", "5", "x"])).map(" ".join)
)
def test_any_line_can_be_read(line: str):
    """Any line is a valid registration, or None."""
    found = read_registration(line)
    assert found is None or (0 <= found.port <= 65535 and is_host(found.host))


def test_names_that_are_keywords():
    """A contact whose fields are keywords of the line is the same after writing and reading."""
    contact = Contact("port", "ip", 5, "name")
    assert read_registration(registration(contact)) == contact


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        (("/w", "", "", 0, ""), "register /w"),
        (("", "", "", 0, ""), "register ..."),
        (("/w", "", "", 0, "yarp/vector"), "register /w ... ... -1 yarp/vector"),
        (("", "mcast", "", 0, ""), "register ... mcast ... ..."),
        (("/x", "tcp", "127.0.0.1", 10500, ""), "register /x tcp 127.0.0.1 10500"),
        (("/x", "tcp", "::1", 10500, "yarp/image"), "register /x tcp ::1 10500 yarp/image"),
        (("/x", "", "", 10500, ""), "register /x ... ... 10500"),
    ],
)
def test_registering_is_said_as_real_clients_do(fields: tuple[str, str, str, int, str], expected: str):
    """The command of a registration leaves out default fields, as YARP's clients do."""
    assert register_command(*fields) == expected


@given(st.lists(st.text(st.characters(exclude_characters="\r\n\0", exclude_categories=("Cs",))), max_size=5))
def test_words_arrive_as_they_are(words: list[str]):
    """The server reads each argument of a command as it was given."""
    from rtf.bottle import to_string

    assert [to_string(value) for value in Bottle.parse(command(*words))] == words


def test_words_are_bare_where_they_can_be():
    """Arguments have quotes only where they need them, as YARP's clients write them."""
    assert command("set", "/x", "ips", "127.0.0.1", "::1", "9977") == "set /x ips 127.0.0.1 ::1 9977"
    assert command("set", "/x", "k", "two words", "1e3", "") == 'set /x k "two words" "1e3" ""'


@pytest.mark.parametrize("bad", ["a\nb", "a\rb", "a\0b"])
def test_one_line_is_one_line(bad: str):
    """An argument with a line end or a zero byte is refused."""
    with pytest.raises(AddressError, match="more than one line"):
        command("query", bad)


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("/a", PortQuery("/a")),
        ("tcp:/a", PortQuery("/a", "tcp")),
        ("tcp://a/b", PortQuery("/a/b", "tcp")),
        ("topic:/t", PortQuery("/t", "topic")),
        ("/net=10.0/a", PortQuery("/a", "", "10.0")),
        ("udp://NET=10/a/b", PortQuery("/a/b", "udp", "10")),
        ("/net=10", PortQuery("", "", "10")),
        ("/a:/b", PortQuery("/a:/b")),
        ("fallback", PortQuery("fallback")),
        ("", PortQuery("")),
    ],
)
def test_names_are_taken_apart(text: str, asked: PortQuery):
    """A query has a name, and perhaps a carrier and a network."""
    assert PortQuery.parse(text) == asked


def test_own_addresses():
    """The machine's addresses begin with loopback, have IPv4 before IPv6, and no zones or doubles."""
    addresses = own_addresses()
    assert addresses[0].startswith("127.")
    assert addresses == sorted(addresses, key=lambda address: ":" in address)
    assert len(set(addresses)) == len(addresses)
    assert not any("%" in address for address in addresses)
    assert all(":" not in address for address in own_addresses(inet6=False))
