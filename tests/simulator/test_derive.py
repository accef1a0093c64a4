"""Drafts of robots: what is assumed of their drives, by the loads that their links are."""

from __future__ import annotations

import tomllib
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")

DESCRIPTION = """<mujoco><worldbody>
<body name="arm" pos="0 0 1">
  <joint name="lift" axis="0 1 0" range="-90 90" actuatorfrcrange="-12 12" frictionloss="5"/>
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
    """More than a tenth of its torque: here 5 of 29.6 Nm."""
    joints, assumed = drafted
    assert joints["lift"]["friction"] == pytest.approx(0.02 * joints["lift"]["max_torque"], rel=0.01)
    assert [line for line in assumed if "too much friction" in line and line.startswith("lift: ")]
    assert 0.0 < joints["finger"]["friction"] <= 0.02 * 15.0
