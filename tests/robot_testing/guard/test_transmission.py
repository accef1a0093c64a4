"""The transmission of a part, from the answers of its board."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rtf.bottle import Bottle
from rtf.robot.errors import RefusedError
from rtf.robot_testing.guard.transmission import Transmission, block_diagonal

TORSO = Bottle([Bottle([1.0, 0, 0, 0, 0.5, -0.5, 0, 0.5, 0.5])])
NUMBERS = st.floats(-10, 10)


def test_coupling_blocks_are_placed_by_the_numbers_of_their_joints():
    """Joints after the last block are not coupled."""
    reported = Bottle([Bottle([2.0]), Bottle([1.0, 3.0, -1.0, 1.0])])
    matrix, members = block_diagonal(reported, 4)
    expected = [[2, 0, 0, 0], [0, 1, 3, 0], [0, -1, 1, 0], [0, 0, 0, 1]]
    assert np.array_equal(matrix, expected)
    assert members == ((0,), (1, 2), (1, 2), (3,))


@given(st.lists(st.integers(1, 4), max_size=4), st.integers(0, 3), st.data())
def test_all_blocks_are_kept(sizes, more, data):
    """No block is dropped, whatever its size."""
    blocks = [data.draw(arrays(np.float64, (size, size), elements=NUMBERS)) for size in sizes]
    matrix, members = block_diagonal(Bottle([Bottle(block.ravel().tolist()) for block in blocks]), sum(sizes) + more)
    first = 0
    for block in blocks:
        span = slice(first, first + len(block))
        assert np.array_equal(matrix[span, span], block)
        first += len(block)
    assert len(members) == len(matrix) == sum(sizes) + more


@pytest.mark.parametrize("reported", [Bottle([Bottle([1.0, 2.0])]), TORSO, Bottle([Bottle([])]), Bottle([3])])
def test_an_invalid_coupling_matrix_is_refused(reported):
    """Not square, too large for the part, empty, or no list."""
    with pytest.raises(RefusedError, match="block 0 of kinematic_mj"):
        block_diagonal(reported, 2)


def test_the_disagreement_of_the_encoders_is_in_joint_degrees():
    """With the signs of the gears, for one state and for many."""
    gears = Transmission(np.array([-100.0, -100, -100]), *block_diagonal(TORSO, 3))
    joints = np.array([[1.0, 10, 4], [0, 0, 0]])
    assert gears.rotors(joints).tolist() == [[-100, -300, -700], [0, 0, 0]]
    assert gears.factors.tolist() == [-100, -50, -50]
    elsewhere = gears.rotors(joints) + np.array([[0, 25.0, 0], [0, 0, 0]])
    assert gears.disagreement(joints, elsewhere).tolist() == [[0, -0.5, 0], [0, 0, 0]]


def test_the_holding_duty_of_one_motor_carries_the_whole_joint():
    """Two motors hold a roll by 10 % each; one alone needs both shares."""
    gears = Transmission(np.array([-100.0, -100, -100]), *block_diagonal(TORSO, 3))
    assert gears.holding_duty([0.0, 10.0, 10.0], 1) == pytest.approx(20.0)
    assert gears.holding_duty([7.0, 10.0, 10.0], 0) == pytest.approx(7.0)
    assert gears.holding_duty([0.0, -10.0, 10.0], 2) == pytest.approx(20.0)


def test_joints_of_a_differential_share_their_motors():
    """A joint beside them does not; a joint without a coupling shares with none."""
    matrix, members = block_diagonal(TORSO, 3)
    torso = Transmission(np.ones(3), matrix, members)
    assert [torso.sharing(joint) for joint in range(3)] == [{0}, {1, 2}, {1, 2}]


def test_joints_are_coupled_through_others():
    """A chain of two differentials changes its modes together, though its ends share no motor."""
    chain = Transmission(np.ones(4), np.array([[1.0, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, 0, 1]]), ((),) * 4)
    assert chain.sharing(0) == {0, 1}
    assert [chain.coupled(joint) for joint in range(4)] == [[0, 1, 2]] * 3 + [[3]]


def test_a_joint_without_a_number_says_nothing_of_the_motors_that_turn_it():
    """And leaves the others alone: in one state, and in a series."""
    matrix, blocks = block_diagonal(TORSO, 3)
    transmission = Transmission(np.array([100.0, -100.0, 50.0]), matrix, blocks)
    known = transmission.rotors([10.0, 0.0, 4.0])
    found = transmission.rotors([[10.0, 0.0, 4.0], [10.0, np.nan, 4.0]])
    assert np.array_equal(found, [known, [known[0], np.nan, np.nan]], equal_nan=True)


def test_what_motors_carry_of_a_joint():
    """Two motors of a differential work against each other for one joint; another joint carries itself."""
    half = 0.5
    differential = np.array([[half, -half, 0.0], [half, half, 0.0], [0.0, 0.0, 1.0]])
    one = Transmission(np.ones(3), differential, ((0, 1), (2,)))
    torques = np.array([6.0, 2.0, 3.0])
    for joint, carried in ((0, 6.0), (1, 6.0), (2, 3.0)):
        shares = one.by_motors(torques, joint)
        assert shares.sum() == pytest.approx(torques[joint])
        assert np.abs(shares).sum() == pytest.approx(carried)
    torques[0] = np.nan
    assert one.by_motors(torques, 1).tolist() == [0.0, 2.0, 0.0]
