"""Application files as trees: what is refused, and that nothing is lost when they are written back."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from rtf.applications.xml import vocabulary
from rtf.applications.xml.tree import MAX_BYTES, parse_tree, read_tree, to_bytes
from rtf.errors import Location
from rtf.xml_tree import COMMENT, Element, XmlError

SCHEMA = Path(vocabulary.__file__).with_name("application.xsd")

#: Whatever XML 1.0 can hold, in and outside of the first plane.
letters = st.characters(codec="utf-8", exclude_categories=("Cs", "Cc"), exclude_characters="\ufffe\uffff")
texts = st.text(letters | st.sampled_from("\t\n\r<>&\"'"), max_size=12)
tags = st.sampled_from(
    ["application", "module", "name", "connection", "from", "port", "ensure", "geometry", "unknown", "a:b"]
)
attributes = st.dictionaries(st.sampled_from(["id", "qos", "external", "xsi:schema", "no"]), texts, max_size=3)


def element(tag: str, content: dict[str, str], text: str, children: list[Element]) -> Element:
    """Make an element as a file would."""
    return Element(tag, tag.lower(), content, Location(), 0, b"", children, [text])


comments = st.builds(lambda text: element(COMMENT, {}, text.replace("-", "_").replace("\r", " "), []), texts)
elements = st.recursive(
    st.builds(element, tags, attributes, texts, st.just([])),
    lambda inner: st.builds(element, tags, attributes, texts, st.lists(inner | comments, max_size=3)),
    max_leaves=12,
)


def plain(tree: Element) -> object:
    """Return what a tree says, without places."""
    return tree.tag, dict(tree.attributes), tree.text, [plain(child) for child in tree.children]


@given(elements)
def test_nothing_is_lost_when_a_tree_is_written(tree: Element):
    """What is read back is the same tree: known or not, with texts and comments, in their order."""
    assert plain(parse_tree(to_bytes(tree), "a.xml")) == plain(tree)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'<!DOCTYPE a [<!ENTITY x "y">]><application>&x;</application>', "a.xml:1:13: a document type"),
        (b"<application>&lol;</application>", "a.xml:1:14: this is not well-formed XML: undefined entity"),
        (b"<application>\n <module>\n</application>", "a.xml:3:3: this is not well-formed XML: mismatched tag"),
        (b"<module>" * 65, "a.xml:1:513: elements are nested deeper than 64"),
        (b"<application>" + b" " * MAX_BYTES, "a.xml: the file is larger than 10 MiB"),
        (b"", "a.xml:1:1: this is not well-formed XML: no element found"),
        (b"<a" + b"".join(b' a%d=""' % number for number in range(300)) + b"/>", "more than 256 attributes"),
        (b"\xff\xfe\x00", "this is not UTF-16"),
    ],
)
def test_hostile_files_are_refused(data: bytes, message: str):
    """The message says what is wrong, and where."""
    with pytest.raises(XmlError) as caught:
        parse_tree(data, "a.xml")
    assert message in f"{caught.value.location}: {caught.value.message}"


def test_file_that_cannot_be_read(tmp_path: Path):
    """A folder, or no file at all, is reported with the reason of the system."""
    with pytest.raises(XmlError, match="Is a directory"):
        read_tree(tmp_path)
    with pytest.raises(XmlError, match="No such file"):
        read_tree(tmp_path / "a.xml")


def test_schema_is_that_of_the_vocabulary():
    """The published schema is made of the table by which files are checked; tools/application_schema.py writes it."""
    assert SCHEMA.read_text(encoding="utf-8") == vocabulary.schema()


def test_schema_accepts_what_is_known_and_refuses_what_is_not():
    """An editor marks a wrong element; figures of a machine are free."""
    schema = etree.XMLSchema(etree.parse(SCHEMA))
    assert schema.validate(etree.XML("<application><name>A</name><module><name>m</name></module></application>"))
    assert schema.validate(etree.XML("<resources><computer><memory><free>1</free></memory></computer></resources>"))
    assert not schema.validate(etree.XML("<application><modul/></application>"))
