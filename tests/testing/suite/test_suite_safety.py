"""Broken, hostile and huge suite files are refused with their place, and nothing is fetched."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from rtf import xml_tree
from rtf.testing.suite.diagnostics import LIMITS, MAX_DIAGNOSTICS
from rtf.testing.suite.xml import load_suite, load_suite_bytes

if TYPE_CHECKING:
    from pathlib import Path


def refused(data: bytes | str) -> list[str]:
    """Load a file that must be refused, and return its errors."""
    loaded = load_suite_bytes(data if isinstance(data, bytes) else data.encode(), "s.xml")
    assert loaded.suite is None
    assert loaded.errors
    return [str(error) for error in loaded.errors]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "s.xml:1:1: error: this is not well-formed XML: no element found"),
        ('<suite name="S">\n  <test>A</suite>', "s.xml:2:12: error: this is not well-formed XML: mismatched tag"),
        ('<suite name="S">\n<test>A', "<test> of line 2 is still open here"),
        ("<suite a='1' a='2'/>", "duplicate attribute"),
        ("<suite>&robot;</suite>", "undefined entity"),
        (
            "<suite><!-- never closed -- </suite>",
            "s.xml:1:8: error: what begins here with <!-- is never closed (end it with",
        ),
        ("<suite><![CDATA[ x ]] ></suite>", "end it with ]]>"),
        ("<suite/><suite/>", "junk after document element"),
        ("\0", "not well-formed"),
    ],
)
def test_malformed_xml_is_an_error_with_its_place(text: str, message: str):
    """Malformed XML is an error with line and column."""
    assert message in refused(text)[0]


def test_what_stands_before_the_malformed_place_is_checked_all_the_same():
    """Elements before the malformed place are checked, too."""
    messages = refused('<suite name="S">\n<test retries="x">A</test><test>B</suite>')
    assert len(messages) == 2
    assert "attribute 'retries'" in messages[0]


@pytest.mark.parametrize("text", ["<application/>", "<html><body/></html>", "<suit name='S'/>"])
def test_another_root_is_no_suite(text: str):
    """A file with another root is no suite, and marked as foreign."""
    assert "this is not a test suite file: its root is <" in refused(text)[0]
    assert load_suite_bytes(text.encode(), "s.xml").foreign


def test_the_root_of_old_versions_is_recognised():
    """The error about the root ``suit`` of old versions names ``suite``."""
    assert "did you mean 'suite'?" in refused("<suit name='S'/>")[0]


@pytest.mark.parametrize(
    "doctype",
    [
        "<!DOCTYPE suite>",
        '<!DOCTYPE suite SYSTEM "http://no.where/suite.dtd">',
        '<!DOCTYPE suite PUBLIC "-//X" "y.dtd">',
    ],
)
def test_a_bare_document_type_is_passed_over(doctype: str):
    """A document type without declarations is ignored, and nothing is fetched."""
    loaded = load_suite_bytes(
        f'<?xml version="1.0"?>\n{doctype}<suite name="S"><test x="">A</test></suite>'.encode(), "s"
    )
    assert [test.plugin for test in loaded.suite.tests] == ["A"]
    assert (2, len(doctype) + 17 + 6) == (loaded.errors[0].line, loaded.errors[0].column)


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE suite [<!ENTITY a "b">]><suite name="&a;"/>',
        '<!DOCTYPE suite SYSTEM "x.dtd" [ ]><suite/>',
        '<!DOCTYPE suite [<!ENTITY % p SYSTEM "file:///etc/passwd"> %p;]><suite/>',
        "<!-- --><!DOCTYPE s [\n<!ELEMENT s ANY>]><s/>",
    ],
)
def test_declarations_are_refused(text: str):
    """A document type with declarations is refused."""
    assert "a document type with declarations in it" in refused(text)[0]


def test_an_entity_behind_a_bare_document_type_is_no_loophole():
    """An undefined entity is an error, also with an external document type."""
    assert "undefined entity" in refused('<!DOCTYPE suite SYSTEM "x"><suite name="S"><test>A&b;</test></suite>')[0]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1", "windows-1252"])
def test_encodings_that_files_have_are_read(encoding: str):
    """Common encodings are read by byte order mark or declaration."""
    text = f'<?xml version="1.0" encoding="{encoding.removesuffix("-sig")}"?><suite name="Größe"/>'
    assert load_suite_bytes(text.encode(encoding), "s.xml").suite.name == "Größe"


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b'<suite name="S">\n<test>\xff</test></suite>', "s.xml:2:7: error: this is not UTF-8 text"),
        (b'<?xml version="1.0" encoding="zip"?><suite/>', "the encoding 'zip' is not supported"),
        (b'<?xml version="1.0" encoding="iso-8859-99"?><suite/>', "there is no encoding 'iso-8859-99'"),
    ],
)
def test_other_encodings_are_refused(data: bytes, expected: str):
    """An unsupported encoding is refused, with a hint to UTF-8."""
    (message,) = refused(data)
    assert expected in message
    assert "UTF-8)" in message


def test_a_file_beyond_the_size_limit_is_refused():
    """A file above the size limit is refused."""
    assert "larger than 16 MiB" in refused(b" " * (xml_tree.MAX_BYTES + 1))[0]


def test_deep_nesting_is_refused():
    """Elements nested deeper than 64 are refused."""
    assert "nested deeper than 64" in refused("<suite>" + "<test>" * 100_000)[0]


def test_more_elements_than_sense_are_refused(monkeypatch: pytest.MonkeyPatch):
    """The number of elements has a limit."""
    monkeypatch.setattr(xml_tree, "MAX_ELEMENTS", 50)
    assert "the file has more than 50 elements" in refused(b"<suite>" + b"<a/>" * 50)[-1]


def test_more_attributes_than_sense_are_refused():
    """The number of attributes of an element has a limit."""
    attributes = " ".join(f'a{number}=""' for number in range(300))
    assert "more than 256 attributes" in refused(f"<suite><test {attributes}/></suite>")[-1]


def loops(depth: int, values: str, body: str) -> str:
    """Return nested loops, each over the same values."""
    opening = "".join(f'<for name="v{level}" in="{values}">' for level in range(depth))
    return f'<suite name="S">{opening}{body}{"</for>" * depth}</suite>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (loops(4, "0 1 2 3 4 5 6 7 8 9", "<test>T</test>"), "unfolds into more than 2000 tests"),
        (loops(15, "0 1 2 3 4 5 6 7 8 9", ""), "steps to unfold"),
        (loops(1, " ".join("a" * 5000), f'<test param="{"p" * 60_000}">T</test>'), "characters"),
    ],
)
def test_loops_are_bounded(text: str, message: str, monkeypatch: pytest.MonkeyPatch):
    """Tests, steps and characters that loops unfold into have limits; that of tests is made smaller, to be quick."""
    monkeypatch.setitem(LIMITS, "tests", 2000)
    assert message in refused(text)[0]


def test_loops_are_not_nested_without_end():
    """Loops nested too deep are an error, and the rest of the suite stays."""
    loaded = load_suite_bytes(loops(17, "a", "<test>T</test>").encode(), "s.xml")
    assert "nested more than 16 deep" in loaded.errors[0].text


def test_a_text_that_variables_blow_up_is_an_error():
    """A text that substitution makes too long is an error."""
    text = f'<suite name="S"><test param="{"${v}" * 1000}">T</test></suite>'
    (error,) = load_suite_bytes(text.encode(), "s.xml", variables={"v": "x" * 100_000}).errors
    assert "attribute 'param' of <test> is longer than 65536 characters once its variables are put in" in error.text


def test_includes_do_not_multiply(tmp_path: Path):
    """The number of included files has a limit."""
    for number in range(15):
        line = f"<include>{number + 1}.xml</include>"
        (tmp_path / f"{number}.xml").write_text(f'<suite name="S">{line * 2}</suite>')
    (tmp_path / "15.xml").write_text('<suite name="S"><test>T</test></suite>')
    loaded = load_suite(tmp_path / "0.xml")
    assert f"includes more than {LIMITS['files']} files" in loaded.errors[0].text


def test_requirements_do_not_multiply():
    """The work for requirements of a shared name has a limit."""
    text = f'<suite name="S">{"<test>T</test>" * 3000}{"<test requires=" + chr(34) + "test:T" + chr(34) + ">U</test>"}'
    text += '<test requires="test:T">U</test>' * 1000 + "</suite>"
    assert "steps to unfold" in refused(text)[0]


def test_endless_problems_are_counted_not_kept():
    """At most MAX_DIAGNOSTICS problems are kept, and the others are counted."""
    text = '<suite name="S">' + "<tset/>" * 5000 + "<test/>" * 5000 + "</suite>"
    loaded = load_suite_bytes(text.encode(), "s.xml", lenient=True)
    assert len(loaded.diagnostics) == MAX_DIAGNOSTICS + 2
    assert loaded.errors


@pytest.mark.parametrize("size", [100_000])
@pytest.mark.parametrize(
    "piece", ["<!--", "<![CDATA[", "<?x ", "<!DOCTYPE s ", '<!DOCTYPE "', "<", "&", "<a b='", "-->"]
)
def test_repeated_openings_take_no_more_than_linear_time(piece: str, size: int):
    """Repeated openings of comments and sections are scanned in linear time."""
    refused(piece * size)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path):
    """A named pipe is refused instead of waiting for data."""
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "s.xml").write_text('<suite name="S"><include>pipe.xml</include></suite>')
    assert "no regular file" in load_suite(tmp_path / "pipe.xml").errors[0].text
    assert "no regular file" in load_suite(tmp_path / "s.xml").errors[0].text


def test_files_that_cannot_be_read_are_reported(tmp_path: Path):
    """Missing files, folders and impossible names are errors."""
    assert "No such file" in load_suite(tmp_path / "none.xml").errors[0].text
    assert "this is a folder" in load_suite(tmp_path).errors[0].text
    assert "cannot be read" in load_suite("a\0b").errors[0].text
