"""Editors: a message that is changed field by field, here and from afar, with the messages of YARP's editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf import idl
from rtf.bottle import Bottle, BottleError
from rtf.bottle.binary import decode
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types.codecs import codec_of

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network

WORDS = st.sampled_from(["set", "patch", "help", "name", "color", "corners", "centre"])
VALUES = st.recursive(
    WORDS | st.integers(-9, 9) | st.floats(allow_nan=False), lambda inner: st.lists(inner, max_size=4), max_leaves=9
)


def text_of(message: Any) -> str:
    """A message as people write it."""
    return codec_of(message).to_text(message)


def test_one_field_is_set_from_afar(shapes: Any, network: Network):
    """In both forms, and the program is told."""
    changes: list[tuple[str, object]] = []
    editor = idl.Editor(shapes.Shape(), changed=lambda name, before: changes.append((name, before)))
    with (
        RpcServer("/settings", editor.answer, network=network),
        RpcClient("/asker", "/settings", network=network) as port,
    ):
        assert port.call(Bottle.parse("set name sam color 7")).to_text() == "[ok]"  # type: ignore[union-attr]
        assert port.call(Bottle.parse("patch (set centre (1.0 2.0)) (set numbers (3 4))")).to_text() == "[ok]"  # type: ignore[union-attr]
        assert port.call(Bottle.parse("help")).to_text() == (  # type: ignore[union-attr]
            '[many] ("*** Available fields:" name corners color centre marks numbers from)'
        )
        assert port.call(Bottle.parse("help centre")).to_text() == '[many] ("Point centre")'  # type: ignore[union-attr]
        assert "help" in port.call(Bottle()).to_text()  # type: ignore[union-attr]
    assert editor.message == shapes.Shape("sam", color=shapes.Color.BLUE, centre=shapes.Point(1.0, 2.0), numbers={3, 4})
    assert changes == [
        ("name", "none"), ("color", shapes.Color.GREEN), ("centre", shapes.Point(2.0, 0.0)), ("numbers", set())
    ]  # fmt: skip


@pytest.mark.parametrize(
    "bad",
    [
        "set name",
        "set nme sam",
        "set color 5",
        "set name sam color red",
        "patch (set name)",
        "patch 1",
        "set centre (1.0)",
    ],
)
def test_what_cannot_be_set_changes_nothing(shapes: Any, bad: str):
    """Nor the fields before it."""
    editor = idl.Editor(shapes.Shape())
    assert text_of(editor.answer(Bottle.parse(bad))) == "[fail]"
    assert editor.message == shapes.Shape()


def test_changes_here_are_sent(shapes: Any):
    """Each by itself, or those of a block together; two editors agree."""
    sent: list[Any] = []
    editor, other = idl.Editor(shapes.Shape(), send=sent.append), idl.Editor(shapes.Shape())
    editor.set("name", "sam")
    with editor.editing():
        editor.set("corners", [shapes.Point(1.0, 2.0), shapes.Point(3.0, 4.0)])
        editor.set_item("corners", 1, shapes.Point(5.0, 6.0))
        editor.set("centre", shapes.Point(7.0, 8.0))
    assert [text_of(one) for one in sent] == [
        "patch (set name sam)",
        "patch (set corners ((1.0 2.0) (5.0 6.0))) (set centre (7.0 8.0))",
    ]
    for patch in sent:
        other.answer(decode(b"".join(codec_of(patch).encode(patch, 3))))
    assert other.message == editor.message
    with pytest.raises(KeyError, match="no field nane; did you mean name"):
        editor.set("nane", "x")
    with pytest.raises(BottleError, match="is not of the type"):
        editor.set("name", 1)


@given(words=st.lists(VALUES, max_size=6))
def test_any_message_is_answered(shapes: Any, words: list[Any]):
    """And the message stays one that can be sent."""
    editor = idl.Editor(shapes.Shape())
    assert text_of(editor.answer(Bottle(words)))
    assert shapes.Shape.codec.to_text(editor.message)
