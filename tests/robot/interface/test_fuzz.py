"""Mutated and generated files of robots: the reader reads them, or refuses them with an error of its own."""

from __future__ import annotations

import tempfile
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Property
from rtf.robot.interface.plan import draw_svg, draw_text
from rtf.robot.interface.problems import RobotFileError
from rtf.robot.interface.robot_reader import read_robot
from scripted_devices import DOCTYPE

RECORDED = (Path(__file__).parents[2] / "data" / "yarp_config" / "fakerobot.xml").read_bytes()
TAGS = [
    "robot",
    "devices",
    "device",
    "params",
    "param",
    "group",
    "paramlist",
    "elem",
    "actions",
    "action",
    "xi:include",
    "odd",
]
NAMES = ["name", "type", "phase", "level", "href", "enabled_by", "extern-name", "file", "build", "portprefix", "odd"]
VALUES = [
    "a",
    "b",
    "attach",
    "startup",
    "1",
    "-1",
    "r.xml",
    "../x",
    "(1 2",
    "(a b)",
    "${portprefix}",
    "<&>\"'",
    "\x85",
    "",
]


def read(data: bytes) -> None:
    """Read a file; draw the robot, or check that each problem begins with the path of the file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "r.xml")
        path.write_bytes(data)
        try:
            robot = read_robot(path, Property({"a": 1, "enable_tags": "b"})).robot
        except RobotFileError as error:
            problems = [str(problem) for problem in error.problems]
        else:
            problems = []
            draw_text(robot)
            draw_svg(robot)
        assert all(sentence.startswith(folder) for sentence in problems)


@pytest.mark.fuzz
@settings(max_examples=120, deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(RECORDED) - 1), st.integers(0, 20), st.binary(max_size=20)), max_size=8))
def test_mutated(changes: list[tuple[int, int, bytes]]):
    """A real file with bytes lost, changed and added is read or refused."""
    data = RECORDED
    for place, lost, added in changes:
        data = data[:place] + added + data[place + lost :]
    read(data)


@pytest.mark.fuzz
@settings(max_examples=120, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, len(RECORDED)), st.integers(0, len(RECORDED)), st.integers(0, len(RECORDED))),
        max_size=4,
    )
)
def test_shuffled(cuts: list[tuple[int, int, int]]):
    """A real file with pieces copied to other places is read or refused."""
    data = RECORDED
    for begin, end, place in cuts:
        data = data[:place] + data[min(begin, end) : max(begin, end)][:2000] + data[place:]
    read(data)


def element(children: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Generate an element with any known name and attributes, around these children."""

    def write(tag: str, attributes: dict[str, str], inside: list[str]) -> str:
        written = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
        return f"<{tag}{written}>{''.join(inside)}</{tag}>"

    attributes = st.dictionaries(st.sampled_from(NAMES), st.sampled_from(VALUES), max_size=4)
    return st.builds(write, st.sampled_from(TAGS), attributes, st.lists(children, max_size=4))


@pytest.mark.fuzz
@settings(max_examples=120, deadline=None)
@given(st.lists(st.recursive(st.sampled_from(VALUES).map(escape), element, max_leaves=30), max_size=5), st.booleans())
def test_made_up(inside: list[str], typed: bool):
    """A file of known elements in any order, with attributes of other elements, is read or refused."""
    text = f'{DOCTYPE if typed else ""}<robot name="r" build="1">{"".join(inside)}</robot>'
    read(text.encode())


@pytest.mark.fuzz
@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300))
def test_anything(data: bytes):
    """A file of any bytes is read or refused."""
    read(data)
