"""Measured torques in torque tests: noise, values that are not finite, and dead sensors."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.robot_testing.motion.routines import run_to_end
from rtf.robot_testing.torque_control import holding_torques
from rtf.testing.verdict import Inconclusive, SkipTest, TestFailure, TestProblem

from .kept_test import kept_test
from .part_bench import PartBench

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.extended_state import ExtendedState

#: What gravity asks of a joint in some postures, Nm.
MODEL = np.linspace(-1.0, 2.0, 20)


@pytest.fixture
def bench() -> Iterator[PartBench]:
    """The bench; its sensors have a noise of 0.15 Nm about the values of its joints."""
    with ExitStack() as stack:
        bench = PartBench(stack)
        show, chance = bench.device.fill_state, np.random.default_rng(1)

        def fill_state(state: ExtendedState) -> float:
            time = show(state)
            state.torques[:] = np.arange(3) + chance.normal(0.0, 0.15, 3)
            return time

        bench.device.fill_state = fill_state  # type: ignore[method-assign]
        yield bench


def test_torques_are_averaged(bench):
    """A single state is beyond the limit of 0.3 Nm once in twenty times, and the mean never is."""
    test = kept_test("TorqueControlConsistency", robot_part=bench.part)
    commanded = np.array([0.0, np.nan, 2.0])
    found = [test._measure(bench.part, [2, 0], commanded, bench.board.encoders())[0] for _ in range(60)]
    assert np.std(found, axis=0) == pytest.approx(0.15 / np.sqrt(5), rel=0.3)
    assert np.abs(np.array(found) - [0, 1, 2]).max() < 0.3


def test_a_joint_that_moves_far_is_held_at_once(bench):
    """Its torque is not measured any longer."""
    test = kept_test("TorqueControlConsistency", robot_part=bench.part)
    before, begin = bench.board.encoders(), bench.time.now()
    bench.device.shown[2] = before[2] + 15.0
    bench.publish()
    _, ways = test._measure(bench.part, [0, 2], np.array([0.0, np.nan, 5.0]), before)
    assert ways == pytest.approx([0.0, 0.0, 15.0])
    assert bench.time.now() == begin


def test_a_loop_has_time_to_settle(bench):
    """The torque is that of the last states, not that of the first; one that stays wrong is measured as it is."""
    test = kept_test("TorqueControlConsistency", robot_part=bench.part)
    show, begin = bench.device.fill_state, bench.time.now()

    def fill_state(state: ExtendedState) -> float:
        time = show(state)
        state.torques[2] += 5.0 * (bench.time.now() - begin < 0.1)
        return time

    bench.device.fill_state = fill_state  # type: ignore[method-assign]
    found, _ = test._measure(bench.part, [2], np.array([np.nan, np.nan, 2.0]), bench.board.encoders())
    assert found[2] == pytest.approx(2.0, abs=0.3)
    assert 0.1 < bench.time.now() - begin < 0.2
    wrong, _ = test._measure(bench.part, [2], np.array([np.nan, np.nan, 3.0]), bench.board.encoders())
    assert wrong[2] == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("joint", [0, 1])
def test_a_torque_that_is_not_finite_holds_no_joint(bench, joint):
    """Neither the tested joint, nor one that shares its motors and would get its own torque."""
    test = kept_test("TorqueControlAccuracy", simulated=True)
    run_to_end(bench.part, holding_torques(test, bench.part, [0], 0.2), pace=0.02)
    show = bench.device.fill_state

    def fill_state(state: ExtendedState) -> float:
        time = show(state)
        state.torques[joint] = np.nan
        return time

    bench.device.fill_state = fill_state  # type: ignore[method-assign]
    with pytest.raises(TestProblem, match=f"the measured torque is not finite: {bench.part.names[joint]}; likely: "):
        run_to_end(bench.part, holding_torques(test, bench.part, [0], 0.2), pace=0.02)


def weighed(measured, model=MODEL, hidden=0.0):
    """Return the results of the gravity test for a joint."""
    test = kept_test("TorqueControlGravityConsistency")
    test.resolve_parameters(param="--part left_arm")
    test._judge("elbow", np.asarray(measured), model, hidden)
    return test.kept


@pytest.mark.parametrize("model", [MODEL, 0.05 * MODEL])
@pytest.mark.parametrize("value", [0.0, 0.4])
def test_a_constant_torque_is_no_measurement(value, model):
    """However little gravity varies; the mean may be rounded."""
    measured = np.full(model.size, value)
    measured[3] = np.nextafter(value, 1.0)
    with pytest.raises(TestFailure, match=f"elbow measures {value:g} Nm in all postures; likely: no torque estimates"):
        weighed(measured, model)


@pytest.mark.parametrize("factor", [-1.0, 0.5, 1.5, 2.0])
def test_a_wrong_gain_never_passes(factor):
    """With any noise it fails or is inconclusive."""
    for deviation in (0.0, 0.05, 0.1, 0.2, 0.4):
        noise = np.random.default_rng(3).normal(0.0, deviation, MODEL.size)
        kept = weighed(factor * (MODEL + noise))
        assert any("gain" in one for one in kept.failures) or isinstance(kept.ended.get("gain"), Inconclusive)
        assert deviation > 0.1 or kept.failures


def test_an_uncertain_gain_is_inconclusive():
    """The other characteristics of the joint are judged."""
    kept = weighed(MODEL + np.random.default_rng(3).normal(0.0, 0.5, MODEL.size))
    assert "the torques scatter too much: the interval of the gain is " in str(kept.ended["gain"])
    assert isinstance(kept.ended["gain"], Inconclusive)
    assert {"gain", "offset", "greatest error"} <= kept.values.keys()
    assert not weighed(MODEL + np.random.default_rng(3).normal(0.0, 0.05, MODEL.size)).ended


def test_with_little_gravity_only_the_offset_is_judged():
    """It is reported that the gain is not judged."""
    model = 0.05 * MODEL
    kept = weighed(model + np.random.default_rng(3).normal(0.0, 0.05, MODEL.size), model)
    assert isinstance(kept.ended["gain"], SkipTest)
    assert "too little to determine a gain" in str(kept.ended["gain"])
    assert "gain" not in kept.values
    assert {"offset", "greatest error"} <= kept.values.keys()
    assert not kept.failures
    assert any("offset" in one for one in weighed(model + 1.2 + 0.01 * MODEL, model).failures)


@pytest.mark.parametrize(("model", "hidden"), [(0.3 * MODEL, 0.0), (MODEL, 2.5)])
def test_a_wrong_sign_is_found_with_little_gravity(model, hidden):
    """If friction cannot explain it; other gains are not judged then."""
    noise = np.random.default_rng(3).normal(0.0, 0.05, MODEL.size)
    inverted = weighed(-model + noise, model, hidden)
    assert any("gain" in one for one in inverted.failures)
    for factor in (0.5, 1.0, 1.5):
        kept = weighed(factor * model + noise, model, hidden)
        assert "more than a wrong sign of the gain" in str(kept.ended["gain"])
        assert not kept.failures
    assert "gain" not in weighed(-0.1 * model + noise, 0.1 * model, hidden).values


def test_parameter_files_of_the_original_are_read():
    """Parameters for its own model server are not needed."""
    test = kept_test("TorqueControlGravityConsistency")
    test.resolve_parameters(param="--wbi_conf_file yarpWholeBodyInterface.ini --local gravity --part left_leg")
    assert test.part == "left_leg"
