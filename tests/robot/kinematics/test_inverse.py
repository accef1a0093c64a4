"""Inverse kinematics: what is within reach is met, limits and constraints hold, and the rest is reported."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import (
    Chain,
    ChainTables,
    InverseKinematics,
    LinearConstraint,
    PointPreference,
    Solution,
    inverse,
    pose_error,
    vector_of,
)
from rtf.robot.kinematics.inverse import ORIENTATION_TOLERANCE, POSITION_TOLERANCE
from rtf.robot.model import RobotModel
from rtf.robot.model.errors import MissingPackageError

START = [0, 0, 0, -30, 30, 0, 45, 0, 0, 0]


@pytest.fixture(scope="session")
def arm(icub: RobotModel, tables: ChainTables) -> Chain:
    """Torso and left arm, with the limits of the robot."""
    return tables.chain("left_arm", "2.5").limited_by(icub.axes)


@pytest.fixture(scope="session")
def arm_inverse(arm: Chain) -> InverseKinematics:
    """Its inverse."""
    return InverseKinematics(arm)


def within(chain: Chain, posture: np.ndarray) -> np.ndarray:
    """The nearest posture within limits and constraints."""
    program = InverseKinematics(chain)
    problem = program._problem(posture, None, None, None)
    return program._allowed(problem, posture * chain.internal) / chain.internal


@st.composite
def postures(draw: st.DrawFn, chain: Chain) -> np.ndarray:
    """Postures within limits and constraints, among them those at the limits of all joints."""
    shares = np.array([draw(st.floats(0.0, 1.0)) for _ in chain.joints])
    return within(chain, chain.minima + shares * (chain.maxima - chain.minima))


def check_truth(chain: Chain, solution: Solution) -> None:
    """A solution is within limits and constraints, and its pose is that of its positions."""
    assert chain.violations(solution.positions, 1e-4) == []
    np.testing.assert_array_equal(chain.pose(solution.positions), solution.pose)
    within_tolerances = (
        solution.position_error <= POSITION_TOLERANCE and solution.orientation_error <= ORIENTATION_TOLERANCE
    )
    assert solution.reached == within_tolerances == (solution.problem == "")


def check(chain: Chain, solution: Solution) -> None:
    """A solution that is reached is: by its own positions, within limits and constraints."""
    check_truth(chain, solution)
    assert solution.reached, solution


@settings(max_examples=25)
@given(st.data())
def test_a_solution_is_what_it_says(arm: Chain, arm_inverse: InverseKinematics, data):
    """For the pose of any posture, whether it is met or not: steps from its own posture meet it."""
    posture = data.draw(postures(arm))
    pose = arm.pose(posture)
    solution = arm_inverse.solve(vector_of(pose), START, rest=START, weights=[1, 1, 1, 0, 0, 0, 0, 0, 0, 0])
    check_truth(arm, solution)
    moved = pose_error(pose, solution.pose)
    assert solution.position_error == pytest.approx(np.linalg.norm(moved[:3]), abs=1e-9)
    assert solution.orientation_error == pytest.approx(math.degrees(np.linalg.norm(moved[3:])), abs=1e-6)
    check(arm, arm_inverse.solve(vector_of(pose), posture, rest=posture, attempts=1))


@pytest.mark.parametrize("name", ["left_arm", "right_leg", "right_eye"])
def test_postures_at_limits(icub: RobotModel, tables: ChainTables, name: str):
    """Of poses whose postures have two thirds of their joints at limits, where steps stick, 98 % are met and more."""
    chain = tables.chain(name, "2.5").limited_by(icub.axes)
    program, generator = InverseKinematics(chain), np.random.default_rng(5)
    middle = (chain.minima + chain.maxima) / 2
    missed = 0
    for _ in range(300):
        where = generator.integers(0, 3, len(chain))
        free = generator.uniform(chain.minima, chain.maxima)
        posture = within(chain, np.choose(where, [chain.minima, chain.maxima, free]))
        solution = program.solve(chain.pose(posture), middle)
        check_truth(chain, solution)
        missed += not solution.reached
    assert missed <= 6


@pytest.mark.parametrize("name", ["right_arm", "left_leg", "right_eye"])
def test_other_chains(icub: RobotModel, tables: ChainTables, name: str):
    """Of random poses of other chains, all are met from the middle of the limits."""
    chain = tables.chain(name, "2.5").limited_by(icub.axes)
    program, generator = InverseKinematics(chain), np.random.default_rng(4)
    found = 0
    while found < 15:
        posture = generator.uniform(chain.minima, chain.maxima)
        if not chain.violations(posture):
            check(chain, program.solve(chain.pose(posture), (chain.minima + chain.maxima) / 2))
            found += 1


def test_positions_alone(arm: Chain, arm_inverse: InverseKinematics):
    """A target of three numbers leaves the orientation free."""
    place = arm.pose([10, 5, -20, -60, 50, 30, 70, 20, 0, 0])[:3, 3]
    solution = arm_inverse.solve(place, START)
    assert solution.reached
    assert solution.orientation_error == 0.0
    np.testing.assert_allclose(solution.pose[:3, 3], place, atol=POSITION_TOLERANCE)


def test_same_question_same_answer(arm: Chain):
    """Two solvers have the same bits, whatever was solved before."""
    one, other = InverseKinematics(arm), InverseKinematics(arm)
    targets = [arm.pose([10, 5, -20, -60, 50, 30, 70, 20, 0, 0]), np.array([-0.9, 0.0, 0.2])]
    for target in targets:
        one.solve(target, START)
    for target in reversed(targets):
        assert one.solve(target, START).positions.tobytes() == other.solve(target, START).positions.tobytes()


def test_the_rest_posture_decides(arm: Chain, arm_inverse: InverseKinematics):
    """Among the postures of a pose, weights choose: a torso at rest, or one drawn to another place."""
    pose = arm.pose([15, 0, 10, -50, 45, 20, 60, 0, 0, 0])
    still, drawn = (
        arm_inverse.solve(pose, START, rest=[pitch, *START[1:]], weights=[1, 1, 1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
        for pitch in (0, 20)
    )
    check(arm, still)
    check(arm, drawn)
    assert abs(still.positions[0]) < 10 < drawn.positions[0]


def test_a_link_is_drawn_to_a_place(arm: Chain, arm_inverse: InverseKinematics):
    """Among the postures of a pose, an elbow may be low or high, within the limits."""
    pose, elbow = arm.pose([5, 0, 10, -50, 45, 20, 60, 0, 0, 0]), arm.index("l_shoulder_yaw")
    heights = []
    for height in (-3.0, 3.0):
        drawn = PointPreference(elbow, (0.0, 0.0, height), (0.0, 0.0, 10.0))
        solution = arm_inverse.solve(pose, START, drawn=drawn)
        check(arm, solution)
        heights.append(arm.frames(solution.positions)[elbow][2, 3])
    assert heights[0] < heights[1] - 0.03


def test_joints_that_are_not_active_stay(arm: Chain, arm_inverse: InverseKinematics):
    """They stay at the start to the last bit, and their constraints do not count."""
    active = [False] * 3 + [True] * 7
    target = arm.pose([0, 0, 0, -50, 45, 20, 60, 10, -5, 5])
    solution = arm_inverse.solve(target, START, active=active)
    check(arm, solution)
    assert solution.positions[:3].tolist() == [0.0, 0.0, 0.0]
    low = arm_inverse.solve([-0.2, -0.2, 0.0], [0, 0, 0, -30, 0, 0, 45, 0, 0, 0], active=[False] * 6 + [True] * 4)
    assert low.positions[4] == 0.0  # where l_body does not allow it with a shoulder that is free


def test_constraints_hold_from_a_start_that_breaks_them(arm: Chain, arm_inverse: InverseKinematics):
    """A start beyond constraints and limits is left at once, for a target beyond, too."""
    outside = [0, 0, 0, 20, 0, -40, 0, 0, 0, 0]
    assert arm.violations(outside)
    check(arm, arm_inverse.solve(arm.pose([0, 0, 0, -50, 45, 20, 60, 10, -5, 5]), outside))
    far = arm_inverse.solve([0.0, 0.5, -1.0], outside, attempts=1)
    assert arm.violations(far.positions, 1e-4) == []


def test_out_of_reach(arm: Chain, arm_inverse: InverseKinematics):
    """A target out of reach has the nearest position, on the line to it, and the solution says how far that is."""
    straight = arm_inverse.solve([-2.0, -0.1, 0.1], START)
    assert not straight.reached
    assert 1.0 < straight.position_error < 1.7
    assert straight.problem == f"the nearest pose is {straight.position_error * 1e3:.3g} mm from the target"
    further = arm_inverse.solve(np.array([-2.0, -0.1, 0.1]), straight.positions)
    assert further.position_error == pytest.approx(straight.position_error, abs=1e-4)
    generator = np.random.default_rng(5)
    others = arm.pose(
        [posture for posture in generator.uniform(arm.minima, arm.maxima, (2000, 10)) if not arm.violations(posture)]
    )
    assert np.linalg.norm(others[:, :3, 3] - [-2.0, -0.1, 0.1], axis=1).min() > straight.position_error


def test_priorities(arm: Chain, arm_inverse: InverseKinematics):
    """Of a pose out of reach, position or orientation is rather met, as asked."""
    target = arm.pose([0, 0, 0, -50, 45, 20, 60, 10, -5, 5])
    target[:3, 3] += (-0.35, -0.1, 0.2)
    place, turn = (arm_inverse.solve(target, START, priority=one) for one in ("position", "orientation"))
    assert place.position_error < turn.position_error
    assert turn.orientation_error < place.orientation_error
    assert " mm and " in place.problem


def test_slides(tables: ChainTables):
    """A chain with a slide is solved in metres."""
    leg = tables.chain("left_leg")
    links = list(leg.links)
    links[2] = type(links[2])("slide", -0.1, 0.2, links[2].frame, prismatic=True)
    chain = Chain("sliding leg", tuple(links), leg.base)
    solution = InverseKinematics(chain).solve(chain.pose([20, -20, 0.15, -40, 10, 5]), [0, 0, 0, -20, 0, 0])
    check(chain, solution)
    assert -0.1 <= solution.positions[2] <= 0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": [0.1, math.nan, 0.0]}, "a position is three numbers"),
        ({"target": [0.1, 0.2]}, "a pose is x, y, z"),
        ({"target": [0, 0, 0, 0, 0, 0, 1.0]}, "has an axis"),
        ({"target": np.zeros((4, 4))}, "a rotation and a translation"),
        ({"start": START[:9]}, "has 10 joints .*, not 9"),
        ({"start": [math.inf, *START[1:]]}, "no position is given for torso_pitch"),
        ({"rest": START[:3], "weights": [1] * 10}, "not 3"),
        ({"weights": [1.0, 1.0]}, "not 2"),
        ({"weights": [-1.0] * 10}, "weights of the rest posture are not negative"),
        ({"active": [True] * 3}, "has 10 joints, so active has as many values, not 3"),
        ({"active": [False] * 10}, "no joint is active"),
        ({"drawn": PointPreference(10, (0.0, 0.0, -1.0))}, "has links 0 to 9, not 10"),
        ({"drawn": PointPreference(5, (0.0, 0.0, math.nan))}, "a place and its weights are finite numbers"),
        ({"attempts": 0}, "the number of attempts is at least 1, not 0"),
        ({"priority": "speed"}, "the priority is position or orientation, not 'speed'"),
    ],
)
def test_bad_input(arm_inverse: InverseKinematics, changes, message: str):
    """Wrong lists and numbers are refused, with what is right."""
    with pytest.raises(RefusedError, match=message):
        arm_inverse.solve(**{"target": [-0.3, -0.1, 0.1], "start": START, **changes})


def test_limits_without_a_posture(arm: Chain):
    """Constraints that no posture keeps are reported."""
    never = LinearConstraint("never", {"torso_pitch": 1.0}, 100.0, 200.0)
    program = InverseKinematics(Chain("arm", arm.links, arm.base, constraints=(never,)))
    with pytest.raises(RefusedError, match="arm: no posture is within its limits and its constraints"):
        program.solve([-0.3, -0.1, 0.1], START)


def test_the_package_is_named(arm: Chain, monkeypatch: pytest.MonkeyPatch):
    """Without the package, the error says how to install it."""
    inverse._package.cache_clear()
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'rtf\[kinematics\]'"):
        InverseKinematics(arm)
    inverse._package.cache_clear()
