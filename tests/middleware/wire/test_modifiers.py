"""Modifiers of carriers: their text, and their form in a handshake."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.middleware.errors import ProtocolError
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.modifiers import join, read, split

words = st.from_regex(r"[a-z][a-z_]{0,8}", fullmatch=True)
values = st.lists(words | st.integers(0, 2**31 - 1).map(str), max_size=3)
settings_of_carriers = st.dictionaries(words.filter(lambda word: word != "ack"), values, min_size=1, max_size=5)
carriers = st.sampled_from(["tcp", "udp", "text_ack", "unix_stream", "unix_stream+ack"])


@pytest.mark.parametrize(
    ("carrier", "name", "text"),
    [
        ("tcp", "tcp", ""),
        ("tcp+recv.priority+tc.2", "tcp", "(recv priority) (tc 2)"),
        ("fast_tcp+send.portmonitor+file.x.so", "fast_tcp", "(send portmonitor) (file x so)"),
        ("udp+recv.priority+virtual+(ex (/b -20))", "udp", "(recv priority) (virtual) ((ex (/b -20)))"),
        ("unix_stream+ack", "unix_stream+ack", ""),
        ("unix_stream+ack+log.in", "unix_stream+ack", "(log in)"),
        ("unix_stream+acked", "unix_stream", "(acked)"),
    ],
)
def test_are_sent_as_a_bottle(carrier: str, name: str, text: str):
    """Modifiers are sent with the recorded text of YARP's programs."""
    assert split(carrier) == (name, text)


@given(carriers, settings_of_carriers)
def test_arrive_as_they_were_written(name: str, wanted: dict[str, list[str]]):
    """Keys and values are the same after sending, and can be written again."""
    written = "+".join([name, *(".".join([key, *given]) for key, given in wanted.items())])
    assert Contact.parse(f"{written}://reader") == Contact("/reader", carrier=written)
    plain, text = split(written)
    found = read(text)
    assert plain == name
    assert {key: [str(value) for value in values] for key, values in found.items()} == wanted
    assert join(name, found) == written


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text: str):
    """Any text of a caller is read, or raises ProtocolError."""
    try:
        found = read(text)
    except ProtocolError:
        return
    assert join("tcp", found).startswith("tcp")


@given(st.text(max_size=60))
def test_any_carrier_can_be_split(text: str):
    """A carrier is split at its first plus sign."""
    name, modifiers = split(f"tcp+{text}")
    assert name == "tcp"
    assert bool(modifiers) == bool(text)


def test_lists_with_parentheses_too_many():
    """A list in two pairs of parentheses is read as in one, as YARP sends it."""
    assert read("(recv priority) ((ex (/b -20) (/a 10)))") == {
        "recv": Bottle(["priority"]),
        "ex": Bottle([["/b", -20], ["/a", 10]]),
    }
    assert read("(ex (/b -20))") == {"ex": Bottle([["/b", -20]])}
    carrier = "tcp+recv.priority+(ex (/b -20))"
    assert read(split(join("tcp", read(split(carrier)[1])))[1]) == read(split(carrier)[1])


def test_unfinished():
    """The error about an incomplete text shows it."""
    with pytest.raises(ProtocolError, match=r"the modifiers '\(recv' cannot be read"):
        read("(recv")
