"""Configuration files in the YARP property file format."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Property
from rtf.errors import RtfError
from rtf.resources import (
    MAX_INCLUDE_DEPTH,
    MAX_SIZE,
    DiagnosticKind,
    PropertyFile,
    ResourceError,
    ResourceIncludeError,
    ResourceLimitError,
    ResourceNotFoundError,
    ResourceReadError,
    ResourceSyntaxError,
    parse_property_text,
    read_property_directory,
    read_property_file,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

DATA = Path(__file__).parent / "data"
SUITE = Property({"robotname": "icubSim"})


def parse(text: str, **variables: object) -> PropertyFile:
    """Read text with the given variables and an empty environment."""
    return parse_property_text(text, file="f.ini", variables=Property(variables), environment={})


def read(name: str | Path, cwd: Path = DATA) -> PropertyFile:
    """Read a file with the variables of a suite and an empty environment."""
    return read_property_file(name, variables=SUITE, environment={}, cwd=cwd)


@pytest.mark.parametrize(
    ("text", "properties"),
    [
        ("key value", "(key value)"),
        ("key = value", "(key value)"),
        ("key", "(key)"),
        ('key "a b" (1 2) 3.0', '(key "a b" (1 2) 3.0)'),
        ("target 10.0 -13.0", "(target 10.0 -13.0)"),
        ("a 1\na 2", "(a 2)"),
        ("A 1\na 2", "(A 1) (a 2)"),
        ("5 x", "(5 x)"),
        ("  key value", "(key value)"),
        ("// c\n# c\na 1 // c\nb 2 # c", "(a 1) (b 2)"),
        ("url http://x", '(url "http:")'),
        ("[G]\nk 1\nl = 2 3\n[]\nm 4", "(G (k 1) (l 2 3)) (m 4)"),
        ("[G]", "(G)"),
        ("[G]\nk 1\n[H]\nk 2\n[G]\nl 3", "(G (k 1) (l 3)) (H (k 2))"),
        ("[T a]\nk 1\n[T b]\nk 2", "(T a b) (a (k 1)) (b (k 2))"),
        ("[T a]\n[T a]\nk 1", "(T a a) (a (k 1))"),
        ("[a b c]\nk 1", '("a b c" (k 1))'),
        ("[G] ignored\nk 1", "(G (k 1))"),
        (" [G]\nk 1", "([G]) (k 1)"),
        ("[G\nk 1", "([G]) (k 1)"),
        ("k 1\n[k]\nl 2", "(k 1 (l 2))"),
        ("m (1 0\n 0 1)\nn 2", "(m (1 0 0 1)) (n 2)"),
        ("m (1 \\\n 2) \\\n3\nn 2", "(m (1 2) 3) (n 2)"),
        ("a 1\nb (2\nc 3", "(a 1) (b)"),
        ("a 5\nb ${a} $a", "(a 5) (b 5 5)"),
        ("[G]\na 5\nb x$a\n[]\nc $G", "(G (a 5) (b x)) (c a 5)"),
        ("\ufeffa 1", '("\ufeffa" 1)'),
        ("", ""),
    ],
)
def test_the_format(text: str, properties: str):
    """Lines become groups as YARP makes them."""
    expected = Property.parse(properties)
    if text.startswith((" [G]", "[G\n")):
        expected = Property()
        expected.put_group(Bottle.parse(text.split("\n", maxsplit=1)[0]))
        expected.put("k", 1)
    assert parse(text).properties == expected


def test_list_of_bare_values():
    """A line of bare values: the value is the first, the group has them all."""
    face = read("motortest_face.ini").properties
    assert face.find("target") == 10.0
    assert face.find_group("target") == Bottle(["target", 10.0, -13.0, -20.0, -12.0, -25.0, 12.0])
    assert face.find_group("min") == Bottle(["min", *[3.0] * 6])
    assert face.find("portname") == "/icubSim/face"
    assert face.find("robot") == "icubSim"


def test_matrix_over_several_lines():
    """A matrix goes on until its parenthesis closes, with or without backslashes."""
    arm = read("optical_encoders_consistency_left_arm.ini")
    assert arm.properties.find("matrix") == Bottle.parse("1 0 0 0 -1.625 1.625 0 0 -1.625 1.625 1.625 0 0 0 0 1")
    assert arm.diagnostics == ()
    assert arm.files == (str(DATA / "optical_encoders_consistency_left_arm.ini"),)


def test_sections_of_real_files():
    """Keys of a section may be port names, and variables work in them."""
    ports = read("robinterface_stream.ini").properties
    group = ports.find_group("PORTS")
    assert group is not None
    assert group.find_group("/icubSim/head/state:o") == Bottle(["/icubSim/head/state:o", 50, 5])
    assert len(group.tail()) == 3
    assert str(ports.location("PORTS", "/icubSim/torso/state:o")).endswith("robinterface_stream.ini:7")
    assert str(ports.location("time")).endswith("robinterface_stream.ini:2")


def test_an_unclosed_quote_hides_the_file_and_is_reported():
    """An unclosed quote hides the rest of the file, as in YARP, and is reported."""
    head = read("motortest_head.ini")
    assert head.properties == Property.parse("(name)")
    assert [(item.kind, item.location.line) for item in head.diagnostics] == [(DiagnosticKind.UNBALANCED, 1)]


def test_undefined_variables_are_reported():
    """An undefined variable is empty, as in YARP, and is reported with its place."""
    result = read_property_file(DATA / "motortest_face.ini", environment={})
    assert result.properties.find("portname") == "//face"
    found = [(item.kind, item.name, item.location.line) for item in result.diagnostics]
    undefined = DiagnosticKind.UNDEFINED_VARIABLE
    assert found == [(undefined, "robotname", 2), (undefined, "robotname", 4)]


def test_precedence_of_variables():
    """A variable is that of the environment, the suite, or the file, in this order."""
    text = "robotname mine\nport /${robotname}"
    for environment, variables, port in [
        ({}, Property(), "/mine"),
        ({}, SUITE, "/icubSim"),
        ({"robotname": "env"}, SUITE, "/env"),
    ]:
        result = parse_property_text(text, variables=variables, environment=environment)
        assert result.properties.find("port") == port


@pytest.mark.parametrize(
    ("text", "value", "message"),
    [("a 1\nb 2\na 3", 3, "the last one"), ("[G]\na 1\na 3", 1, "the first one")],
)
def test_repeated_keys_are_reported(text: str, value: int, message: str):
    """The last of two equal keys counts, in a section the first; either way it is reported."""
    result = parse(text)
    group = result.properties.find_group("G")
    assert (result.properties.find("a") if group is None else group.find("a")) == value
    assert [item.kind for item in result.diagnostics] == [DiagnosticKind.REPEATED_KEY]
    assert message in result.diagnostics[0].message


def write(folder: Path, **files: str) -> Path:
    """Write files ``name=contents`` as ``name.ini``."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / f"{name}.ini").write_text(text)
    return folder


@pytest.mark.parametrize(
    ("header", "properties"),
    [
        ('[include "b.ini"]', "(a 1) (b 2) (S (x 3)) (c 9)"),
        ('[include sec "b.ini"]', "(a 1) (sec (S (x 3)) (b 2)) (c 9)"),
        ('[include type sec "b.ini"]', "(a 1) (type sec) (sec (S (x 3)) (b 2)) (c 9)"),
    ],
)
def test_includes(tmp_path: Path, header: str, properties: str):
    """An include is read in place, into a section, or into a section of a list; it closes the open section."""
    write(tmp_path, a=f"a 1\n[O]\n{header}\nc 9", b="b 2\n[S]\nx 3")
    result = read("a.ini", tmp_path)
    expected = Property.parse(properties)
    expected.put("O")
    assert result.properties == expected
    assert [Path(file).name for file in result.files] == ["a.ini", "b.ini"]


def test_included_keys_remember_their_file(tmp_path: Path):
    """The place of a key is in the file that holds it."""
    write(tmp_path, a='[include "b.ini"]\n[include sec "b.ini"]', b="\nb 2")
    properties = read("a.ini", tmp_path).properties
    assert str(properties.location("b")) == f"{tmp_path / 'b.ini'}:2"
    assert str(properties.location("sec", "b")) == f"{tmp_path / 'b.ini'}:2"


def test_including_into_a_section_merges(tmp_path: Path):
    """Including into a section keeps its keys, and replaces those of the file."""
    write(tmp_path, a='[sec]\nx 1\ny 2\n[include sec "b.ini"]', b="y 3\nz $x")
    assert read("a.ini", tmp_path).properties == Property.parse("(sec (x 1) (y 3) (z 1))")


def test_included_files_are_found_beside_the_including_one(tmp_path: Path):
    """Includes are searched in the current directory, beside the including files, and along CONFIG_PATH."""
    write(tmp_path / "sub", a='[include "b.ini"]\n[include "more/c.ini"]', b="b 1")
    write(tmp_path / "path" / "more", c='c 1\n[include "d.ini"]', d="d 1")
    variables = Property({"CONFIG_PATH": f"{tmp_path}/none;{tmp_path}/path"})
    result = read_property_file("sub/a.ini", variables=variables, environment={}, cwd=tmp_path)
    assert result.properties == Property.parse("(b 1) (c 1) (d 1)")
    write(tmp_path, b="b 5")
    assert read("sub/b.ini", tmp_path).properties.find("b") == 1


def test_imports_find_files_of_a_context(tmp_path: Path):
    """An import finds a file in a context."""
    write(tmp_path / "data" / "contexts" / "icub", x="x 5")
    text = "a 1\n[import icub x.ini]\nb 2"
    result = parse_property_text(text, environment={"YARP_DATA_HOME": str(tmp_path / "data")}, cwd=tmp_path)
    assert result.properties == Property.parse("(a 1) (x 5) (b 2)")
    with pytest.raises(ResourceNotFoundError, match="context 'other'"):
        parse_property_text("[import other x.ini]", environment={}, cwd=tmp_path)


def test_directories(tmp_path: Path):
    """A directory is read as all its ini files in order, each starting outside of sections."""
    write(tmp_path / "d", b="y 2", a="x 1\n[S]\nk 1", c="[S]\nl 2")
    (tmp_path / "d" / "ignored.txt").write_text("z 3")
    assert read("d", tmp_path).properties == Property.parse("(x 1) (S (k 1) (l 2)) (y 2)")


def test_directories_as_sections(tmp_path: Path):
    """A directory can be read into one section for each file, named in a list."""
    write(tmp_path, a="x 1", b="y 2")
    properties = read_property_directory(tmp_path, "parts", environment={}).properties
    one, two = str(tmp_path / "a.ini"), str(tmp_path / "b.ini")
    assert properties.find_group("parts") == Bottle(["parts", one, two])
    assert properties.find_group(two) == Bottle([two, ["y", 2]])


def test_missing_files(tmp_path: Path):
    """The error about a missing file has the searched places, and the line of the include."""
    with pytest.raises(ResourceNotFoundError, match="none") as caught:
        read("none.ini", tmp_path)
    assert isinstance(caught.value, FileNotFoundError)
    assert isinstance(caught.value, RtfError)
    write(tmp_path, a='\n[include "none.ini"]')
    with pytest.raises(ResourceNotFoundError, match=r"a\.ini:2: there is no file 'none.ini'"):
        read("a.ini", tmp_path)


@pytest.mark.parametrize("name", ["", "a\0b", "x" * 5000, "\ud800"])
def test_impossible_names(tmp_path: Path, name: str):
    """An impossible name is a missing file; the empty name is the current directory."""
    if name:
        with pytest.raises(ResourceNotFoundError):
            read(name, tmp_path)
    else:
        assert read(name, tmp_path).properties == Property()


def test_unreadable_files():
    """A file that cannot be read raises ResourceReadError, which is an OSError."""
    with pytest.raises(ResourceReadError, match="cannot read /proc/self/mem: ") as caught:
        read("/proc/self/mem")  # it can be opened, but not be read at its beginning
    assert isinstance(caught.value, OSError)


def test_pipes_are_not_opened(tmp_path: Path):
    """A named pipe is not opened."""
    os.mkfifo(tmp_path / "a.ini")
    with pytest.raises(ResourceNotFoundError):
        read("a.ini", tmp_path)


def test_include_cycles(tmp_path: Path):
    """Files that include each other are an error with the circle."""
    write(tmp_path, a='[include "b.ini"]', b='[include x "a.ini"]')
    with pytest.raises(
        ResourceIncludeError, match=r"b\.ini:1: a\.ini includes itself: .*a\.ini -> .*b\.ini -> .*a\.ini"
    ):
        read("a.ini", tmp_path)


def test_include_depth(tmp_path: Path):
    """Chains of includes have a greatest depth."""
    for number in range(MAX_INCLUDE_DEPTH + 1):
        (tmp_path / f"{number}.ini").write_text(f'[include "{number + 1}.ini"]')
    with pytest.raises(ResourceIncludeError, match="deep"):
        read("0.ini", tmp_path)


def test_number_of_files(tmp_path: Path):
    """The number of included files has a limit."""
    for number in range(20):
        (tmp_path / f"{number}.ini").write_text(f'[include "{number + 1}.ini"]\n' * 2)
    (tmp_path / "20.ini").write_text("x 1")
    with pytest.raises(ResourceLimitError, match="files"):
        read("0.ini", tmp_path)


def test_size(tmp_path: Path):
    """The text of a configuration has a limit, all files and substitutions together."""
    (tmp_path / "a.ini").write_bytes(b"#" * (MAX_SIZE + 1))
    with pytest.raises(ResourceLimitError, match="larger"):
        read("a.ini", tmp_path)
    with pytest.raises(ResourceLimitError):
        parse("a xx\n" + "\n".join("a $a$a$a$a" for _ in range(40)))
    with pytest.raises(ResourceLimitError, match=r"f\.ini:2: .*nested"):
        parse("a 1\nb " + "(" * 200 + ")" * 200)


@pytest.mark.parametrize("header", ["[include a b c d]", "[import a]", "[import a b c]"])
def test_headers_without_meaning(header: str):
    """An include or import with a wrong number of words is an error with its place."""
    with pytest.raises(ResourceSyntaxError, match=r"f\.ini:2: an i"):
        parse(f"a 1\n{header}")


def test_bytes_that_are_no_text(tmp_path: Path):
    """Bytes that are not UTF-8 are kept, and a byte order mark is dropped."""
    (tmp_path / "a.ini").write_bytes(b"\xef\xbb\xbfa \xff\x00b\r\n")
    assert read("a.ini", tmp_path).properties == Property({"a": "\udcffb"})


LINES = st.lists(
    st.one_of(
        st.builds("{} {}".format, st.sampled_from("abcd"), st.integers(-5, 5)),
        st.builds("[{}]".format, st.sampled_from(["", "G", "H", "T x", "T y"])),
    ),
    max_size=12,
)


@settings(deadline=None)
@given(LINES)
def test_what_is_written_as_a_file_reads_back(lines: list[str]):
    """A property written as lines and sections reads back the same."""
    properties = parse("\n".join(lines)).properties
    plain, sections = [], []
    for key, group in properties.items():
        if any(isinstance(item, Bottle) for item in group) or len(group) == 1:
            sections += [f"[{key}]", *(str(item) for item in group.tail())]
        else:
            plain.append(str(group))
    assert parse("\n".join(plain + sections)).properties == properties


@settings(deadline=None)
@given(st.text(st.one_of(st.sampled_from('ab[](){}"#/\\$=\n\r \t15'), st.characters()), max_size=80))
def test_any_text_reads_or_raises_our_error(text: str):
    """Any text is read, or raises ResourceError."""
    try:
        parse(text, a="x y").properties.to_text()
    except ResourceError:
        return


@pytest.mark.fuzz
def test_mutated_files_read_or_raise_our_error(mutations: Callable[..., Iterator[str]], tmp_path: Path):
    """Twenty thousand damaged files are read, or raise ResourceError."""
    seeds = [
        'name "a b" // c\nrobot ${robotname}\n',
        "m (1 0 \\\n 0 1)\nk = v # c\n",
        "[PORTS]\n/${r}/x:o 50 5\n[T a]\nx {1 2}\n[]\n",
        '[include "b.ini"]\n[include s "b.ini"]\n',
    ]
    write(tmp_path, b="b 1")
    variables = Property({"robotname": "icubSim"})
    for text in mutations(seeds, 20_000, '[](){}"#/\\$=\n \t1a'):
        try:
            parse_property_text(text, variables=variables, environment={}, cwd=tmp_path)
        except ResourceError:
            continue
