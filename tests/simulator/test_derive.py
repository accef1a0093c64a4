"""Drafts of robots: what is assumed of their drives, by the loads that their links are."""

from __future__ import annotations

import math
import tomllib
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")

DESCRIPTION = """<mujoco><worldbody>
<body name="arm" pos="0 0 1">
  <joint name="lift" axis="0 1 0" range="-90 90" actuatorfrcrange="-12 12" frictionloss="2.5"/>
  <geom type="sphere" pos="0.5 0 0" size="0.02" mass="2"/>
  <body name="tip" pos="0.5 0 0">
    <joint name="finger" axis="0 0 1" range="0 60" actuatorfrcrange="-15 15"/>
    <geom type="sphere" pos="0.05 0 0" size="0.005" mass="0.01"/>
  </body>
</body></worldbody></mujoco>"""


@pytest.fixture
def drafted(tmp_path: Path) -> tuple[dict[str, dict[str, float]], list[str]]:
    """The joints of a draft, and what it assumed."""
    from rtf.simulator.derive import draft

    path = tmp_path / "arm.xml"
    path.write_text(DESCRIPTION, encoding="utf-8")
    made = draft("arm", path, 'file = "arm.xml"')
    parts = tomllib.loads(made.text)["parts"]
    return {name: joint for part in parts.values() for name, joint in part["joints"].items()}, made.assumed


def test_a_motor_bears_the_weight_in_the_worst_pose(drafted):
    """With its nominal current, half the peak; an effort that cannot is replaced, and said to be."""
    joints, assumed = drafted
    assert joints["lift"]["max_torque"] == pytest.approx(3.0 * 2.01 * 9.81 * 0.5, rel=0.02)
    assert "max_torque" not in joints["finger"], "the description's is enough"
    assert any(
        line.startswith("lift: its effort in the description is 12, less than gravity needs") for line in assumed
    )


def test_a_rotor_goes_with_its_links_and_its_motor(drafted):
    """Half of the inertia of the links; of a strong motor on a light link what its torque brings to speed in 5 ms."""
    joints, _ = drafted
    assert joints["lift"]["armature"] == pytest.approx(0.5 * 2.01 * 0.25, rel=0.05)
    assert joints["finger"]["armature"] == pytest.approx(0.005 * 15.0 / 1.5708, rel=0.01)


def test_friction_that_no_drive_has_is_replaced(drafted):
    """At rest more than a tenth of its torque: here 1.3 times 2.5 of 29.6 Nm."""
    joints, assumed = drafted
    assert joints["lift"]["friction"] == pytest.approx(0.02 * joints["lift"]["max_torque"], rel=0.01)
    assert [line for line in assumed if "too much friction" in line and line.startswith("lift: ")]
    assert 0.0 < joints["finger"]["friction"] <= 0.02 * 15.0


def test_a_heavy_joint_is_no_faster_than_its_drive_can_follow(tmp_path: Path):
    """At the greatest speed a minimum-jerk move over half the range accelerates with half of the torque."""
    from rtf.simulator.derive import draft

    path = tmp_path / "trunk.xml"
    path.write_text(
        '<mujoco><worldbody><body name="trunk"><joint name="waist" axis="0 0 1" range="-90 90" '
        'actuatorfrcrange="-1 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>',
        encoding="utf-8",
    )
    made = draft("trunk", path, 'file = "trunk.xml"')
    waist = tomllib.loads(made.text)["parts"]["waist"]["joints"]["waist"]
    assert waist["armature"] == pytest.approx(0.5)
    way, peak = math.pi / 2, math.radians(waist["max_velocity"])
    seconds = 15 / 8 * way / peak
    assert (1.0 + 0.5) * 10 / math.sqrt(3) * way / seconds**2 == pytest.approx(0.5, rel=1e-3)
    assert [line for line in made.assumed if line.startswith("slower than described") and line.endswith(": waist")]


_URDF = """<robot name="two">
<link name="base"/>
<link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="first" type="continuous"><parent link="base"/><child link="a"/></joint>
<joint name="second" type="revolute"><parent link="a"/><child link="b"/>
<limit lower="-1" upper="1" effort="inf" velocity="nan"/></joint>
</robot>"""


def test_two_joints_of_one_name_are_an_error(tmp_path: Path):
    """It names the file and the joint."""
    from rtf.robot.errors import ConfigurationError
    from rtf.robot.model.description import read_joints

    path = tmp_path / "two.urdf"
    path.write_text(_URDF.replace("second", "first"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="repeated name 'first'") as caught:
        read_joints(path)
    assert str(path) in str(caught.value)


def test_efforts_and_speeds_that_are_no_numbers_count_as_missing(tmp_path: Path):
    """An infinite effort would make an infinite rotor."""
    from rtf.robot.model.description import read_joints

    path = tmp_path / "two.urdf"
    path.write_text(_URDF, encoding="utf-8")
    second = read_joints(path)["second"]
    assert (second.effort, second.max_velocity) == (None, None)
