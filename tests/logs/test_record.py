"""Records of a log as messages: what YARP's programs send, and what anything else sends."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle, Dialect, to_string
from rtf.bottle.binary import decode, encode
from rtf.logs.record import Level, LogRecord, bytes_of, details_text, from_bottle, from_bytes, from_strings

SENDER = "/log/vm/yarprobotinterface/12469"
#: As a program of YARP 3.12.3 sends it with all options.
YARP = (
    '(level DEBUG) (systemtime 1795212380.13658928871) (filename "/a/XMLReader.cpp") (line 88) (function "read()") '
    '(hostname vm) (pid 12469) (cmd yarprobotinterface) (args "--config /x.xml") (thread_id 0x000030b5) '
    '(component yarp.yri.XMLReader) (message "Reading file /x.xml")'
)

texts = st.text(max_size=30) | st.sampled_from(
    ["null", "nan", "true", "a b", '"', "\\", "\0\r\n", ") (level INFO", "é"]
)
records = st.builds(
    LogRecord,
    sender=st.text("abc/_[] \"'é", max_size=20).map(lambda name: f"/{name}"),
    level=st.sampled_from(Level),
    time=st.floats(1e-3, 1e12),
    message=texts,
    component=texts,
    id=texts,
    details=st.builds(
        details_text,
        networktime=st.floats(0, 1e9),
        filename=texts,
        line=st.integers(0, 2**31 - 1),
        thread_id=st.integers(0, 2**31 - 1),
    )
    | st.just(""),
    backtrace=texts,
)


@given(record=records)
def test_a_record_survives_its_message(record: LogRecord):
    """A record is read as it was written, from the quick path, from any bottle, and in both dialects."""
    assert from_bytes(record.to_bytes()) == record
    assert from_bottle(record.to_bottle()) == record
    for dialect in Dialect:
        assert decode(record.to_bytes(), dialect) == record.to_bottle()


def test_a_record_of_yarp_is_read():
    """The record of a program of YARP gives its fields, and what has no field of its own by its key."""
    record = from_strings(f"[{SENDER}]", YARP)
    assert record[:6] == (
        SENDER,
        Level.DEBUG,
        1795212380.1365893,
        "Reading file /x.xml",
        "yarp.yri.XMLReader",
        "",
    )
    keys = ("filename", "line", "function", "hostname", "pid", "cmd", "args", "thread_id", "networktime")
    assert [record.detail(key) for key in keys] == [
        *("/a/XMLReader.cpp", 88, "read()", "vm", 12469, "yarprobotinterface", "--config /x.xml", 0x30B5, None)
    ]
    assert record.to_console() == "[DEBUG] |yarp.yri.XMLReader| Reading file /x.xml"


def test_the_bytes_are_those_of_the_wire():
    """A message is a list of two strings without codes of their own, as recorded."""
    record = LogRecord("/log/vm/a/1", Level.INFO, 1.5, "hello")
    assert record.to_bytes().startswith(bytes.fromhex("0401000002000000"))
    assert record.to_bytes() == encode(record.to_bottle())
    assert record.to_text() == "(level INFO) (systemtime 1.5) (message hello)"


def test_groups_may_come_in_any_order():
    """Groups in another order, with values of other types, are read like the usual ones."""
    text = '(message "a") (id 5) (systemtime 2) (pid 7) (level ERROR) (more (1 2))'
    assert from_strings("[/a]", text) == LogRecord("/a", Level.ERROR, 2.0, "a", id="5", details="(pid 7) (more (1 2))")


@pytest.mark.parametrize(
    ("line", "level", "component", "message"),
    [
        ("just a line\r\n", Level.UNKNOWN, "", "just a line"),
        ("[INFO] started", Level.INFO, "", "started"),
        ("\x1b[01;33m[WARNING]\x1b[0m |yarp.os| slow", Level.WARNING, "yarp.os", "slow"),
        ("[WHAT] is this", Level.UNKNOWN, "", "[WHAT] is this"),
        ("(level INFO", Level.UNKNOWN, "", "(level INFO"),
        ("", Level.UNKNOWN, "", ""),
    ],
)
def test_a_line_of_output_is_a_record(line: str, level: Level, component: str, message: str):
    """What yarprun forwards of a program's output is the message, with the level that it begins with."""
    record = from_strings("[/log/run/sleep/1]", line, arrival=3.0)
    assert record == LogRecord("/log/run/sleep/1", level, 3.0, message, component)


@given(data=st.binary(max_size=80) | st.binary(max_size=60).map(lambda rest: bytes_of("[/a]", "b")[:9] + rest))
def test_any_bytes_give_a_record(data: bytes):
    """No message of a peer raises an error or is lost."""
    record = from_bytes(data, "/peer", 1.0)
    assert isinstance(record, LogRecord)
    assert from_bytes(record.to_bytes()).message == record.message


@pytest.mark.parametrize("text", ["(" * 100_000, '(level INFO) (message "' + "x\\" * 100_000, "(level INFO) " * 50_000])
def test_hostile_texts_are_messages(text: str):
    """Texts that are too deep, never closed or endless are read at once, as a message."""
    assert from_strings("[/a]", text).message == text


def test_a_moment_that_is_no_number_is_that_of_the_arrival():
    """A record with an infinite time is sorted by its arrival."""
    assert from_strings("[/a]", "(level INFO) (systemtime 1e+999) (message a)", arrival=4.0).time == 4.0


def test_half_a_character_does_not_end_the_log():
    """A character that UTF-8 cannot hold is a question mark; bytes that are no UTF-8 come back as they were."""
    assert from_bytes(LogRecord("/a", Level.INFO, 1.0, "\ud800").to_bytes()).message == "?"
    assert from_bytes(LogRecord("/a", Level.INFO, 1.0, "\udc80").to_bytes()).message == "\udc80"
    assert to_string(Bottle.parse(LogRecord("/a", Level.INFO, 1.0, "\udc80").to_text()).find("message")) == "\udc80"
