"""The plan of a robot as text and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from rtf.bottle import Property
from rtf.robot.interface.model import Action, ActionKind, DeviceEntry, Phase, Robot
from rtf.robot.interface.plan import draw_svg, draw_text
from rtf.robot.interface.robot_reader import read_robot
from scripted_devices import action_xml as action
from scripted_devices import device_xml as device

if TYPE_CHECKING:
    from conftest import Bench

RECORDED = Path(__file__).parents[2] / "data" / "yarp_config" / "fakerobot.xml"
_SVG = "{http://www.w3.org/2000/svg}"


def texts(svg: str) -> list[str]:
    """Return the texts of a picture, and check that it is well-formed SVG."""
    root = etree.fromstring(svg.encode(), etree.XMLParser(resolve_entities=False, no_network=True))
    assert root.tag == f"{_SVG}svg"
    assert {element.tag for element in root.iter()} <= {
        f"{_SVG}{tag}" for tag in ("svg", "title", "style", "rect", "text")
    }
    return [
        "".join(part for part in (*[child.tail for child in element], element.text) if part)
        for element in root.iter(f"{_SVG}text")
    ]


def test_a_real_robot():
    """Text and picture show every device and action, with opening in order and closing in reverse."""
    robot = read_robot(RECORDED).robot
    text = draw_text(robot)
    shown = texts(draw_svg(robot))
    for entry in robot.devices:
        assert text.count(f"    {entry.name} ({entry.kind})  ") == 2
        assert shown.count(f"{entry.name} ({entry.kind})") == 2
    for line in ("attach head_nws to head_mc", "detach cam_nws"):
        assert f"    {line} " in text
        assert line in shown
    lines = [line.split()[0] for line in text.splitlines()]
    assert lines.index("head_mc") < lines.index("imu_nws") < lines.index("startup:") < lines.index("run:")
    closing = lines[lines.index("close:") :]
    assert closing.index("imu_nws") < closing.index("head_mc")
    assert "fakerobot.xml:32:9" in text


def test_what_each_kind_of_action_says(bench: Bench):
    """The line of an action names its device, its targets and its timeout; phases without actions are left out."""
    inside = (
        action("attach", level=1, networks="(left right)", left="b", right="c")
        + action("attach", level=2, all="1")
        + action("attach", level=3, device="b", network="net")
        + action("custom", level=4, name="tune")
        + action("park", "interrupt2", 1, target="b", timeout="5")
        + action("abort", "interrupt3", 1)
    )
    robot = bench.read(
        device("a", inside=inside)
        + device("b")
        + device("c")
        + device("d", "robotDescription_nws_yarp", action("attach"))
    ).robot
    text = draw_text(robot)
    for expected in (
        "attach a to left=b, right=c",
        "attach a to b, c, d",
        "attach a to net=b",
        "custom a (name tune)",
        "∥ park b by a, at most 5 s",
        "abort a",
        "attach d to the list of devices",
        "interrupt2: the second signal",
    ):
        assert expected in text
    assert "interrupt1" not in text


def test_a_robot_without_anything():
    """A robot without devices has a plan with its name, its port and the phases."""
    robot = Robot("r", "")
    assert draw_text(robot).startswith("r, build 0, 0 devices, port /yarprobotinterface\n")
    assert "run" in texts(draw_svg(robot))


@given(name=st.text(), other=st.text(), value=st.text())
def test_texts_are_only_texts(name: str, other: str, value: str):
    """With any names the picture is well formed, and the text has printable characters only."""
    odd = Action(name, Phase.STARTUP, 1, ActionKind.CUSTOM, Property({"p": value}))
    robot = Robot(name, other, devices=(DeviceEntry(name, other, actions=(odd,)),))
    assert texts(draw_svg(robot))
    assert all(line.isprintable() for line in draw_text(robot).split("\n"))
