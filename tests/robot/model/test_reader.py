"""The reader of robot.toml: the values of a valid file, and the errors of an invalid one, with file and line."""

from __future__ import annotations

import tomllib
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.resources.toml_file import line_of, steps_of
from rtf.robot.errors import RefusedError
from rtf.robot.model import RobotModelError, find_robot, load_robot, robot_names

BENCH = find_robot("bench").parent
HEAD = """schema = 1
name = "two"
[description]
file = "two.xml"
[motors]
small = { rotor_resolution = 4096, nominal_current = 1.0, peak_current = 2.0, overload_current = 5.0 }
[defaults]
motor = "small"
max_torque = 5.0
"""
JOINTS = """[parts.arm.joints]
shoulder = { limits = [-90, 90] }
elbow = { limits = [0, 120] }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with copies of the bench's description."""
    for name in ("two.xml", "bench.xml"):
        (tmp_path / name).write_text((BENCH / "bench.xml").read_text(encoding="utf-8"), encoding="utf-8")
    return tmp_path


def read(folder: Path, text: str):
    """Read a robot.toml with this text."""
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return load_robot(str(folder))


def test_a_small_robot(folder: Path):
    """Values that the file leaves out have defaults; each joint has a motor of its own."""
    robot = read(folder, HEAD + JOINTS)
    assert list(robot.index) == ["shoulder", "elbow"]
    shoulder = robot.axis("shoulder")
    assert (shoulder.minimum, shoulder.maximum, shoulder.home, shoulder.part) == (-90.0, 90.0, 0.0, "arm")
    assert robot.profile == "unvalidated"
    assert robot.joint_to_motor.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert robot.simulated_name == "twoSim"
    with pytest.raises(RefusedError, match="no joint 'wrist'; its joints are shoulder, elbow"):
        robot.axis("wrist")


def test_the_description_says_what_the_file_does_not(folder: Path):
    """Joints without limits in robot.toml have those of the description."""
    robot = read(folder, HEAD + "[parts.arm.joints]\nshoulder = {}\nelbow = {}\n")
    assert robot.axis("shoulder").minimum == pytest.approx(-100.0)
    assert robot.axis("elbow").maximum == pytest.approx(130.0)


def test_friction_at_rest_and_gears(folder: Path):
    """Joints have more friction at rest and rigid gears, unless the file says otherwise; so do sensors."""
    joints = JOINTS.replace("120] }", "120], stribeck = 0.0, stribeck_speed = 5.0, play = 0.5, stiffness = 800.0 }")
    robot = read(folder, HEAD + joints + "[sensors.joint_torques]\nnoise = 0.01\n")
    shoulder, elbow = robot.axis("shoulder"), robot.axis("elbow")
    assert (shoulder.stribeck, shoulder.stribeck_speed, shoulder.play, shoulder.stiffness) == (0.3, 3.0, 0.0, None)
    assert (elbow.stribeck, elbow.stribeck_speed, elbow.play, elbow.stiffness) == (0.0, 5.0, 0.5, 800.0)
    assert (robot.sensors.joint_torques.noise, robot.sensors.joint_torques.delay) == (0.01, 0.01)
    assert robot.sensors.encoders.speed_window == 0.008


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (HEAD + JOINTS.replace("[-90, 90]", "[90, -90]"), 11, "a smaller and a greater number"),
        (HEAD + JOINTS.replace("[0, 120]", "[0, nan]"), 12, "elbow.limits.1: expected a finite number, not nan"),
        (HEAD + JOINTS.replace("120] }", "120], gearbox = inf }"), 12, "finite number, not inf"),
        (HEAD + JOINTS.replace("120] }", "120], gearbox = 0 }"), 12, "elbow: gearbox is 0"),
        (HEAD + JOINTS.replace("120] }", "120], play = -1 }"), 12, "play"),
        (HEAD + JOINTS.replace("120] }", "120], stiffness = 0 }"), 12, "stiffness"),
        (HEAD.replace("max_torque = 5.0", "max_torque = 5.0\ngearbox = 0") + JOINTS, 10, "shoulder: gearbox is 0"),
        (HEAD + JOINTS.replace("120] }", "120], home = 200 }"), 12, "not within its limits"),
        (HEAD + JOINTS.replace("120] }", "120], motor = 'big' }"), 12, "none of"),
        (HEAD.replace('motor = "small"', 'motor = "big"') + JOINTS, 8, "motor 'big' is none of [motors]: small"),
        (HEAD + JOINTS.replace("120] }", "120], geerbox = 3 }"), 12, "there is no key 'geerbox'"),
        (HEAD.replace("[defaults]", "[default]") + JOINTS, 7, "there is no key 'default'"),
        (HEAD + JOINTS.replace("[0, 120]", "[0, '120']"), 12, "parts.arm.joints.elbow.limits"),
        (HEAD + JOINTS + "wrist = {}\n", 13, "no joint 'wrist'; its joints are shoulder, elbow"),
        (HEAD + JOINTS + "[parts.hand.joints]\nelbow = { limits = [0, 1] }\n", 14, "belongs to arm and hand"),
        (HEAD + "[parts.arm.joints]\n", 10, "has no joints"),
        (HEAD + "[parts.arm]\nboards = [3]\n" + JOINTS, 11, "3 joints together, the part 2"),
        (
            HEAD + "[parts.arm]\ncouplings = [{ first = 0, joint_to_motor = [[1, 1], [1, 1]] }]\n" + JOINTS,
            11,
            "cannot be inverted",
        ),
        (
            HEAD + "[parts.arm]\ncouplings = [{ first = 1, joint_to_motor = [[1]] }]\n" + JOINTS,
            11,
            "no board begins at joint 1",
        ),
        (
            HEAD
            + JOINTS
            + "[[parts.arm.couplings]]\nfirst = 0\njoint_to_motor = [[1, 0], [0, 1]]\n"
            + "[[parts.arm.couplings]]\nfirst = 0\njoint_to_motor = [[1, 1], [0, 1]]\n",
            16,
            "two couplings from joint 0",
        ),
        (HEAD + "[parts.arm]\ntogether = [[['wrist']]]\n" + JOINTS, 11, "has no joint wrist"),
        (HEAD.replace("schema = 1", "schema = 2") + JOINTS, 1, "schema"),
        (HEAD.replace('"two"', '"two arms"') + JOINTS, 2, "name"),
        (HEAD.replace("two.xml", "three.xml") + JOINTS, 4, "there is no"),
        (HEAD.replace('file = "two.xml"', 'file = "x"\npackage = "no-such-package"') + JOINTS, 5, "pip install"),
        (HEAD + JOINTS + "[sensors.angles.hand]\nport='h'\nopen=1\nbent=2\nchannels=[['toe', 1.0]]\n", 13, "'toe'"),
        (HEAD + JOINTS + "[body]\noutlines = [{ link = 'fore', radius = 0.1 }]\n", 14, "start, end and radius"),
        (HEAD + JOINTS + "[sensors.force_torque]\nf = { link = 'fore', port = 'p', parts = ['leg'] }\n", 14, "'leg'"),
        (HEAD + JOINTS + "[sensors.inertial]\na = { link = 'fore' }\nb = { link = 'fore' }\n", 15, "the same port"),
        (HEAD + JOINTS + "[sensors.battery]\ncapacity = 9\nfull = 30\nempty = 42\nmax_current = 9\n", 16, "less than"),
        (HEAD + JOINTS + "[sensors.battery]\ncapacity = 9\nfull = 42\nempty = 30\n", 13, "max_current"),
        (HEAD + JOINTS + "[guard]\npeak_time = 0.3\nbreakaway = 2.0\n", 15, "guard.breakaway"),
        (HEAD + JOINTS + "[guard]\nstalled_time = 0\n", 14, "guard.stalled_time"),
        (HEAD + JOINTS + "[thresholds.JointLimits]\ntolerance = 1\n", 13, 'origin is "measured on'),
        (HEAD + JOINTS + "[thresholds.JointLimits]\norigin = 'guessed'\n", 14, "not 'guessed'"),
        (HEAD + JOINTS + "[thresholds.JointLimits]\norigin = 'chosen'\njoints = [1]\n", 15, "joints says what is"),
        (HEAD + JOINTS + "[thresholds.JointLimits]\norigin = 'chosen'\nhome = { a = 1 }\n", 15, "home"),
        (HEAD + JOINTS + "[workspace]\n", 13, "write a box, or planes"),
        (HEAD + JOINTS + "[workspace]\nbox = { low = [0, 0, 0], high = [1, 0, 1] }\n", 13, "each number of low"),
        (HEAD + JOINTS + "[workspace]\nbox = { low = [0, 0], high = [1, 0, 1] }\n", 14, "workspace.box.low"),
        (HEAD + JOINTS + "[workspace.planes]\nwall = { point = [1, 0, 0], normal = [0, 0, 0] }\n", 13, "plane wall"),
        (HEAD + JOINTS + "[workspace.planes]\nwall = { point = [inf, 0, 0], normal = [1, 0, 0] }\n", 14, "finite"),
        (HEAD + JOINTS + "[safe.folded]\nelbov = 90.0\n", 14, "no joint 'elbov'; did you mean elbow?"),
        (HEAD + JOINTS + "[safe.folded]\nelbow = 121.0\n", 14, "elbow at 121 deg is not within its limits 0 and 120"),
        (HEAD + "[parts.'an arm'.joints]\nshoulder = {}\n", 10, "letters, digits and underscores"),
    ],
)
def test_errors_have_their_place(folder: Path, text: str, line: int, said: str):
    """An error in robot.toml is reported with the file, the line and the reason."""
    with pytest.raises(RobotModelError) as caught:
        read(folder, text)
    message = str(caught.value)
    assert message.startswith(f"{folder / 'robot.toml'}:{line}: "), message
    assert said in message


@pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")
@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (HEAD + JOINTS.replace("elbow", "elbov"), 12, "bench.xml has no joint 'elbov', but"),
        (
            HEAD + JOINTS + "[[body.outlines]]\nlink = 'fore'\ncentre = [0, 0, 0]\nhalf = [1, 1, 1]\n"
            "[[body.outlines]]\nlink = 'for'\ncentre = [0, 0, 0]\nhalf = [1, 1, 1]\n",
            18,
            "the outline 1 is on 'for', which bench.xml does not have; its links are post, upper, fore",
        ),
        (HEAD + JOINTS + "[sensors.inertial.a]\nlink = 'hand'\n", 14, "the sensor a is on 'hand'"),
        (HEAD + JOINTS + "[sensors.force_torque.f]\nport = 'f'\nlink = 'hand'\n", 15, "the sensor f is on 'hand'"),
        (HEAD + JOINTS + "[sensors.skin]\np = { link = 'hand', port = 'p', triangles = 1 }\n", 14, "'hand'"),
        (HEAD + JOINTS + "[sensors.cameras]\nc = { camera = 'eye', port = 'c' }\n", 14, "has no camera 'eye'"),
        (HEAD + JOINTS + "[body]\nattach = [{ body = 'fore', file = 'no.xml', prefix = 'x' }]\n", 14, "no.xml"),
        (HEAD + JOINTS + "[workspace.points]\np = { link = 'hand' }\n[workspace.planes]\n"
         "w = { point = [9, 0, 0], normal = [-1, 0, 0] }\n", 14, "the point p of the workspace is on 'hand'"),
    ],
)  # fmt: skip
def test_what_the_description_does_not_have_has_its_place(folder: Path, text: str, line: int, said: str):
    """Links, joints, cameras and files that only building the robot shows as missing are reported with their line."""
    from rtf.simulator.plant import build

    robot = read(folder, text.replace("two.xml", "bench.xml"))
    with pytest.raises(RobotModelError) as caught:
        build(robot)
    message = str(caught.value)
    assert message.startswith(f"{folder / 'robot.toml'}:{line}: "), message
    assert said in message


def test_a_workspace_is_half_spaces(folder: Path):
    """A box is six half-spaces, a plane is one; normals point inwards in the file and outwards in the value."""
    robot = read(
        folder,
        HEAD + JOINTS + "[workspace]\nbox = { low = [-1, -2, 0], high = [1, 2, 3] }\n"
        "[workspace.planes]\ntable = { point = [0, 0, 0.5], normal = [0, 0, 2] }\n"
        "[workspace.points]\ntip = { link = 'fore', position = [0, 0, -0.2], radius = 0.02 }\n",
    )
    workspace = robot.workspace
    assert workspace is not None
    assert [one.name for one in workspace.half_spaces] == [
        *("least x", "greatest x", "least y", "greatest y", "least z", "greatest z"),
        "table",
    ]
    assert workspace.half_spaces[-1].normal == (0.0, 0.0, -1.0)
    assert workspace.beyond(np.array([0.25, 0.0, 0.3])) == pytest.approx([-1.25, -0.75, -2, -2, -0.3, -2.7, 0.2])
    assert workspace.beyond(np.zeros((4, 3))).shape == (4, 7)
    assert (workspace.points[0].link, workspace.points[0].radius) == ("fore", 0.02)
    assert read(folder, HEAD + JOINTS).workspace is None


def test_the_edges_of_a_workspace(folder: Path):
    """A box has twelve edges, a plane may cut them; a plane alone is a square of the given size."""
    box = "[workspace]\nbox = { low = [-1, -1, 0], high = [1, 1, 2] }\n"
    edges = {}
    for name, text in {
        "box": box,
        "cut": box + "[workspace.planes]\ntable = { point = [0, 0, 0.5], normal = [0, 0, 1] }\n",
        "corner": box + "[workspace.planes]\nwall = { point = [0.9, 0.9, 1.9], normal = [-1, -1, -1] }\n",
        "plane": "[workspace.planes]\ntable = { point = [0, 0, 0.5], normal = [0, 0, 1] }\n",
    }.items():
        workspace = read(folder, HEAD + JOINTS + text).workspace
        assert workspace is not None
        edges[name] = workspace.edges((0.0, 0.0, 1.0), 8.0)
    assert {name: len(found) for name, found in edges.items()} == {"box": 12, "cut": 12, "corner": 15, "plane": 4}
    assert {point[2] for edge in edges["cut"] for point in edge} == {0.5, 2.0}
    assert {point for edge in edges["plane"] for point in edge} == {
        (x, y, 0.5) for x in (-4.0, 4.0) for y in (-4.0, 4.0)
    }


def test_a_safe_pose_is_a_position_of_every_axis(folder: Path):
    """A joint that a safe pose does not name is at its home position."""
    joints = JOINTS.replace("[-90, 90]", "[-90, 90], home = 5.0")
    robot = read(folder, HEAD + joints + "[safe]\nfolded = { elbow = 90.0 }\nhanging = {}\n")
    assert robot.safe_poses == {
        "folded": {"shoulder": 5.0, "elbow": 90.0},
        "hanging": {"shoulder": 5.0, "elbow": 0.0},
    }


def test_broken_toml_is_reported_with_its_place(folder: Path):
    """The error of a file that is not TOML names the file and the line."""
    with pytest.raises(RobotModelError, match=r"robot.toml: .*line 2"):
        read(folder, "schema = 1\nname = \n")


def test_the_error_of_an_unknown_robot_has_the_searched_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The error lists the known robots and the searched folders; ``./robots`` is searched, too."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotModelError, match=r"no robot 'tin'; there are bench, icub(.|\n)*tried .*robots/tin"):
        find_robot("tin")
    (tmp_path / "robots" / "tin").mkdir(parents=True)
    (tmp_path / "robots" / "tin" / "robot.toml").write_text("", encoding="utf-8")
    assert find_robot("tin").parent.name == "tin"
    assert robot_names() == ["bench", "icub", "tin"]
    with pytest.raises(RobotModelError, match="no such file"):
        find_robot("./nowhere.toml")


def test_two_hundred_joints(tmp_path: Path):
    """A chain of 200 joints is read, and its mechanics are built."""
    count = 200
    body = "".join(
        f'<body name="b{n}" pos="0 0 0.01"><joint name="j{n}" axis="0 {n % 2} {1 - n % 2}" range="-30 30"/>'
        '<geom type="sphere" size="0.01" mass="0.01"/>'
        for n in range(count)
    )
    (tmp_path / "two.xml").write_text(
        f"<mujoco><worldbody>{body}{'</body>' * count}</worldbody></mujoco>", encoding="utf-8"
    )
    rows = "".join(f"j{n} = {{ armature = 0.01 }}\n" for n in range(count))
    robot = read(tmp_path, f"{HEAD}[parts.chain.joints]\n{rows}")
    from rtf.simulator.plant import build

    assert build(robot).jacobian.shape == (count, count)


_KEYS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_-]{0,8}", fullmatch=True)
_TABLES = st.dictionaries(
    _KEYS, st.dictionaries(_KEYS, st.integers(-5, 5), min_size=1, max_size=4), min_size=1, max_size=4
)


@given(_TABLES)
def test_every_key_is_found_in_its_line(tables: dict[str, dict[str, int]]):
    """The line of a key is found in any file of tables and keys."""
    lines, places = [], {}
    for table, entries in tables.items():
        lines.append(f"[{table}]  # a comment")
        for key, value in entries.items():
            lines.append(f"{key} = {value}")
            places[table, key] = len(lines)
    text = "\n".join(lines)
    tomllib.loads(text)
    for path, line in places.items():
        assert line_of(text, path) == line
        assert line_of(text, [*path, "deeper"]) == line


@given(st.text(max_size=200), st.lists(st.text(max_size=5), max_size=4))
def test_any_text_has_a_line(text: str, path: list[str]):
    """Any path in any text, also in broken files, has a line of the text."""
    assert 1 <= line_of(text, path) <= max(1, len(text.splitlines()))


def test_paths_of_errors():
    """A path in a message of msgspec is split into its steps."""
    assert steps_of("$.parts[...].joints[...].limits[1]") == ["parts", "...", "joints", "...", "limits", "1"]
