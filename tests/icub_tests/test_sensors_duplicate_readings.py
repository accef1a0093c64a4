"""SensorsDuplicateReadings on the simulated robot."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rtf.testing.events import SeriesRecorded
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.plugins import find, load_module
from rtf.testing.verdict import Verdict


def case(name, *rows):
    """One test of a suite."""
    parameters = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in rows)
    return f'<test name="{name}"><parameter name="time">1</parameter>{parameters} SensorsDuplicateReadings </test>'


SUITE = "".join(
    [
        case("healthy"),
        case("twice", ("inject", "duplicate /icubSim/left_arm/analog:o")),
        case("frozen", ("inject", "ft_frozen right_leg")),
        case("unit", ("inject", "imu_frozen imu"), ("port", "/icubSim/inertial")),
        case("lost", ("inject", "loss /icubSim/left_arm/analog:o")),
        case("tolerated", ("inject", "duplicate /icubSim/inertial"), ("PORTS", "((/icubSim/inertial 1000))")),
        case("wrong", ("PORTS", "((/icubSim/inertial))")),
    ]
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    return run_on_robot(SUITE, parts="head")


def test_a_healthy_robot_passes(outcome, measured):
    """Nothing is repeated on a robot whose sensors have noise."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    assert len(measured(outcome, "healthy", "values that came twice")) == 11
    assert all(event.value == 0 for event in measured(outcome, "healthy", "values that came twice"))


@pytest.mark.parametrize(
    ("name", "what", "port"),
    [
        ("twice", "messages that came twice", "/icubSim/left_arm/analog:o"),
        ("frozen", "values that came twice", "/icubSim/right_leg/analog:o"),
        ("unit", "values that came twice", "/icubSim/inertial"),
    ],
)
def test_what_comes_again_is_found(outcome, measured, name, what, port):
    """Repeated messages, and frozen sensors, fail at their port."""
    assert outcome.verdict(name) is Verdict.FAILED
    (found,) = measured(outcome, name, what, port)
    assert found.value > 10


@pytest.mark.parametrize(
    "what", ["share of repeated values", "longest run of one value", "longest time without a new value"]
)
def test_each_measure_of_repeated_values_has_its_limit(outcome, measured, what):
    """The tolerance is the limit of each measurement: a healthy robot has a margin, a frozen sensor has none."""
    assert all(event.margin >= 0 for event in measured(outcome, "healthy", what))
    (found,) = measured(outcome, "unit", what)
    assert found.verdict is MeasurementVerdict.FAILED
    (tolerated,) = measured(outcome, "tolerated", what)
    assert tolerated.verdict is MeasurementVerdict.PASSED


def test_the_ages_of_values_are_kept(outcome):
    """They are recorded: a repeated value grows older."""
    oldest = {
        one.test.rpartition("/")[2]: np.load(outcome.folder / one.path)["age"].max()
        for one in outcome.of(SeriesRecorded, name="age of the values", subject="/icubSim/inertial")
    }
    assert oldest["healthy"] == 0.0
    assert oldest["unit"] == pytest.approx(990.0, abs=11.0)


def test_sensors_that_never_change_are_named(outcome):
    """The channels of a frozen sensor are listed."""
    assert "never changed" in "".join(str(event) for event in outcome.events if "frozen" in str(event))


def test_lost_messages_are_no_duplicates(outcome):
    """Lost messages do not fail this test."""
    assert outcome.verdict("lost") is Verdict.PASSED


def test_as_many_as_the_file_says_are_tolerated(outcome, measured):
    """The number behind a port is the number of tolerated duplicates, and is required."""
    assert outcome.verdict("tolerated") is Verdict.PASSED
    assert measured(outcome, "tolerated", "messages that came twice")[0].value > 5
    assert outcome.verdict("wrong") is Verdict.ERROR


CHANCE = load_module(find("test", "SensorsDuplicateReadings"))._by_chance


@given(st.integers(0, 2**32 - 1), st.floats(0.2, 4.0))
@example(32002, 0.3125)
def test_values_of_a_coarse_sensor_are_equal_by_chance(seed, counts):
    """Six channels with a noise of some counts: no more of their values are equal than chance explains."""
    values = np.rint(np.random.default_rng(seed).normal(0.0, counts, (200, 6)))
    same = np.diff(values, axis=0) == 0.0
    assert int(same.all(axis=1).sum()) <= CHANCE(same)


@given(st.integers(0, 2**32 - 1))
def test_lost_readings_are_more_than_chance(seed):
    """One in ten values is repeated, by a sensor with a noise of a count: about as many as that are found."""
    random = np.random.default_rng(seed)
    values = np.rint(random.normal(0.0, 1.0, (200, 6)))
    values[10::10] = values[9:-1:10]
    same = np.diff(values, axis=0) == 0.0
    assert CHANCE(same) < 10 <= int(same.all(axis=1).sum())


def test_what_is_never_equal_by_chance_may_not_be_equal():
    """Of a single channel, or of channels with a fine resolution, no value may be repeated."""
    fine = np.random.default_rng(1).normal(size=(200, 6)).repeat(2, axis=0)
    for values in (fine, np.rint(fine[:, :1])):
        assert CHANCE(np.diff(values, axis=0) == 0.0) == 0
