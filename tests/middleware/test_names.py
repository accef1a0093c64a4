"""Contacts: the ways to write a port."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.middleware.errors import AddressError
from rtf.middleware.wire.contact import Contact, is_host


@pytest.mark.parametrize(
    ("text", "contact"),
    [
        ("/reader", Contact("/reader")),
        ("/robot/head/state:o", Contact("/robot/head/state:o")),
        ("tcp:/reader", Contact("/reader", carrier="tcp")),
        ("tcp://reader", Contact("/reader", carrier="tcp")),
        ("fast_tcp://robot/cam", Contact("/robot/cam", carrier="fast_tcp")),
        ("tcp+recv.portmonitor+file.x://r", Contact("/r", carrier="tcp+recv.portmonitor+file.x")),
        ("/127.0.0.1:10002", Contact("", "127.0.0.1", 10002)),
        ("/127.0.0.1:10002/", Contact("", "127.0.0.1", 10002)),
        ("tcp://127.0.0.1:10002/reader", Contact("/reader", "127.0.0.1", 10002, "tcp")),
        ("tcp://127.0.0.1:10002/", Contact("", "127.0.0.1", 10002, "tcp")),
        ("udp:/host.example:10002/a/b", Contact("/a/b", "host.example", 10002, "udp")),
        ("tcp://[::1]:10002/reader", Contact("/reader", "::1", 10002, "tcp")),
        ("/[fe80::1]:7", Contact("", "fe80::1", 7)),
        ("/cam:0:9", Contact("/cam:0:9")),
        ("/cam:100000", Contact("/cam:100000")),
        ("/a:/b", Contact("/a:/b")),
        ("/a..b:5", Contact("/a..b:5")),
        ("/my cam:5", Contact("/my cam:5")),
    ],
)
def test_are_read(text: str, contact: Contact):
    """A contact is a name or an address, with or without a carrier."""
    assert Contact.parse(text) == contact


@pytest.mark.parametrize("text", ["", "reader", "tcp:", "tcp:reader", ":/reader", "127.0.0.1:5", "a/b:/c", " /a"])
def test_that_are_none(text: str):
    """The error about an invalid contact shows a valid name."""
    with pytest.raises(AddressError, match="begins with '/', such as"):
        Contact.parse(text)


@pytest.mark.parametrize(
    ("contact", "text"),
    [
        (Contact("/a", "127.0.0.1", 10002, "tcp"), "tcp://127.0.0.1:10002/"),
        (Contact("/a", "::1", 10002, "tcp"), "tcp://[::1]:10002/"),
        (Contact("/a", carrier="udp"), "udp://a"),
        (Contact("/a"), "/a"),
        (Contact("", "127.0.0.1", 10002), "/127.0.0.1:10002/"),
    ],
)
def test_are_written_as_yarp_does(contact: Contact, text: str):
    """A contact is written as its address, or its name if the address is unknown."""
    assert str(contact) == text


def test_validity_and_carrier():
    """A contact is valid if it has a host and a port number."""
    contact = Contact("/a", "127.0.0.1", 10002, "tcp")
    assert contact.valid
    assert contact.by("udp") == Contact("/a", "127.0.0.1", 10002, "udp")
    assert not Contact("/a", "127.0.0.1").valid
    assert not Contact("/a", port=5).valid


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "::1", "fe80::1", "::ffff:1.2.3.4", "localhost", "icub-head.lab.example", "a_b", "host."]
)
def test_hosts(host: str):
    """Addresses and host names are valid hosts."""
    assert is_host(host)


@given(st.text(max_size=80))
def test_hosts_can_be_resolved_without_surprise(text: str):
    """A valid host can be encoded for the resolver."""
    if is_host(text):
        text.encode("idna")


@given(st.text(max_size=60) | st.text(alphabet="/:.[]0123456789tcpa+", max_size=30))
def test_any_text(text: str):
    """Any text is a contact that reads back, or raises AddressError."""
    try:
        contact = Contact.parse(text)
    except AddressError:
        return
    assert 0 <= contact.port <= 65535
    again = Contact.parse(str(contact)) if str(contact) else contact
    assert (again.host, again.port, again.carrier) == (contact.host, contact.port, contact.carrier)
