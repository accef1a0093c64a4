"""An application's file as the page edits it: what is changed is written, and all else stays."""

from __future__ import annotations

import string
from typing import TYPE_CHECKING

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.applications.errors import ApplicationError
from rtf.applications.page.document import (
    MODULE_TEXTS,
    ChangedError,
    ConnectionText,
    DependencyText,
    Document,
    ModuleText,
    edited,
    parse_document,
    read_document,
    save,
)

if TYPE_CHECKING:
    from pathlib import Path

LAB = """<?xml version="1.0" encoding="UTF-8"?>
<application>
    <name>lab</name>
    <var name="voice">/lab/voice</var>
    <!-- the ears -->
    <module colour="red">
        <name>read</name>
        <parameters>/lab/ears</parameters>
        <dependencies>
            <port timeout="20">/lab/voice</port>
        </dependencies>
        <geometry>(Pos (x 1.0) (y 2.0)) (Size 3)</geometry>
    </module>
    <module>
        <name>write</name>
        <parameters>${voice}</parameters>
    </module>
    <connection id="one">
        <from external="true">${voice}</from>
        <input>/lab/ears</input>
    </connection>
    <arbitrator>
        <port>/lab/ears</port>
    </arbitrator>
</application>
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The file of an application."""
    path = tmp_path / "lab.xml"
    path.write_text(LAB)
    return path


def test_what_is_not_changed_stays(file: Path):
    """A document that is written back as it was read gives the same file."""
    document, _ = read_document(file)
    assert [one.id for one in document.modules] == ["m3", "m4"]
    assert (document.modules[0].x, document.modules[0].y, document.modules[1].x) == (1.0, 2.0, None)
    assert document.connections == (ConnectionText("c5", "${voice}", "/lab/ears", source_external=True),)
    assert edited(file, document)[0].decode() == LAB


def test_changes_are_written_where_they_belong(file: Path):
    """Texts are replaced, an empty one is removed, and of a geometry only the place; new ones go behind their kind."""
    document, _ = read_document(file)
    moved = msgspec.structs.replace(document.modules[0], parameters="", x=5.04, y=-6.0)
    new = ModuleText("n1", "say", "<&>", x=7.0, y=8.0)
    line = msgspec.structs.replace(
        document.connections[0],
        target="/other",
        protocol="udp",
        persist=True,
        source_external=False,
        target_external=True,
    )
    other = ConnectionText("n2", "/a", "/b")
    save(file, Document(document.revision, (moved, document.modules[1], new), (line, other)))
    expected = (
        LAB.replace("        <parameters>/lab/ears</parameters>\n", "")
        .replace("(Pos (x 1.0) (y 2.0))", "(Pos (x 5.0) (y -6.0))")
        .replace(
            "    <connection id",
            "    <module>\n        <name>say</name>\n        <parameters>&lt;&amp;&gt;</parameters>\n"
            "        <geometry>(Pos (x 7.0) (y 8.0))</geometry>\n    </module>\n    <connection id",
        )
        .replace('id="one"', 'id="one" persist="true"')
        .replace(' external="true"', "")
        .replace("<input>/lab/ears</input>", '<input external="true">/other</input>\n        <protocol>udp</protocol>')
        .replace(
            "    <arbitrator>",
            "    <connection>\n        <from>/a</from>\n        <to>/b</to>\n    </connection>\n    <arbitrator>",
        )
    )
    assert file.read_text() == expected
    again, _ = read_document(file)
    assert [one.name for one in again.modules] == ["read", "write", "say"]
    assert [*file.parent.iterdir()] == [file]


def test_modules_and_connections_are_removed(file: Path):
    """What a document leaves out is taken out of the file; comments and all else stay."""
    document, _ = read_document(file)
    data, ids = edited(file, Document(document.revision, document.modules[:1]))
    assert ids == ["m3"]
    assert b"<!-- the ears -->" in data
    assert b"<arbitrator>" in data
    assert b"${voice}" not in data


def test_dependencies_are_written_where_they_belong(file: Path):
    """Conditions become attributes, and what is the same keeps what the page does not know."""
    file.write_text(LAB.replace('<port timeout="20"', '<!-- slow --><port colour="red" timeout="20"'))
    document, _ = read_document(file)
    first, second = document.modules
    assert first.dependencies == (DependencyText("/lab/voice", "20"),)
    new = DependencyText("/server", "", "[get] state", "<ready>")
    changed = msgspec.structs.replace(first, dependencies=(new, DependencyText("/lab/voice", "5")))
    added = msgspec.structs.replace(second, dependencies=(DependencyText("${voice}"),))
    save(file, Document(document.revision, (changed, added), document.connections))
    text = file.read_text()
    assert '<port request="[get] state" reply="&lt;ready&gt;">/server</port>' in text
    assert '<port colour="red" timeout="5">/lab/voice</port>' in text
    assert "<!-- slow -->" in text
    assert "<dependencies>\n            <port>${voice}</port>\n        </dependencies>" in text
    again, _ = read_document(file)
    assert [one.dependencies for one in again.modules] == [changed.dependencies, added.dependencies]
    without = [msgspec.structs.replace(one, dependencies=()) for one in again.modules]
    save(file, Document(again.revision, tuple(without), again.connections))
    assert file.read_text().count("<port") == 1  # that of the arbitrator
    assert file.read_text().count("<dependencies>") == 1  # with the comment


def test_a_file_that_others_changed_is_not_overwritten(file: Path):
    """The error says what to do, and the file stays."""
    document, _ = read_document(file)
    file.write_text(LAB.replace("lab<", "other<"))
    with pytest.raises(ChangedError, match="changed by another program; reload"):
        save(file, document)
    assert "<name>other</name>" in file.read_text()


@pytest.mark.parametrize("bad", ["\0", "\x1b", "\ufffe"])
def test_texts_that_xml_cannot_hold_are_refused(file: Path, bad: str):
    """Otherwise the file could never be read again."""
    document, _ = read_document(file)
    with pytest.raises(ApplicationError, match="characters that XML cannot hold"):
        save(file, Document(document.revision, (*document.modules, ModuleText("n1", bad))))
    assert file.read_text() == LAB


@pytest.mark.parametrize(
    "data",
    [
        *(
            b"",
            b"[]",
            b"{}",
            b'{"revision": 1}',
            b'{"revision": "", "more": 1}',
            b"[" * 100_000,
            b'{"revision":"\\ud800"}',
        ),
        b'{"revision": "", "modules": [{"id": "n1", "x": "left"}]}',
        b'{"revision": "", "modules": [{"id": "n1", "x": NaN}]}',
    ],
)
def test_requests_that_are_no_document_are_refused(data: bytes):
    """Whatever a browser sends, the error is that of applications."""
    with pytest.raises(ApplicationError, match="the request is no application"):
        parse_document(data)


def test_an_id_of_the_wrong_kind_is_refused(file: Path):
    """A connection cannot become a module."""
    document, _ = read_document(file)
    with pytest.raises(ApplicationError, match="is that of a module and of a connection"):
        edited(file, Document(document.revision, (ModuleText("c5", "x"),)))


TEXTS = st.text(string.ascii_letters + string.digits + "/<>&\"'$ {}é\N{HEBREW LETTER ALEF}", max_size=12).map(str.strip)
PORTS = TEXTS.map(lambda text: f"/{text}")
DEPENDENCIES = st.builds(DependencyText, PORTS, TEXTS, TEXTS, TEXTS)
MODULES = st.builds(
    ModuleText,
    st.just(""),
    dependencies=st.lists(DEPENDENCIES, max_size=3).map(tuple),
    **dict.fromkeys(MODULE_TEXTS, TEXTS),
    x=st.integers(-9999, 9999).map(float),
    y=st.integers(-9999, 9999).map(float),
)
CONNECTIONS = st.builds(ConnectionText, st.just(""), PORTS, PORTS, TEXTS, *[st.booleans()] * 3)


@given(modules=st.lists(MODULES, max_size=4), connections=st.lists(CONNECTIONS, max_size=4))
def test_what_is_saved_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, modules: list[ModuleText], connections: list[ConnectionText]
):
    """Any texts, places and connections that are added to a file are in it when it is read again."""
    file = tmp_path_factory.getbasetemp() / "any.xml"
    file.write_text(LAB)
    document, _ = read_document(file)
    new = [msgspec.structs.replace(one, id=f"n{number}") for number, one in enumerate(modules)]
    lines = [msgspec.structs.replace(one, id=f"l{number}") for number, one in enumerate(connections)]
    save(file, Document(document.revision, (*document.modules, *new), (*document.connections, *lines)))
    again, _ = read_document(file)
    assert [msgspec.structs.replace(one, id="") for one in again.modules[2:]] == modules
    assert [msgspec.structs.replace(one, id="") for one in again.connections[1:]] == connections
