"""``rtf robot``: list, check, new and test."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

import pytest

from rtf.robot.model import find_robot, load_robot

pytestmark = pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")
#: Descriptions of other robots: an arm, one with a slide, a hand, a mobile manipulator, a humanoid; and their joints.
OTHERS = {
    "ur_description/urdf/ur5_robot.urdf": 6,
    "panda_description/urdf/panda.urdf": 8,
    "allegro_hand_description/urdf/allegro_left_hand.urdf": 16,
    "tiago_description/robots/tiago.urdf": 48,
    "talos_data/robots/talos_full_v2.urdf": 32,
}


def robot(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run ``rtf robot`` in a folder."""
    command = [sys.executable, "-m", "rtf", "robot", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def test_the_shipped_robots_are_listed_and_in_order(tmp_path: Path):
    """All robots are listed, one that cannot be read as such; the shipped ones are in order."""
    (tmp_path / "robots" / "broken").mkdir(parents=True)
    (tmp_path / "robots" / "broken" / "robot.toml").write_text("schema = 3\n", encoding="utf-8")
    listed = robot(tmp_path, "list")
    assert listed.returncode == 0
    names = [line.split()[0] for line in listed.stdout.splitlines()]
    assert names == ["bench", "broken", "icub"]
    assert "cannot be read" in listed.stdout
    for name, joints in (("bench", 2), ("icub", 53)):
        checked = robot(tmp_path, "check", name)
        assert checked.returncode == 0, checked.stdout + checked.stderr
        assert f"IN ORDER  {name}: {joints} joints" in checked.stdout
        assert ("tables of chains: left_arm (1.0, 1.7, 2.0, 3.0), " in checked.stdout) == (name == "icub")


def test_a_picture_is_drawn(tmp_path: Path):
    """``--picture`` draws the robot in each pose, with its workspace."""
    from PIL import Image

    from rtf.simulator.errors import RenderingError
    from rtf.simulator.rendering import rendering_back_end

    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    bench = find_robot("bench").parent
    (tmp_path / "bench.xml").write_text((bench / "bench.xml").read_text(encoding="utf-8"), encoding="utf-8")
    text = (bench / "robot.toml").read_text(encoding="utf-8")
    text += "[workspace]\nbox = { low = [-0.5, -0.3, 0], high = [0.5, 0.3, 1] }\n[safe.folded]\nelbow = 120\n"
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    checked = robot(tmp_path, "check", "./robot.toml", "--picture", "bench.png")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    picture = Image.open(tmp_path / "bench.png").convert("RGB")
    assert picture.size == (1280, 480), "home, and folded beside it"
    colours = [picture.getpixel((x, y)) for x in range(0, 640, 4) for y in range(0, 480, 4)]
    assert any(red > 150 and blue < 80 < green for red, green, blue in colours), "the upper arm is orange"
    assert any(red > 120 and max(green, blue) < 60 for red, green, blue in colours), "the workspace is red"


def test_a_weak_or_touching_robot_is_not_in_order(tmp_path: Path):
    """A motor too weak for gravity, and links that touch, are named."""
    text = (find_robot("bench")).read_text(encoding="utf-8")
    text = text.replace("max_torque = 15.0", "max_torque = 0.2").replace("[scene]", "[body]\nnear = 0\n[scene]")
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    description = find_robot("bench").parent / "bench.xml"
    (tmp_path / "bench.xml").write_text(description.read_text(encoding="utf-8"), encoding="utf-8")
    checked = robot(tmp_path, "check", "./robot.toml")
    assert checked.returncode == 1
    assert "shoulder: gravity takes" in checked.stdout
    assert "touch in the home pose" in checked.stdout
    assert "NOT IN ORDER" in checked.stdout


def test_poses_outside_of_the_workspace_are_not_in_order(tmp_path: Path):
    """A pose beyond the workspace is named with point and plane; an unknown link is an error."""
    bench = find_robot("bench").parent
    (tmp_path / "bench.xml").write_text((bench / "bench.xml").read_text(encoding="utf-8"), encoding="utf-8")
    text = (bench / "robot.toml").read_text(encoding="utf-8")
    text += "[workspace]\nbox = { low = [-0.3, -0.3, 0], high = [0.3, 0.3, 1] }\n[safe.stretched]\nshoulder = 90\n"
    (tmp_path / "robot.toml").write_text(f"{text}elbow = 0\n", encoding="utf-8")
    checked = robot(tmp_path, "check", "./robot.toml")
    assert checked.returncode == 0, "the origins of the links count, and stay within"
    tip = "[workspace.points]\ntip = { link = 'fore', position = [0, 0, -0.22], radius = 0.02 }\n"
    (tmp_path / "robot.toml").write_text(f"{text}elbow = 0\n{tip}", encoding="utf-8")
    checked = robot(tmp_path, "check", "./robot.toml")
    assert checked.returncode == 1
    assert "problem: tip is 190 mm beyond least x of the workspace in the safe pose stretched" in checked.stdout
    assert "in the home pose" not in checked.stdout
    (tmp_path / "robot.toml").write_text(f"{text}{tip.replace('fore', 'four')}", encoding="utf-8")
    errors = robot(tmp_path, "check", "./robot.toml").stderr
    assert "robot.toml:61: the point tip of the workspace is on 'four', which bench.xml does not have" in errors
    assert "; its links are post, upper, fore" in errors


def test_a_draft_of_what_is_shipped_is_in_order(tmp_path: Path):
    """A draft from a description is in order, lists its assumptions, and overwrites nothing."""
    description = find_robot("bench").parent / "bench.xml"
    made = robot(tmp_path, "new", str(description), "--name", "mine")
    assert made.returncode == 0, made.stderr
    draft = load_robot(str(tmp_path / "robots" / "mine"))
    assert [axis.name for axis in draft.axes] == ["shoulder", "elbow"]
    assert draft.profile == "unvalidated"
    assert len(draft.assumed) >= 4
    assert robot(tmp_path, "check", "mine").returncode == 0
    again = robot(tmp_path, "new", str(description), "--name", "mine")
    assert again.returncode == 4
    assert "exists" in again.stderr
    assert robot(tmp_path, "new", "nowhere.urdf").returncode == 4
    (tmp_path / "rock.xml").write_text("<mujoco><worldbody/></mujoco>", encoding="utf-8")
    rock = robot(tmp_path, "new", "rock.xml")
    assert rock.returncode == 1
    assert "no joint that turns or slides" in rock.stderr


@pytest.mark.parametrize("end", OTHERS)
def test_other_robots(tmp_path: Path, end: str):
    """Drafts of other robots are in order: each joint has a part, and a motor that carries its links."""
    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        pytest.skip("needs pip install 'rtf[robots]'")
    (description,) = (file.locate() for file in files if str(file).endswith(end))
    assert robot(tmp_path, "new", str(description), "--name", "other").returncode == 0
    checked = robot(tmp_path, "check", "other")
    assert checked.returncode == 0, checked.stdout
    assert f"IN ORDER  other: {OTHERS[end]} joints" in checked.stdout


def test_missing_meshes_are_drawn_as_capsules(tmp_path: Path):
    """Missing meshes are replaced by capsules, with a message; the draft, whose joint has a space, can be drawn."""
    from rtf.simulator.plant import Options, build

    mesh = "<visual><geometry><mesh filename='package://nowhere/{}.stl'/></geometry></visual>"
    inertia = "<inertial><mass value='1'/><inertia ixx='.01' iyy='.01' izz='.01' ixy='0' ixz='0' iyz='0'/></inertial>"
    (tmp_path / "lost.urdf").write_text(
        f"<robot name='lost'><link name='base'/><link name='one'>{inertia}{mesh.format('one')}</link>"
        f"<link name='two'>{inertia.replace('.01', '0')}{mesh.format('two')}</link>"
        "<joint name='first joint' type='revolute'><parent link='base'/><child link='one'/><axis xyz='0 1 0'/>"
        "<limit lower='-1' upper='1' effort='50' velocity='2'/></joint>"
        "<joint name='second' type='prismatic'><parent link='one'/><child link='two'/><origin xyz='0 0 .3'/>"
        "<axis xyz='0 0 1'/><limit lower='0' upper='0.2' effort='80' velocity='0.1'/></joint></robot>",
        encoding="utf-8",
    )
    made = robot(tmp_path, "new", "lost.urdf")
    assert made.returncode == 0, made.stderr
    assert "drawn as capsules, as their meshes are missing or not STL or OBJ: one, two" in made.stdout
    assert "two: no body has its inertia" in made.stdout
    lost = load_robot(str(tmp_path / "robots" / "lost"))
    assert [(axis.name, axis.unit) for axis in lost.axes] == [("first joint", "deg"), ("second", "m")]
    assert lost.axis("second").maximum == pytest.approx(0.2)
    assert build(lost, Options(cameras=True)).model.ngeom > build(lost).model.ngeom


@pytest.mark.torture
def test_the_suites_for_any_robot_on_the_bench(tmp_path: Path):
    """A share of the suites for any robot passes on the bench, and reports what is not tested."""
    healthy = robot(tmp_path, "test", "bench", "-k", "modes or rates")
    assert healthy.returncode == 0, healthy.stdout
    assert "2 joints in 1 parts, thresholds chosen" in healthy.stdout
    assert "not tested: force-torque" in healthy.stdout
