"""Trends of the history: found where there are some, not found in noise, in the shape that the page reads."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recorded import BEGAN, put, stored
from rtf.testing.history import History, trends
from rtf.testing.measurement import Measurement, Unit
from rtf.testing.verdict import Verdict

NUMBER = {"type": "number"}
RATE = {"type": "array", "items": {"type": "number", "minimum": 0, "maximum": 1}, "minItems": 3, "maxItems": 3}
LIMIT = {"type": ["number", "null"]}
SHAPE = {
    "type": "object",
    "required": ["runs", "measurements", "tests"],
    "additionalProperties": False,
    "properties": {
        "runs": {
            "type": "array",
            "items": {"type": "object", "required": ["run", "started", "verdict", "robot", "station", "version"]},
        },
        "measurements": {
            "type": "object",
            "propertyNames": {"pattern": "^[^\n]*\n[^\n]*\n"},
            "additionalProperties": {
                "type": "object",
                "required": ["unit", "points", "drift", "pass_rate"],
                "additionalProperties": False,
                "properties": {
                    "unit": {"type": "string"},
                    "points": {
                        "type": "array",
                        "minItems": 1,
                        "items": {
                            "type": "array",
                            "prefixItems": [{"type": "integer"}, LIMIT, LIMIT, LIMIT, {"type": "string"}],
                            "minItems": 5,
                            "maxItems": 5,
                        },
                    },
                    "pass_rate": RATE,
                    "drift": {
                        "type": ["object", "null"],
                        "required": ["slope", "unit", "p", "believed", "limit", "after"],
                        "properties": {
                            "slope": NUMBER,
                            "p": {"type": "number", "minimum": 0, "maximum": 1},
                            "believed": {"type": "boolean"},
                            "limit": LIMIT,
                            "after": {"type": ["integer", "null"], "minimum": 0},
                        },
                    },
                },
            },
        },
        "tests": {
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "required": ["verdicts", "pass_rate", "flaky"],
                "additionalProperties": False,
                "properties": {
                    "verdicts": {"type": "array", "items": {"type": ["string", "null"]}},
                    "pass_rate": RATE,
                    "flaky": {"type": "boolean"},
                },
            },
        },
    },
}
VALIDATOR = jsonschema.Draft202012Validator(SHAPE)
KEY = ("s/t", "knee", "error")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The path of a history that does not exist yet."""
    return tmp_path / "h.sqlite"


def found(path: Path, **asked: Any) -> dict[str, Any]:
    """Return the trends, checked for their shape and strict JSON."""
    with History(path, create=True) as history:
        shown = json.loads(json.dumps(trends(history, **asked), allow_nan=False))
    VALIDATOR.validate(shown)
    count = len(shown["runs"])
    assert [run["started"] for run in shown["runs"]] == sorted(run["started"] for run in shown["runs"])
    assert all(len(test["verdicts"]) == count for test in shown["tests"].values())
    assert all(0 <= point[0] < count for item in shown["measurements"].values() for point in item["points"])
    return shown


def series(path: Path, values: list[float | list[float]], **limits: float) -> dict[str, Any]:
    """Return the trend of a measurement with these values, one run each."""
    for index, value in enumerate(values):
        group = value if isinstance(value, list) else [value]
        put(
            path,
            stored(index),
            {"s/t": "passed"},
            {KEY: [Measurement("error", item, Unit.DEG, **limits) for item in group]},
        )
    return found(path, last=1000)["measurements"]["\n".join(KEY)]


def verdicts(path: Path, *words: str | None) -> dict[str, Any]:
    """Return the trend of a test with these verdicts, one run each; None is a run without the test."""
    for index, word in enumerate(words):
        put(path, stored(index), {"s/t": word} if word else {"s/other": "passed"})
    return found(path)["tests"]["s/t"]


# Drift ---------------------------------------------------------------------------------------------------------------


def test_a_drift_is_found_and_followed_to_the_limit(path: Path):
    """A drift in noise is found with slope, unit, limit and the number of runs until the limit."""
    noise = random.Random(3)
    item = series(path, [1 + 0.02 * n + noise.gauss(0, 0.05) for n in range(40)], low=0.0, high=2.0)
    drift = item["drift"]
    assert drift["slope"] == pytest.approx(0.02, abs=0.003)
    assert (drift["unit"], drift["limit"], drift["believed"]) == ("deg/run", 2.0, True)
    assert drift["p"] < 0.001
    assert drift["after"] == pytest.approx((2.0 - 1 - 0.02 * 39) / 0.02, abs=5)
    assert item["points"][3][2:] == [0.0, 2.0, "passed"]
    assert item["pass_rate"][0] == 1


def test_a_falling_value_goes_to_the_lower_limit(path: Path):
    """A falling value drifts to its lower limit."""
    drift = series(path, [100.0 - n for n in range(20)], low=71.0, high=200.0)["drift"]
    assert (drift["slope"], drift["limit"], drift["after"]) == (-1.0, 71.0, 10)


def test_what_is_beyond_its_limit_is_there(path: Path):
    """A value beyond its limit has no runs left."""
    assert series(path, [float(n) for n in range(20)], high=10.0)["drift"]["after"] == 0


def test_a_limit_that_is_far_away_is_not_dated(path: Path):
    """A distant limit has no number of runs."""
    drift = series(path, [float(n) for n in range(20)], high=1e6)["drift"]
    assert (drift["limit"], drift["after"], drift["believed"]) == (1e6, None, True)


def test_away_from_the_only_limit_is_no_way_to_it(path: Path):
    """A drift away from the only limit has no limit."""
    drift = series(path, [float(n) for n in range(20)], low=-1.0)["drift"]
    assert (drift["limit"], drift["after"], drift["believed"]) == (None, None, True)


def test_noise_is_no_drift(path: Path):
    """Of a hundred measurements of noise none is believed to drift."""
    noise = random.Random(11)
    for index in range(30):
        values = {("s/t", "", f"error {n}"): Measurement("error", noise.gauss()) for n in range(100)}
        put(path, stored(index), {"s/t": "passed"}, values)
    drifts = [item["drift"] for item in found(path)["measurements"].values()]
    assert len(drifts) == 100
    assert 1 <= sum(drift["p"] < 0.05 for drift in drifts) <= 12
    assert not any(drift["believed"] for drift in drifts)


@pytest.mark.parametrize("count", [1, 9, 10])
def test_few_runs_show_no_drift(path: Path, count: int):
    """A drift needs ten runs."""
    assert (series(path, [float(n) for n in range(count)])["drift"] is None) == (count < 10)


def test_a_constant_does_not_drift(path: Path):
    """A constant value has no drift."""
    assert series(path, [1.0] * 20)["drift"]["p"] == 1


def test_repetitions_count_by_their_middle(path: Path):
    """Repetitions in a run count by their median, so that an outlier is no drift."""
    item = series(path, [[5.0, 5.0 + n, 1000.0] for n in range(12)])
    assert item["drift"]["slope"] == pytest.approx(1)
    assert len(item["points"]) == 36
    assert item["points"][3][:2] == [1, 5.0]


def test_many_values_of_one_run_are_thinned_to_smallest_middle_and_largest(path: Path):
    """Of many values of a run the smallest, median and largest are points."""
    item = series(path, [[float(n) for n in range(100)]])
    assert [point[1] for point in item["points"]] == [0.0, 50.0, 99.0]


def test_values_that_are_no_numbers_are_there_without_one(path: Path):
    """NaN is a failed point without a value, and no part of the drift."""
    put(path, stored(0), {"s/t": "failed"})
    with History(path, create=True) as history:
        row = (*KEY, 0, None, "NaN", "deg", 0.0, 1.0, None, "failed")
        history.record(stored(1), [], [row])
    item = found(path)["measurements"]["\n".join(KEY)]
    assert item["points"] == [[1, None, 0.0, 1.0, "failed"]]
    assert item["pass_rate"][0] == 0


# Verdicts ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "flaky"),
    [
        (["passed", "failed", "passed"], True),
        (["failed", "passed", "error"], True),
        (["passed", "flaky"], True),
        (["passed", "passed", "failed", "failed"], False),  # a defect that came
        (["failed", "failed", "passed", "passed"], False),  # and one that was fixed
        (["failed", "failed", "failed"], False),
        (["passed", "skipped", "passed"], False),
        (["passed", "interrupted", "passed"], False),
        (["passed", "blocked", "passed", None, "not run"], False),
        (["passed", "failed", None, "skipped", "passed"], True),
        (["passed", "expected failure", "measured"], False),
    ],
)
def test_flaky_is_what_goes_back_and_forth(path: Path, words: list[str | None], flaky: bool):
    """A test is flaky if its verdict alternates, or if it passed at a later attempt only."""
    test = verdicts(path, *words)
    assert test["flaky"] is flaky
    assert test["verdicts"] == words


def test_the_pass_rate_counts_what_was_judged(path: Path):
    """The pass rate counts judged runs, with its Wilson interval; a late pass is a pass."""
    test = verdicts(path, "passed", "blocked", "flaky", "failed", "skipped", "measured", "interrupted", "not run")
    assert test["pass_rate"] == pytest.approx([0.75, 0.3006, 0.9544], abs=1e-4)


def test_where_nothing_was_judged_nothing_is_known(path: Path):
    """Without judged runs the interval is from 0 to 1."""
    assert verdicts(path, "skipped", "not run")["pass_rate"] == [0, 0, 1]
    assert series(path, [1.0])["pass_rate"] == [0, 0, 1]


def test_a_run_passes_a_measurement_when_all_its_values_do(path: Path):
    """A run passes a measurement if all its repetitions pass."""
    assert series(path, [[1.0, 1.0, 3.0], [1.0, 1.0]], high=2.0)["pass_rate"][0] == 0.5


# Which runs ----------------------------------------------------------------------------------------------------------


def test_an_empty_history_has_no_trends(path: Path):
    """The trends of an empty history have all parts, empty."""
    assert found(path) == {"runs": [], "measurements": {}, "tests": {}}


def test_the_last_runs_count(path: Path):
    """Only the last runs count, oldest first."""
    for index in range(8):
        put(path, stored(index), {"s/old" if index < 3 else "s/new": "passed"})
    shown = found(path, last=4)
    assert [run["started"] for run in shown["runs"]] == [BEGAN + 3600 * index for index in range(4, 8)]
    assert [*shown["tests"]] == ["s/new"]


def test_robots_and_stations_are_not_mixed_unless_asked_for(path: Path):
    """Trends are of the newest run's robot and station, or of the named ones."""
    for index, (robot, station) in enumerate([("r1", "a"), ("r2", "a"), ("r2", "b"), ("r1", "a"), ("r2", "a")]):
        put(path, stored(index, robot=robot, station=station))

    def runs(**asked: str) -> list[str]:
        return [run["run"] for run in found(path, **asked)["runs"]]

    assert runs() == ["run-1", "run-4"]
    assert runs(robot="r1") == ["run-0", "run-3"]
    assert runs(station="b") == ["run-2"]
    assert runs(robot="*", station="a") == ["run-0", "run-1", "run-3", "run-4"]
    assert runs(robot="*", station="*") == [f"run-{index}" for index in range(5)]
    assert runs(robot="r9") == []


def test_runs_of_other_suites_take_no_room(path: Path):
    """Only runs with the named suites count."""
    for index in range(9):
        suite = ("arm", "leg", "arm")[index % 3]
        put(path, stored(index), {f"{suite}/t": "passed"}, {(f"{suite}/t", "", "error"): Measurement("error", 1.0)})
    shown = found(path, suites={"leg"}, last=2)
    assert [run["run"] for run in shown["runs"]] == ["run-4", "run-7"]
    assert ([*shown["tests"]], [*shown["measurements"]]) == (["leg/t"], ["leg/t\n\nerror"])


@pytest.mark.parametrize(
    ("names", "tests", "measurements"),
    [
        (["reach"], {"arm/reach"}, {"error", "supply"}),
        (["ARM"], {"arm/reach", "arm/rest"}, {"error", "supply"}),
        (["knee"], set(), {"error"}),
        (["knee/err"], set(), {"error"}),
        (["arm/*"], {"arm/reach", "arm/rest"}, {"error", "supply"}),
        (["*/knee/*"], set(), {"error"}),
        (["suppl?"], set(), {"supply"}),
        (["error", "rest"], {"arm/rest"}, {"error"}),
        (["nothing"], set(), set()),
        (["arm"], {"arm/reach", "arm/rest"}, {"error", "supply"}),
    ],
)
def test_tests_and_measurements_are_named_by_parts_or_patterns(
    path: Path, names: list[str], tests: set[str], measurements: set[str]
):
    """Tests and measurements are selected by parts or patterns of id, subject and name."""
    values = {
        ("arm/reach", "knee", "error"): Measurement("error", 1.0),
        ("arm/reach", "", "supply"): Measurement("supply", 24.0),
    }
    put(path, stored(0), {"arm/reach": "passed", "arm/rest": "passed"}, values)
    shown = found(path, names=names)
    assert {*shown["tests"]} == tests
    assert {key.rpartition("\n")[2] for key in shown["measurements"]} == measurements
    assert len(shown["runs"]) == bool(tests or measurements)


def test_without_names_everything_is_asked_for(tmp_path: Path):
    """Without names all runs count, also empty ones."""
    put(tmp_path / "h.sqlite", stored(0))
    with History(tmp_path / "h.sqlite") as history:
        assert [len(trends(history, names=names)["runs"]) for names in ((), ("x",))] == [1, 0]


VALUES = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from([1.7e308, -1.7e308, 0.0, 5e-324])


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([*map(str, Verdict), "a new word"]),
            st.lists(st.tuples(VALUES, st.none() | VALUES, st.none() | VALUES), max_size=25),
        ),
        max_size=14,
    ),
)
def test_whatever_is_in_it_the_answer_has_its_shape(tmp_path_factory: pytest.TempPathFactory, runs: list):
    """Any verdicts and numbers give trends of the valid shape."""
    path = tmp_path_factory.mktemp("any") / "h.sqlite"
    for index, (verdict, values) in enumerate(runs):
        measured = [Measurement("error", value, Unit.NONE, low, high) for value, low, high in values]
        put(path, stored(index), {"s/t": verdict}, {("s/t", "", "error"): measured})
    shown = found(path)
    assert len(shown["runs"]) == len(runs)
    for item in shown["measurements"].values():
        assert item["drift"] is None or math.isfinite(item["drift"]["slope"])
