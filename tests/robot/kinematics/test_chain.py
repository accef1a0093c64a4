"""Chains: their poses against other ways to compute them, their Jacobian against differences, and their errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import Chain, ChainTables, LinearConstraint, Link, described_chain, pose_error, rotation_of
from rtf.robot.kinematics.tables import dh_frame
from rtf.robot.model import RobotModel
from rtf.robot.model.engine import mujoco

ANGLES = st.floats(-180.0, 180.0)
LENGTHS = st.floats(-0.5, 0.5)
ROW = st.tuples(LENGTHS, LENGTHS, ANGLES, ANGLES)  # a, d, alpha, offset


def dh_chain(rows: list[tuple[float, float, float, float]]) -> Chain:
    """A chain of turning joints with these rows of a table."""
    return Chain("any", tuple(Link(f"j{i}", -180.0, 180.0, dh_frame(*row)) for i, row in enumerate(rows)))


def by_numbers(angle: float, a: float, d: float, alpha: float, offset: float) -> np.ndarray:
    """The transform of a link as textbooks write it out, number by number."""
    theta, twist = math.radians(angle + offset), math.radians(alpha)
    ct, st_, ca, sa = math.cos(theta), math.sin(theta), math.cos(twist), math.sin(twist)
    return np.array(
        [[ct, -st_ * ca, st_ * sa, a * ct], [st_, ct * ca, -ct * sa, a * st_], [0, sa, ca, d], [0, 0, 0, 1]]
    )


@settings(max_examples=25)
@given(st.lists(st.tuples(ROW, ANGLES), min_size=1, max_size=10))
def test_the_pose_is_the_product_of_the_links(links):
    """A chain of any table has the pose of the matrices of textbooks, multiplied one by one; its frames, too."""
    chain, angles = dh_chain([row for row, _ in links]), [angle for _, angle in links]
    pose = np.eye(4)
    frames = chain.frames(angles)
    for frame, (row, angle) in zip(frames, links, strict=True):
        pose = pose @ by_numbers(angle, *row)
        np.testing.assert_allclose(frame, pose, atol=1e-12)
    np.testing.assert_allclose(chain.pose(angles), pose, atol=1e-12)


@settings(max_examples=15)
@given(st.lists(st.tuples(ROW, ANGLES, st.booleans()), min_size=1, max_size=8), st.integers(0, 7))
def test_the_jacobian_is_that_of_differences(links, link):
    """A joint that moves a little moves every frame as its column says: slides, too, and links before the tip."""
    rows = [row for row, _, _ in links]
    slides = [slides for _, _, slides in links]
    made = zip(dh_chain(rows).links, slides, strict=True)
    chain = Chain("any", tuple(Link(one.joint, -1.0, 1.0, one.frame, prismatic=slide) for one, slide in made))
    positions, link = np.array([angle for _, angle, _ in links]), min(link, len(links) - 1)
    jacobian = chain.jacobian(positions, link)
    step = 1e-5
    for joint, unit in enumerate(chain.internal):
        moved = np.zeros(len(chain))
        moved[joint] = step / unit
        before, after = (chain.frames(positions + sign * moved)[link] for sign in (-1, 1))
        np.testing.assert_allclose(pose_error(after, before) / (2 * step), jacobian[:, joint], atol=1e-7)


def test_the_tip_moves_with_the_last_link(tables: ChainTables):
    """A tool changes the pose, the frame of the last link and the Jacobian of the tip, not the links before it."""
    arm, posture = tables.chain("left_arm", "2.5"), [0, 0, 0, -30, 30, 0, 45, 0, 0, 0]
    tool = np.eye(4)
    tool[:3, 3] = (0.1, 0.02, 0.0)
    longer = arm.with_tip(tool)
    np.testing.assert_allclose(longer.pose(posture), arm.pose(posture) @ tool, atol=1e-15)
    np.testing.assert_allclose(longer.frames(posture)[-1], longer.pose(posture), atol=1e-15)
    np.testing.assert_array_equal(longer.frames(posture)[:-1], arm.frames(posture)[:-1])
    assert not np.allclose(longer.jacobian(posture), arm.jacobian(posture))
    pose, jacobian = longer.pose_and_jacobian(posture)
    np.testing.assert_array_equal(pose, longer.pose(posture))
    np.testing.assert_array_equal(jacobian, longer.jacobian(posture))


def test_many_postures_at_once(tables: ChainTables):
    """The poses of many postures are those of each."""
    leg = tables.chain("left_leg", "2.5")
    postures = np.random.default_rng(0).uniform(leg.minima, leg.maxima, (2, 3, len(leg)))
    poses = leg.pose(postures)
    assert poses.shape == (2, 3, 4, 4)
    np.testing.assert_allclose(poses[1, 2], leg.pose(postures[1, 2]), atol=1e-15)


@settings(max_examples=20)
@given(st.data())
def test_blocked_joints_are_held(tables: ChainTables, data):
    """A chain with joints held at positions has the poses of the whole one in these positions."""
    eye = tables.chain("right_eye", "2.8")
    posture = data.draw(arrays(np.float64, len(eye), elements=st.floats(-90, 90)))
    held = data.draw(st.sets(st.sampled_from(eye.joints)))
    rest = eye.blocked({joint: posture[eye.index(joint)] for joint in held})
    free = [position for joint, position in zip(eye.joints, posture, strict=True) if joint not in held]
    assert list(rest.joints) == [joint for joint in eye.joints if joint not in held]
    np.testing.assert_allclose(rest.pose(free), eye.pose(posture), atol=1e-12)
    columns = [eye.index(joint) for joint in rest.joints]
    np.testing.assert_allclose(rest.jacobian(free), eye.jacobian(posture)[:, columns], atol=1e-12)


def test_the_engine_agrees(icub: RobotModel):
    """A chain of the description has the poses and the Jacobian that the physics engine computes."""
    arm = described_chain(icub, "r_hand")
    engine = mujoco()
    model = engine.MjModel.from_xml_string(_mjcf(arm))
    data = engine.MjData(model)
    generator = np.random.default_rng(2)
    for _ in range(10):
        posture = generator.uniform(arm.minima, arm.maxima)
        data.qpos[:] = posture * arm.internal
        engine.mj_kinematics(model, data)
        engine.mj_comPos(model, data)
        np.testing.assert_allclose(data.xpos[-1], arm.pose(posture)[:3, 3], atol=1e-9)
        np.testing.assert_allclose(data.xmat[-1].reshape(3, 3), arm.pose(posture)[:3, :3], atol=1e-9)
        linear, angular = np.zeros((2, 3, model.nv))
        engine.mj_jacBody(model, data, linear, angular, model.nbody - 1)
        np.testing.assert_allclose(np.vstack([linear, angular]), arm.jacobian(posture), atol=1e-9)


def _mjcf(chain: Chain) -> str:
    """The chain as a description of its own, a body for each frame."""
    text, end = '<body name="base"', ""
    frames = [chain.base, *(link.frame for link in chain.links)]
    engine, quaternion = mujoco(), np.empty(4)
    for number, frame in enumerate(frames):
        engine.mju_mat2Quat(quaternion, frame[:3, :3].flatten())
        numbers = (" ".join(map(repr, map(float, values))) for values in (frame[:3, 3], quaternion))
        text += ' pos="{}" quat="{}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'.format(*numbers)
        end += "</body>"
        if number < len(chain):
            axis = " ".join(map(repr, chain.links[number].axis))
            text += f'<body name="b{number}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
            text += f'<joint axis="{axis}"/><body name="f{number}"'
            end += "</body>"
    return f'<mujoco><compiler angle="radian"/><worldbody>{text}{end}</worldbody></mujoco>'


def test_limits(icub: RobotModel, tables: ChainTables):
    """Limits are those of the tables, unless others are given; those of a robot by its axes' names."""
    arm = tables.chain("left_arm", "2.5")
    assert (arm.minima[0], arm.maxima[0]) == (-22.0, 84.0)
    assert arm.limited({"torso_pitch": (-5, 5)}).maxima[0] == 5.0
    assert arm.limited_by(icub.axes).maxima[arm.index("l_shoulder_yaw")] == icub.axis("l_shoulder_yaw").maximum
    with pytest.raises(RefusedError, match="torso_pitch: limits are a smaller and a greater number, not 5 and -5"):
        arm.limited({"torso_pitch": (5, -5)})


def test_violations(tables: ChainTables):
    """Each limit and each constraint that a posture does not keep is named; constraints of held joints do not count."""
    arm = tables.chain("left_arm", "2.5")
    posture = np.array([0, 0, 0, -30, 30, 0, 45, 0, 0, 0], dtype=float)
    assert arm.violations(posture) == []
    posture[[0, 4]] = 90.0, 10.0
    assert arm.violations(posture) == [
        "torso_pitch at 90 is not within -22 and 84",
        "l_body is 10, not within 26.4188 and inf",
    ]
    held = arm.blocked({"l_shoulder_pitch": -30.0})
    assert held.violations(np.delete(posture, 3)) == ["torso_pitch at 90 is not within -22 and 84"]
    assert len(held.constraint_rows()[3]) == 2
    alone = Chain("alone", arm.links, constraints=(LinearConstraint("sum", {"nowhere": 1.0}, 1.0, 2.0),))
    assert alone.violations([0, 0, 0, 0, 0, 0, 45, 0, 0, 0]) == []


def test_wrong_positions(tables: ChainTables):
    """Positions of another number, and such that are no numbers, are refused with the names of the joints."""
    torso = tables.chain("torso")
    for positions, message in (
        ([0, 0], r"torso 1.0 has 3 joints \(torso_pitch, torso_roll, torso_yaw\), not 2"),
        ([0, math.nan, 0], "torso 1.0: no position is given for torso_roll"),
        ([[0, 0, 0], [0, 0, math.inf]], "torso 1.0: no position is given for torso_yaw"),
        (1.0, "not one"),
    ):
        with pytest.raises(RefusedError, match=message):
            torso.pose(positions)
    with pytest.raises(RefusedError, match="not 2x3"):
        torso.jacobian(np.zeros((2, 3)))
    with pytest.raises(RefusedError, match=r"torso 1\.0 has links 0 to 2, not 3"):
        torso.jacobian([0, 0, 0], 3)
    with pytest.raises(RefusedError, match=r"no joint 'torso_pich'; its joints .* did you mean torso_pitch"):
        torso.blocked({"torso_pich": 0.0})
    with pytest.raises(RefusedError, match="torso_pitch cannot be held at nan"):
        torso.blocked({"torso_pitch": math.nan})
    with pytest.raises(RefusedError, match="a pose is a matrix of 4 by 4"):
        torso.with_tip(np.eye(3))


def test_wrong_links_of_a_description(icub: RobotModel):
    """Links that are not there, and links that do not carry each other, are refused."""
    with pytest.raises(RefusedError, match="there is no link 'l_hnad'; did you mean l_hand"):
        described_chain(icub, "l_hnad")
    with pytest.raises(RefusedError, match="l_foot does not carry l_hand"):
        described_chain(icub, "l_hand", "l_foot")
    assert described_chain(icub, "l_hand", "chest").joints[0] == "l_shoulder_pitch"


@settings(max_examples=25)
@given(arrays(np.float64, 3, elements=st.floats(-1, 1)), st.floats(-10.0, 10.0))
def test_an_axis_has_any_length(axis, angle):
    """A rotation is one whatever the length of its axis; an axis of no length with an angle is refused."""
    if not np.linalg.norm(axis):
        with pytest.raises(RefusedError, match="has an axis, not"):
            rotation_of(axis, angle or 1.0)
        return
    rotation = rotation_of(axis, angle)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation @ axis, axis, atol=1e-12)
