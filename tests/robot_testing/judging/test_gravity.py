"""The torques that hold a robot at rest, by a model."""

import math

import pytest

from icub import ICUB, robot_description
from rtf.robot.errors import RefusedError
from rtf.robot_testing.judging.gravity import GravityModel

PENDULUM = """<robot name="pendulum"><link name="root"/>
<link name="arm"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="root"/><child link="arm"/><axis xyz="0 -1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize("angle", [-90.0, -30.0, 0.0, 60.0, 90.0])
def test_a_pendulum_needs_mass_times_gravity_times_lever(tmp_path, angle):
    """Two kilograms half a metre from the hinge, by the cosine of the angle."""
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM, encoding="utf-8")
    model = GravityModel(ICUB, str(path))
    assert "hinge" in model
    assert model.torques({"hinge": angle})["hinge"] == pytest.approx(
        2 * 9.81 * 0.5 * math.cos(math.radians(angle)), abs=1e-6
    )


def test_the_own_model_and_the_published_description_agree():
    """The legs have the same links in both, and need the same torques; unknown axes are left out."""
    posture = {"l_hip_pitch": 40.0, "l_hip_roll": 20.0, "l_knee": -50.0, "elsewhere": 12.0}
    own, published = GravityModel(ICUB).torques(posture), GravityModel(ICUB, str(robot_description())).torques(posture)
    assert abs(own["l_hip_pitch"]) > 1.0
    for joint in ("l_hip_pitch", "l_hip_roll", "l_knee", "l_ankle_pitch"):
        assert own[joint] == pytest.approx(published[joint], abs=1e-3)


def test_an_invalid_description_is_refused(tmp_path):
    """For a missing file and for other content the error names the file."""
    with pytest.raises(RefusedError, match=r"nowhere\.urdf"):
        GravityModel(ICUB, "nowhere.urdf")
    path = tmp_path / "other.urdf"
    path.write_text("cannot read a robot description", encoding="utf-8")
    with pytest.raises(RefusedError, match=r"other\.urdf"):
        GravityModel(ICUB, str(path))
