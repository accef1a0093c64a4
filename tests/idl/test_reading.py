"""Interface files: what they say is read with its places, and what is wrong is reported with file, line and column."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf import idl
from rtf.idl.reading import read_text
from rtf.idl.resolving import program_of, read_program

if TYPE_CHECKING:
    from pathlib import Path

WORDS = """struct enum service const typedef union include namespace list<i32> map<string,i32> set<A> i32 float A B x 1
-2 0x1f 1.5e3 'a' { } ( ) [ ] < > = , ; : . // /* */ /** # extends oneway void throws true A.B yarp.name"""
PIECES = st.sampled_from(WORDS.split())
#: A structure of ten others.
TEN = "struct A{0} {{ " + " ".join(f"{number}: A{{1}} f{number};" for number in range(1, 11)) + " }}"


def test_all_is_read_with_place_and_comment():
    """A comment directly above belongs to what follows; others do not."""
    program = program_of(
        "// a file\n/** Lost. */\n\n# other\nstruct A {\n"
        "  /** One. */ 1: required i32 (yarp.type = 'size_t') x = 0x10;\n"
        "  /* plain */ 2: optional list < string > y = ['a', \"b\\n\"]\n}\n"
        "/**\n * A service.\n *   indented\n **/\nservice S {\n"
        "void f(1: A a) throws (1: i32 e), /** g */ oneway void g() (a) }\n"
    )
    (struct,) = program.structs
    assert [(one.name, one.doc, one.default) for one in struct.members] == [("x", "One.", 16), ("y", "", ("a", "b\n"))]
    assert struct.doc == ""
    service = program.services["S"]
    assert service.doc == "A service.\n  indented"
    assert [(one.name, one.doc, one.oneway) for one in service.functions] == [("f", "", False), ("g", "g", True)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("struct {", r"f:1:8: '\{' is not expected here; possible: a name"),
        ("struct A {\n  1: i32 x", r"f:2:11: the end of the file is not expected here"),
        ("struct A { 1: i32 é }", r"f:1:19: 'é' is not allowed here"),
        ("/* no end", "f:1:1: '/' is not allowed here; the comment has no end"),
        ("union U { 1: i32 x }", "f:1:7: U is a union, which YARP's messages do not have"),
        ("struct A { 1: A a }", "f:1:8: A has itself as a part"),
        ("struct A { 1: i23 x }", "f:1:15: there is no type i23; did you mean i32?"),
        ("struct A { 1: i32 x, 2: i32 x }", "f:1:29: x is a field of A twice; the first is in line 1"),
        ("struct A {} struct A {}", "f:1:20: A is defined twice; the first is in line 1"),
        ("struct A { 1: i32 x.y }", r"f:1:19: x.y is the name of a field of A, but has a dot"),
        ("const i8 X = 200", "f:1:10: 200 is not a value of the type i8"),
        ("const i64 X = 99999999999999999999", "f:1:15: 99999999999999999999 does not fit into 64 bits"),
        ("const i32 X = Y const i32 Y = X", "the value of X is itself"),
        ("const string X = 'a' const i32 Y = X", "f:1:36: X is of the type string, not i32"),
        ("enum E { A } const E X = E.B", "f:1:26: there is no value E.B; did you mean E.A?"),
        ("struct P { 1: i32 x } const P O = {'y': 1}", "P has no field 'y'; it has x"),
        ("service S extends T {}", "f:1:9: there is no service T"),
        ("service S extends S {}", "f:1:9: S extends itself"),
        ("service S { void f(), void f() }", "f is a function of S twice"),
        ("typedef S t service S {}", "f:1:21: S is not a type"),
        ("const " + "list<" * 50 + "i32" + ">" * 50 + " X = 1", "nested too deeply"),
        ("const i32 X = " + "[" * 10_000, "is not expected here"),
        ("const i32 X = " + "[" * 10_000 + "]" * 10_000, "nested too deeply"),
        ("struct A0 { 1: i32 x }\n" + "\n".join(TEN.format(n, n - 1) for n in range(1, 9)), "A5 has 100000 elements"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_reported_with_its_place(text: str, message: str):
    """File, line and column, what it is, and what was perhaps meant."""
    with pytest.raises(idl.IdlError, match=message):
        program_of(text, "f")


def test_includes_are_found_beside_and_above(tmp_path: Path):
    """YARP's files name them from the root of their source; folders can be added."""
    (tmp_path / "deep").mkdir()
    (tmp_path / "lib").mkdir()
    (tmp_path / "point.thrift").write_text("struct Point { 1: i32 x } const i32 ONE = 1 service Base { void a() }")
    (tmp_path / "lib" / "other.thrift").write_text("struct Point { 1: string y }")
    main = tmp_path / "deep" / "main.thrift"
    main.write_text(
        "include 'point.thrift'\ninclude 'other.thrift'\n"
        "struct Both { 1: point.Point a; 2: other.Point b; 3: i32 c = point.ONE }\nservice S extends point.Base {}"
    )
    with pytest.raises(idl.IdlError, match=r"main\.thrift:2:1: other\.thrift is neither beside"):
        idl.read(main)
    loaded = idl.load(main, [tmp_path / "lib"])
    assert loaded.Both().c == 1
    assert loaded.Both().a.x == 0
    assert loaded.Both().b.y == ""
    assert {loaded.Both.FIELDS[0].type.yarp, loaded.Both.FIELDS[1].type.yarp} == {"point_Point", "Point"}
    assert [*loaded.S.FUNCTIONS] == ["a"]


def test_circles_of_includes_are_reported(tmp_path: Path):
    """Also a file that includes itself."""
    for name, other in [("a", "b"), ("b", "c"), ("c", "a"), ("self", "self")]:
        (tmp_path / f"{name}.thrift").write_text(f"include '{other}.thrift'")
    for name in ("a", "self"):
        with pytest.raises(idl.IdlError, match=r":1:1: (a|self)\.thrift includes this file, directly"):
            read_program(tmp_path / f"{name}.thrift")


def test_files_that_cannot_be_read_are_reported(tmp_path: Path):
    """Absent, no text, too long."""
    with pytest.raises(idl.IdlError, match=r"absent\.thrift: the file cannot be read"):
        idl.read(tmp_path / "absent.thrift")
    (tmp_path / "bytes.thrift").write_bytes(b"struct \xff")
    with pytest.raises(idl.IdlError, match="byte 7 is not UTF-8"):
        idl.read(tmp_path / "bytes.thrift")
    with pytest.raises(idl.IdlError, match="more than 1048576 characters"):
        read_text(" " * (1 << 20 | 1))


@settings(max_examples=300)
@given(pieces=st.lists(PIECES, max_size=40))
def test_any_text_is_read_or_an_error_of_ours(pieces: list[str]):
    """Words of the language in any order."""
    try:
        program_of(" ".join(pieces))
    except idl.IdlError:
        return


@given(text=st.text(max_size=60))
def test_any_characters_are_read_or_an_error_of_ours(text: str):
    """Whatever a file has in it."""
    try:
        program_of(text)
    except idl.IdlError:
        return
