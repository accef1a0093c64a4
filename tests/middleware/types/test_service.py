"""The messages of generated services, and services of our own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rtf.bottle import Bottle, BottleError, Dialect, Int8, Int16, Int64, Property, Vocab
from rtf.bottle.binary import decode, encode
from rtf.middleware.types import FAIL, Function, ProtocolVersion, Record, Service, Stamp, call, read_call
from rtf.middleware.types.codecs import codec_of
from rtf.middleware.types.service import succeeded

THREE, FOUR = Dialect.YARP3, Dialect.YARP4
RECORDED = json.loads((Path(__file__).parents[2] / "data" / "yarp_wire" / "bottles.json").read_text())


def written(value: object, dialect: Dialect = THREE) -> str:
    """Return the bytes of an object in hexadecimal."""
    return b"".join(codec_of(value).encode(value, dialect)).hex()


def hexadecimal(text: str) -> str:
    """Remove the blanks and bars that group the digits."""
    return text.replace(" ", "").replace("|", "")


@pytest.mark.parametrize(
    ("record", "data"),
    [
        (Record(), "00010000 00000000"),
        (Record(Vocab("done")), "00010000 01000000 09000000 646f6e65"),
        (Record(True), "00010000 01000000 09000000 6f6b0000"),
        (Record(False), "00010000 01000000 09000000 6661696c"),
        (Record("run"), "00010000 01000000 04000000 03000000 72756e"),
        (Record(0), "00010000 01000000 01000000 00000000"),
        (Record(Int8(1), Int16(1)), "00010000 02000000 20000000 01 40000000 0100"),
        (Record(Int64(1), b"\7"), "00010000 02000000 11000000 0100000000000000 0c000000 01000000 07"),
        (Record([1, 2]), "00010000 01000000 01010000 02000000 01000000 02000000"),
        (Record([True, False]), "00010000 01000000 09010000 02000000 6f6b0000 6661696c"),
        (Record((1, ("a",)), 2), "00010000 03000000 01000000 01000000 04000000 01000000 61 01000000 02000000"),
        (Record([(1, 2)]), "00010000 01000000 00010000 01000000 00010000 02000000 01000000 01000000 01000000 02000000"),
        (
            Record([[1], [2]]),
            "00010000 01000000 00010000 02000000 01010000 01000000 01000000 01010000 01000000 02000000",
        ),
        (
            Record({"a": True}),
            "00010000 01000000 00010000 01000000 00010000 02000000 04000000 01000000 61 09000000 6f6b0000",
        ),
        (Record(np.array([1], np.int32)), "00010000 01000000 01010000 01000000 01000000"),
        (Record(np.array([], np.int32)), "00010000 01000000 01010000 00000000"),
        (Record(Bottle([1, "a"])), "00010000 01000000 00010000 02000000 01000000 01000000 04000000 01000000 61"),
        (Record(Property()), "00010000 01000000 00010000 00000000"),
        (Record(Record(True), 2), "00010000 02000000 00010000 01000000 09000000 6f6b0000 01000000 02000000"),
    ],
)
def test_records_to_the_byte(record: Record, data: str):
    """Each element of a record has its code, structures are flat, and lists of scalars are specialised."""
    assert written(record) == hexadecimal(data)


def test_doubles_have_the_code_of_the_dialect():
    """A double in a record has the code of the dialect."""
    assert written(Record(1.5)) == "00010000010000000a000000000000000000f83f"
    assert written(Record(1.5), FOUR) == "000100000100000014000000000000000000f83f"


def test_large_arrays_in_a_record_are_not_copied():
    """A large array in a record is a block of its own."""
    array = np.zeros(100_000)
    blocks = Record.codec.encode(Record(1, array, 2), THREE)
    assert any(np.shares_memory(np.frombuffer(block, np.uint8), array) for block in blocks if len(block) == 800_000)
    assert decode(b"".join(blocks))[2] == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("get_phase", [Vocab("get"), "phase"]),
        ("getAxesRPC", ["getAxesRPC"]),
        ("is_ready", [Vocab("is"), "ready"]),
        ("quit", [Vocab("quit")]),
    ],
)
def test_the_name_of_a_function_is_its_words(name: str, words: list[object]):
    """The words of a function's name are vocabs or strings by length, before the arguments."""
    request = decode(bytes.fromhex(written(call(name, 3, 1.5))))
    assert request == Bottle([*words, 3, 1.5])
    assert read_call(request, [name]) == (name, Bottle([3, 1.5]))


@pytest.mark.parametrize(
    "text", ["[get] phase 1", "get phase 1", "get_phase 1", "[get] [phas] 1", '"get_phase" 1', "[get]  phase  1"]
)
def test_names_are_read_in_every_form(text: str):
    """The words of a name may be vocabs or strings, joined or separate."""
    expected = None if "[phas]" in text else ("get_phase", Bottle([1]))
    assert read_call(Bottle.parse(text), {"get_phase", "get_level", "is"}) == expected


def test_the_longest_name_wins():
    """A request calls the function with the longest matching name."""
    functions = ("stop", "stop_now", "stop_now_please_all")
    assert read_call(Bottle.parse("stop 5"), functions) == ("stop", Bottle([5]))
    assert read_call(Bottle.parse("stop now 5"), functions) == ("stop_now", Bottle([5]))
    assert read_call(Bottle.parse("stop now please"), functions) == ("stop_now", Bottle(["please"]))
    for text in ("", "5 stop", "halt", "(stop)"):
        assert read_call(Bottle.parse(text), functions) is None
    assert read_call(Bottle(["x"]), ()) is None


def joint(number: object) -> tuple[Record, float]:
    """A function of the service that needs a number."""
    if not isinstance(number, int):
        raise BottleError("the joint is a number")
    return Record(True), number / 2


SERVICE = Service(
    {
        "get_phase": Function(lambda: "run", "string get_phase()", ("Returns the phase.",)),
        "is_ready": Function(lambda: True),
        "set_nothing": Function(lambda: None),
        "get_joint": Function(joint),
        "get_stamp": Function(lambda: Stamp(1, 2.0)),
        "get_bottle": Function(lambda: Bottle([1, 2])),
    }
)


@pytest.mark.parametrize(
    ("question", "data"),
    [
        ("[get] phase", "00010000 01000000 04000000 03000000 72756e"),
        ("is_ready", "00010000 01000000 09000000 6f6b0000"),
        ("set nothing", "00010000 00000000"),
        ("get joint 3", "00010000 02000000 00010000 01000000 09000000 6f6b0000 0a000000 000000000000f83f"),
        ("get stamp", "00010000 02000000 01000000 01000000 0a000000 0000000000000040"),
        ("get bottle", "01010000 02000000 01000000 02000000"),
        ("bogus", "09010000 01000000 6661696c"),
        ("get joint", "09010000 01000000 6661696c"),
        ("get joint 1 2", "09010000 01000000 6661696c"),
        ("get joint x", "09010000 01000000 6661696c"),
        ("help bogus", "09010000 01000000 6661696c"),
        ("", "09010000 01000000 6661696c"),
    ],
)
def test_a_service_answers(question: str, data: str):
    """The reply has the function's result; an unknown or invalid call is answered with a failure."""
    assert written(SERVICE.answer(Bottle.parse(question))) == hexadecimal(data)


def test_a_service_lists_its_functions():
    """Help lists the functions, or describes one."""
    names = "get_phase is_ready set_nothing get_joint get_stamp get_bottle help"
    assert Record.codec.to_text(SERVICE.answer(Bottle(["help"]))) == f'[many] ("*** Available commands:" {names})'
    shown = Record.codec.to_text(SERVICE.answer(Bottle.parse("help get_phase")))
    assert shown == '[many] ("string get_phase()" "Returns the phase.")'
    assert Record.codec.to_text(SERVICE.answer(Bottle.parse("help is ready"))) == "[many] (is_ready)"


def test_an_error_of_a_function_is_not_hidden():
    """An unexpected error of a function is raised, not answered."""
    broken = Service({"divide": Function(lambda: 1 / 0)})
    with pytest.raises(ZeroDivisionError):
        broken.answer(Bottle(["divide"]))


def test_failures_are_listed():
    """``succeeded`` distinguishes a failure from any other answer."""
    assert not succeeded(FAIL)
    assert succeeded(Bottle())
    assert succeeded(Bottle(["fail"]))


@pytest.mark.parametrize(
    "entry", [entry for entry in RECORDED if entry["hex"][:8] == "00010000"], ids=lambda e: e["from"]
)
def test_recorded_answers_of_services_are_written_alike(entry: dict[str, object]):
    """Recorded replies of services are encoded to the same bytes."""
    data, dialect = bytes.fromhex(str(entry["hex"])), Dialect(entry["dialect"])
    bottle = decode(data, dialect)
    assert written(bottle if encode(bottle, dialect) == data else record_of(bottle), dialect) == data.hex()


def record_of(value: object) -> object:
    """Turn every list into a record."""
    return Record(*map(record_of, value)) if isinstance(value, Bottle) else value


def test_the_version_of_a_protocol():
    """A version is a list of one, and four numbers without codes."""
    version = ProtocolVersion(0, 3, 12, 3)
    assert written(version) == hexadecimal("00010000 01000000 0000 0300 0c00 0300")
    assert version.codec.to_text(version) == "0 3 12 3"
    for text in ("", "1 2 3", "0 3 12 99999", "a b c d"):
        with pytest.raises(BottleError, match="four 16-bit numbers"):
            version.codec.from_text(text)
