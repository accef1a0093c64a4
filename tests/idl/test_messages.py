"""Messages: their bytes are those that YARP's generated classes write, and anything else is refused."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf import idl
from rtf.bottle import Bottle, BottleError, Dialect, Vocab
from rtf.bottle.binary import decode, encode
from rtf.errors import RtfError
from rtf.idl.types import WireType

INT32 = st.integers(-(2**31), 2**31 - 1)
NUMBERS = st.floats(allow_nan=False)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]))


def bytes_of(message: Any, dialect: Dialect = Dialect.YARP3) -> bytes:
    """The bytes of a message."""
    return b"".join(message.codec.encode(message, dialect))


def test_a_structure_is_a_list_of_its_fields(shapes: Any):
    """Each field has its type code, also where all have the same."""
    assert bytes_of(shapes.Point(0.0, 1.0)).hex() == (
        "00010000" "02000000" "0a000000" "0000000000000000" "0a000000" "000000000000f03f"
    )  # fmt: skip
    assert bytes_of(shapes.Point(0.0, 1.0), Dialect.YARP4).hex().count("14000000") == 2


def test_inner_structures_have_no_brackets_but_items_have(shapes: Any):
    """As YARP writes them."""
    shape = shapes.Shape(
        "a",
        [shapes.Point(1.0, 2.0)],
        shapes.Color.BLUE,
        shapes.Point(3.0, 4.0),
        {"m": shapes.Point(5.0, 6.0)},
        {2, 1},
        [[1]],
    )
    assert shape.codec.to_text(shape) == "a ((1.0 2.0)) 7 3.0 4.0 ((m (5.0 6.0))) (1 2) ((1))"


def test_defaults_are_those_of_the_file_else_zero(shapes: Any):
    """Each object has containers of its own."""
    one, other = shapes.Shape(), shapes.Shape()
    assert (one.name, one.corners, one.color, one.centre, one.from_) == (
        "none",
        [],
        shapes.Color.GREEN,
        shapes.Point(2.0, 0.0),
        [[1, 2], []],
    )
    one.corners.append(shapes.Point())
    assert other.corners == []
    assert shapes.ANSWER == 42


@given(data=st.data(), dialect=st.sampled_from(Dialect))
def test_what_is_written_is_read(shapes: Any, data: st.DataObject, dialect: Dialect):
    """Any message, in both dialects."""
    points = st.builds(shapes.Point, NUMBERS, NUMBERS)
    shape = data.draw(
        st.builds(
            shapes.Shape,
            TEXTS,
            st.lists(points, max_size=3),
            st.sampled_from(list(shapes.Color)),
            points,
            st.dictionaries(TEXTS, points, max_size=3),
            st.sets(INT32, max_size=4),
            st.lists(st.lists(INT32, max_size=3), max_size=3),
        )
    )
    sent = bytes_of(shape, dialect)
    assert shapes.Shape.codec.decode_from(sent, dialect) == (shape, len(sent))


@given(data=st.binary(max_size=80), dialect=st.sampled_from(Dialect))
def test_other_bytes_are_errors_of_ours(shapes: Any, data: bytes, dialect: Dialect):
    """Whatever arrives."""
    try:
        shapes.Shape.codec.decode(data, dialect)
    except RtfError:
        return


@given(
    values=st.recursive(
        NUMBERS | TEXTS | INT32 | st.binary(max_size=4), lambda inner: st.lists(inner, max_size=8), max_leaves=12
    )
)
def test_other_values_are_errors_of_ours(shapes: Any, values: Any):
    """Bottles of any values are read as the message, or refused."""
    bottle = Bottle(values if isinstance(values, list) else [values])
    try:
        shape = shapes.Shape.codec.decode(encode(bottle), Dialect.YARP3)
    except BottleError:
        return
    assert isinstance(shape, shapes.Shape)


@pytest.mark.parametrize(
    ("kind", "accepted", "refused"),
    [
        (idl.BOOL, [(Vocab("ok"), True), (Vocab("fail"), False), (0, False), (7, True)], ["ok", 1.0, b""]),
        (idl.I8, [(-128, -128), (127, 127)], [128, 1.0, "1"]),
        (idl.U8, [(-1, 255), (200, 200)], [256, -129 - 128]),
        (idl.U64, [(-1, 2**64 - 1)], ["1"]),
        (idl.I32, [(Vocab("ab"), 25185)], [2**31, 1.5]),
        (idl.DOUBLE, [(1, 1.0), (2.5, 2.5)], ["1.0", Vocab("a")]),
        (idl.STRING, [("a", "a"), (Vocab("set"), "set")], [1, b"a"]),
        (idl.BINARY, [(b"\0", b"\0")], ["a"]),
        (idl.ListType(idl.I32), [(Bottle([1, 2]), [1, 2])], [1, Bottle(["a"])]),
        (
            idl.MapType(idl.STRING, idl.I32),
            [(Bottle([Bottle(["a", 1])]), {"a": 1})],
            [Bottle([1]), Bottle([Bottle(["a"])])],
        ),
    ],
)
def test_readers_accept_what_those_of_yarp_accept(kind: WireType, accepted: list[tuple[Any, Any]], refused: list[Any]):
    """Smaller integers, numbers for doubles, vocabs for texts; nothing else."""
    for value, expected in accepted:
        assert kind.take([value], 0) == expected
    for value in refused:
        with pytest.raises(BottleError, match=r"is not of the type|is not a pair"):
            kind.take([value], 0)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (idl.BOOL, 1),
        (idl.I16, 40000),
        (idl.I32, True),
        (idl.I32, 1.0),
        (idl.DOUBLE, "1"),
        (idl.STRING, b"a"),
        (idl.BINARY, "a"),
        (idl.ListType(idl.I32), 3),
        (idl.MapType(idl.I32, idl.I32), []),
    ],
)
def test_values_of_another_type_are_not_written(kind: WireType, value: object):
    """The message would be another one."""
    with pytest.raises(BottleError, match="is not of the type"):
        kind.put(value)


def test_integers_have_the_width_of_their_type(shapes: Any):
    """A small number of 64 bits has 64 bits, one of 16 has 16."""
    assert type(idl.I64.put(1)).__name__ == "Int64"
    assert type(idl.I16.put(1)).__name__ == "Int16"
    assert idl.U32.put(2**32 - 1) == -1
    assert math.isinf(float(idl.FLOAT.put(1e300)))  # type: ignore[arg-type]
    assert decode(bytes_of(shapes.Shape()))[0] == "none"
