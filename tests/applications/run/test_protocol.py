"""Requests and replies as bottles, and the words of commands."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.applications.run.errors import RequestError
from rtf.applications.run.protocol import (
    Ask,
    Kill,
    Running,
    Start,
    StartReply,
    join_words,
    read_environment,
    read_request,
    split_words,
)
from rtf.bottle import Bottle
from rtf.bottle.binary import decode_from, encode

texts = st.text(st.characters(codec="utf-8"), max_size=20)
names = st.text("abc/-_ .:=1", min_size=1, max_size=20)
starts = st.builds(
    Start,
    tag=names,
    command=names,
    on=texts,
    directory=texts,
    environment=texts,
    stdio=texts,
    hold=st.booleans(),
    log=st.none() | texts,
    geometry=texts,
    uuid=texts,
)
asks = st.builds(Ask, st.sampled_from(["sigterm", "isrunning", "which", "killstdio"]), names) | st.builds(
    Ask, st.sampled_from(["ps", "sysinfo", "exit", "sigtermall"])
)
requests = starts | asks | st.builds(Kill, names, st.integers(-(1 << 31), (1 << 31) - 1))
values = st.recursive(
    st.integers(-5, 5) | texts | st.sampled_from(["cmd", "as", "kill", "ps", "env", "log"]),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=12,
)


@given(requests)
def test_request_is_read_as_it_was_written(request: Start | Kill | Ask):
    """Any request comes back from its bytes."""
    message, _ = decode_from(encode(request.to_bottle()))
    assert read_request(message) == request


@given(st.lists(values, max_size=5))
def test_any_message_is_read_or_refused(message: list[object]):
    """No bottle causes anything but a request or RequestError."""
    with suppress(RequestError):
        assert isinstance(read_request(Bottle(message)), Start | Kill | Ask)


def test_order_of_keys_decides():
    """A message with two keys asks for the one that the original looks for first; a tag that is a number is text."""
    assert read_request(Bottle([["ps"], ["as", 7], ["cmd", "sleep", 31]])) == Start("7", "sleep")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("sleep 30", ["sleep", "30"]),
        ("  a   b ", ["a", "b"]),
        ('say "two words" end', ["say", "two words", "end"]),
        ('a"b c"d', ["a", "b c", "d"]),
        ('open "to the end', ["open", "to the end"]),
        ("sh -c 'echo $HOME; x'", ["sh", "-c", "'echo", "$HOME;", "x'"]),
        ('tab\there ""', ["tab\there"]),
        ("", []),
    ],
)
def test_words(command: str, words: list[str]):
    """Blanks and double quotes are borders; nothing else is special, and nothing is expanded."""
    assert split_words(command) == words


@given(st.lists(st.text("ab$'\\;* ", min_size=1).filter(str.strip), min_size=1))
def test_words_are_split_as_they_were_joined(words: list[str]):
    """What the client joins, the node splits."""
    assert split_words(join_words(words)) == words


@pytest.mark.parametrize("word", ['a"b', ""])
def test_word_that_no_command_can_have(word: str):
    """It is refused, because the node would see other words."""
    with pytest.raises(RequestError, match="double quote"):
        join_words(["x", word])


def test_environment():
    """A value may have equal signs, and a name alone removes the variable."""
    assert read_environment("A=1;B=x=y;;C;=z") == {"A": "1", "B": "x=y", "C": None}


@given(st.builds(Running, st.integers(1, 1 << 22), texts, texts, texts, texts))
def test_row_of_running_programs(row: Running):
    """A row of the list comes back from its bytes."""
    message, _ = decode_from(encode(Bottle([row.to_list()])))
    assert Running.read(message[0]) == row


def test_reply_to_a_start_with_a_terminal():
    """The process, the sentence, and what was said of the terminal."""
    reply = StartReply.read(Bottle([5, "STARTED: …\n", "/n/1/t-0", -1, "ABORTED: …\n"]))
    assert (reply.pid, reply.text, reply.terminal) == (5, "STARTED: …\n", ("/n/1/t-0", -1, "ABORTED: …\n"))
