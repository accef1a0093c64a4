"""Where two eyes look: values of the original gaze controller, and what belongs to each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import ChainTables, Eyes, robot_chains
from rtf.robot.model import load_robot

EYES = Eyes(*(robot_chains(load_robot("icub")).chain(name, "2.5") for name in ("left_eye", "right_eye", "head")))
#: Positions of torso, neck, tilt, version, vergence (deg), with a point in front of the robot.
POSITIONS = st.tuples(
    *(st.floats(-limit, limit) for limit in (20, 20, 20, 30, 20, 40, 25, 25)), st.floats(3.0, 40.0)
).map(np.array)


def at(vergence: float, **positions: object) -> list[float]:
    """Positions that are 0 but for these; torso and neck are three each."""
    torso, neck = positions.get("torso", (0, 0, 0)), positions.get("neck", (0, 0, 0))
    return [*torso, *neck, positions.get("tilt", 0), positions.get("version", 0), vergence]


@pytest.mark.parametrize(
    ("positions", "point"),
    [
        (at(0.5), (-7.848577, 0, 0.34685)),
        (at(5), (-0.835128, 0, 0.34685)),
        (at(20), (-0.249224, 0, 0.34685)),
        (at(10, neck=(10, 0, 0)), (-0.422447, 0, 0.421781)),
        (at(10, neck=(0, 0, 20)), (-0.418515, -0.150325, 0.34685)),
        (at(10, tilt=10), (-0.439118, 0, 0.414333)),
        (at(10, version=10), (-0.433214, 0.066967, 0.34685)),
        (at(12, torso=(10, -5, 20), neck=(15, -10, -40), tilt=-15, version=-5), (-0.24886, 0.316958, 0.310133)),
    ],
)
def test_fixation_points_of_the_original(positions, point):
    """Answers of the original program, to the digits that it prints."""
    assert EYES.fixation_point(positions) == pytest.approx(point, abs=6e-7)


def test_angles_of_the_original():
    """Both ways; the smallest vergence is the first that has a point in front."""
    assert EYES.smallest == 0.5
    assert EYES.half_baseline == pytest.approx(0.034)
    assert EYES.angles_of((-0.5, 0.1, 0.4)) == pytest.approx((12.703739, 6.832332, 8.494412), abs=6e-7)
    assert EYES.point_of((10, 20, 5)) == pytest.approx((-0.777048, 0.127070, 0.613191), abs=6e-7)
    assert EYES.angles_of(EYES.fixation_point(at(10, tilt=10))) == pytest.approx((0, 10, 10))
    assert EYES.angles_of(EYES.fixation_point(at(10, version=10)))[0] == pytest.approx(10.0773, abs=6e-5)


@given(st.floats(-80, 80), st.floats(-60, 60), st.floats(1.0, 40.0))
def test_a_point_is_seen_at_its_angles(azimuth: float, elevation: float, vergence: float):
    """In all directions in front; the elevation is that of its shadow, and the distance is that of the vergence."""
    point = EYES.point_of((azimuth, elevation, vergence))
    shadow = np.degrees(np.arctan(np.tan(np.radians(elevation)) / np.cos(np.radians(azimuth))))
    assert EYES.angles_of(point)[:2] == pytest.approx((azimuth, shadow), abs=1e-6)
    away = np.linalg.norm(point - EYES.centre[:3, 3])
    assert np.hypot(away, EYES.half_baseline) == pytest.approx(EYES.distance(vergence))


@given(POSITIONS)
def test_relative_angles_begin_where_the_eyes_look(positions):
    """No angles are the middle of the present head, at the present distance."""
    looked = EYES.point_of((0, 0, 0), [*positions[:6], 0, 0, positions[8]])
    assert looked == pytest.approx(EYES.fixation_point([*positions[:6], 0, 0, positions[8]]))
    nearer = EYES.point_of((0, 0, 5), at(10, neck=(10, 5, 20)))
    assert nearer == pytest.approx(EYES.fixation_point(at(15, neck=(10, 5, 20))))


@given(POSITIONS)
def test_the_jacobian_is_how_the_point_moves(positions):
    """Compared with differences, for all joints."""
    steps = np.eye(len(EYES)) * 1e-4
    ways = [EYES.fixation_point(positions + step) - EYES.fixation_point(positions - step) for step in steps]
    expected = np.array(ways).T / np.radians(2e-4)
    found = EYES.fixation_jacobian(positions)
    assert found == pytest.approx(expected, abs=1e-5 * (1.0 + np.abs(expected).max()))


@given(POSITIONS)
def test_both_eyes_see_the_point_on_their_axes(positions):
    """As tilt, version and vergence leave the axes in one plane."""
    point = EYES.fixation_point(positions)
    for pose in EYES.poses(positions):
        x, y, z = pose[:3, :3].T @ (point - pose[:3, 3])
        assert (x, y) == pytest.approx((0, 0), abs=1e-9 * (1 + abs(z)))


def test_what_is_refused(tables: ChainTables):
    """Parallel eyes, wrong numbers of positions, and chains that are no eyes: the message says what and why."""
    with pytest.raises(RefusedError, match="the axes of the eyes are parallel"):
        EYES.fixation_point(at(0))
    with pytest.raises(RefusedError, match="the axes of the eyes are parallel"):
        EYES.fixation_jacobian(at(0))
    with pytest.raises(RefusedError, match=r"head and eyes have 9 positions \(torso_pitch, .*, tilt, version, verg"):
        EYES.poses([0.0] * 8)
    with pytest.raises(RefusedError, match="head and eyes have 9 positions"):
        EYES.fixation_point([float("nan"), *at(5)[1:]])
    head = tables.chain("head", "2.5")
    with pytest.raises(RefusedError, match="eyes have two joints more than the head"):
        Eyes(head, head, head)
    left, right = tables.chain("left_eye", "2.5"), tables.chain("right_eye", "2.5")
    with pytest.raises(RefusedError, match="with no vergence they look at a point in front"):
        Eyes(right, left, head)  # exchanged: their axes cross behind the head
