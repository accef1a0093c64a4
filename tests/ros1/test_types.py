"""Types: the hashes and bytes of real ROS 1, user's definitions, bombs, and messages of any bytes."""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.ros1.errors import DefinitionError, MessageError, Ros1Error
from rtf.ros1.types import Types, message_type, service_type

if TYPE_CHECKING:
    from pathlib import Path

#: A program of the system's Python: the types that are installed, with their hashes and texts.
INSTALLED = """
import importlib, inspect, json
found = {}
for package in ("std_msgs", "geometry_msgs", "sensor_msgs", "rosgraph_msgs"):
    for _, kind in inspect.getmembers(importlib.import_module(package + ".msg"), inspect.isclass):
        found[kind._type] = kind._md5sum, kind._full_text
print(json.dumps(found))
"""
#: A program that writes a message in ROS's own bytes, and reads it again.
BYTES = """
import io, sys
from sensor_msgs.msg import JointState
from rospy import Time
state = JointState(name=["a", "\\u00e4"], position=[0.5, -1.0], effort=[2.0])
state.header.seq, state.header.stamp, state.header.frame_id = 7, Time(3, 250000000), "base"
buffer = io.BytesIO()
state.serialize(buffer)
sys.stdout.buffer.write(buffer.getvalue())
"""


def system_python(program: str) -> bytes:
    """What a program prints that the system's Python runs."""
    return subprocess.run(["/usr/bin/python3", "-c", program], capture_output=True, check=True, timeout=60).stdout


def test_hashes_are_those_of_ros():
    """Of every installed type, whether we know it or read its text."""
    installed = json.loads(system_python(INSTALLED))
    assert len(installed) > 90
    for name, (md5sum, text) in installed.items():
        read = Types(standard=False)
        read.add_full_text(name, text)
        assert (name, read.message(name).md5sum) == (name, md5sum)
        assert read.message(name).definition.splitlines() == text.splitlines()
        assert (name, message_type(name).md5sum) == (name, md5sum)


def test_hashes_of_services():
    """Those that every ROS has."""
    assert service_type("std_srvs/Trigger").md5sum == "937c9679a518e3a18d831e57125ea522"
    assert service_type("std_srvs/SetBool").md5sum == "09fb03525b03e7ea1fd3992bafd87e16"
    assert service_type("std_srvs/Empty").md5sum == "d41d8cd98f00b204e9800998ecf8427e"


def test_bytes_are_those_of_ros():
    """Both ways."""
    kind, header = message_type("sensor_msgs/JointState"), message_type("std_msgs/Header")
    stamp = type(header().stamp)(3, 250000000)
    state = kind(header(7, stamp, "base"), ["a", "ä"], [0.5, -1.0], effort=[2.0])
    written = system_python(BYTES)
    assert bytes(kind.encode(state)) == written
    read = kind.decode(written)
    assert (read.header, read.name) == (state.header, ["a", "ä"])
    assert (read.position.tolist(), read.velocity.tolist(), read.effort.tolist()) == ([0.5, -1.0], [], [2.0])


def test_a_message_is_made_with_what_is_given():
    """The rest is zero; lists become arrays, and what does not fit is reported."""
    image = message_type("sensor_msgs/Image")(height=1, width=2, encoding="rgb8", data=b"abcdef")
    assert (image.height, image.data.tolist(), image.header.frame_id) == (1, [97, 98, 99, 100, 101, 102], "")
    state = message_type("sensor_msgs/JointState")
    with pytest.raises(MessageError, match="has no field nam; did you mean name"):
        state(nam=["a"])
    with pytest.raises(MessageError, match="has 1 fields, not 2"):
        message_type("std_msgs/String")("a", "b")
    with pytest.raises(MessageError, match="position has <U1 instead of float64"):
        state(position=["a"])
    with pytest.raises(MessageError, match="data has float64 instead of uint8"):
        message_type("sensor_msgs/Image")(data=[1.5])
    with pytest.raises(MessageError, match="do not fit into uint8"):
        message_type("sensor_msgs/Image")(data=[256])
    with pytest.raises(MessageError, match="has 2 dimensions"):
        state(position=np.zeros((2, 2)))
    with pytest.raises(MessageError, match="is no std_msgs/Int8"):
        message_type("std_msgs/Int8").encode(message_type("std_msgs/Int8")(data=300))
    changed = state()
    changed.position = [1, 2]
    assert state.decode(state.encode(changed)).position.tolist() == [1.0, 2.0]


def test_a_package_is_added(tmp_path: Path):
    """Messages refer to each other, to standard ones, and words of Python are fields."""
    package = tmp_path / "lab_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "srv").mkdir()
    (package / "msg" / "Pose.msg").write_text("geometry_msgs/Point[2] points\nint8 LIMIT=3\nTag[] tags\ntime when\n")
    (package / "msg" / "Tag.msg").write_text("string from\nbool[3] flags\n")
    (package / "srv" / "Find.srv").write_text("Tag tag\n---\nPose[] poses\nduration[] waits\n")
    types = Types()
    types.add_package(package)
    service = types.service("lab_msgs/Find")
    tag = types.message("lab_msgs/Tag")(from_="me", flags=[True, False, True])
    assert tag.from_ == "me"
    pose = types.message("lab_msgs/Pose")(tags=[tag])
    assert pose.LIMIT == 3
    reply = service.response.decode(service.response.encode(service.response(poses=[pose, pose])))
    assert [one.tags[0].from_ for one in reply.poses] == ["me", "me"]
    assert reply.poses[1].tags[0].flags.tolist() == [True, False, True]
    with pytest.raises(Ros1Error, match="has no msg"):
        types.add_package(tmp_path)


def test_what_is_unknown_has_a_place():
    """A type within another one, too; and nobody changes a standard one."""
    types = Types()
    with pytest.raises(Ros1Error, match=r"'std_msgs/Sting'; did you mean std_msgs/String\?"):
        types.message("std_msgs/Sting")
    with pytest.raises(Ros1Error, match="no type of services 'std_srvs/Triger'; did you mean std_srvs/Trigger"):
        types.service("std_srvs/Triger")
    types.add_message("lab/Outer", "int8 a\nInner b\n", "outer.msg")
    with pytest.raises(DefinitionError, match=r"outer\.msg:2: there is no type lab/Inner"):
        types.message("lab/Outer")
    with pytest.raises(DefinitionError, match="std_msgs/String is known, with another definition"):
        types.add_message("std_msgs/String", "int8 data")
    types.add_message("std_msgs/String", "string data # the same")


def nested(depth: int, line: str = "T{} a\n") -> str:
    """A text with types that are nested."""
    rule = "=" * 80
    inner = "".join(f"{rule}\nMSG: p/T{level}\n{line.format(level + 1)}" for level in range(1, depth))
    return f"{line.format(1)}{inner}{rule}\nMSG: p/T{depth}\nint8 a\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (nested(10_000), "nested more than 50 deep"),
        (nested(40, "T{0} a\nT{0} b\n"), "fields; at most"),
        (nested(30, "T{}[1000] a\n"), "fields; at most"),
        (nested(1, "T{}[1001] a\n"), "an array of 1001 p/T1"),
        (nested(1, "E[] a\n") + "=" * 80 + "\nMSG: p/E\n", "a list of p/E, which has no bytes"),
        (nested(1, "T0 a\n"), "contains itself"),
        ("T9 a\n", "there is no type p/T9"),
    ],
)
def test_a_bomb_is_refused(text: str, complaint: str):
    """Before anything is made of it."""
    types = Types(standard=False)
    types.add_full_text("p/T0", text)
    with pytest.raises(DefinitionError, match=complaint):
        types.message("p/T0")


_strings = st.text(max_size=8)
_doubles = st.lists(st.floats(allow_nan=False), max_size=6)


@given(names=st.lists(_strings, max_size=4), numbers=_doubles, data=st.binary(max_size=20))
def test_what_is_written_is_read(names: list[str], numbers: list[float], data: bytes):
    """Messages of any values."""
    state, image = message_type("sensor_msgs/JointState"), message_type("sensor_msgs/Image")
    read = state.decode(state.encode(state(name=names, position=numbers, velocity=numbers)))
    assert (read.name, read.position.tolist(), read.velocity.tolist()) == (names, numbers, numbers)
    assert image.decode(image.encode(image(data=data))).data.tobytes() == data


@given(st.binary(max_size=120), st.sampled_from(["sensor_msgs/JointState", "sensor_msgs/PointCloud", "std_msgs/Empty"]))
@pytest.mark.fuzz
def test_any_bytes_are_a_message_or_an_error(data: bytes, name: str):
    """Lengths that are announced are not believed."""
    kind = message_type(name)
    try:
        message: Any = kind.decode(data)
    except MessageError:
        return
    assert bytes(kind.encode(message)) == data
