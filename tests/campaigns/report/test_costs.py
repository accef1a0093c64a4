"""The cost of tests, and the choice of those that find everything for the least time."""

from __future__ import annotations

from itertools import chain, combinations
from math import log

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.campaigns import Outcome
from rtf.campaigns.report.costs import Choice, choices, costs
from rtf.campaigns.report.detection import detection_curves
from simulated_truth import faulty, outcome


def campaign(finds: dict[str, dict[str, float]], seconds: dict[str, float], kinds: set[str]) -> list[Outcome]:
    """Return outcomes of tests that find each fault from a severity on; of those not named they find none."""
    outcomes = [outcome(test=test, seconds=seconds[test]) for test in finds]
    for test, limits in finds.items():
        for kind in kinds:
            outcomes += [
                faulty(size, found=size >= limits.get(kind, 9.0), fault=kind, test=test, seconds=99.0)
                for size in (1.0, 2.0, 3.0)
            ]
    return outcomes


def choose(outcomes: list[Outcome], budget: float | None = None) -> Choice:
    """Return the choice for the only robot."""
    (choice,) = choices(detection_curves(outcomes, lambda _: ""), costs(outcomes), budget)
    return choice


FINDS = {"Quick": {"jam": 3.0, "drift": 2.0}, "Slow": {"jam": 1.0, "drift": 1.0}, "Idle": {"drift": 3.0}}
SECONDS = {"Quick": 1.0, "Slow": 100.0, "Idle": 5.0}


def test_what_a_healthy_robot_takes_is_the_cost():
    """A faulty robot may end a test early, or late."""
    found = {cost.test: (cost.runs, cost.seconds) for cost in costs(campaign(FINDS, SECONDS, {"jam", "drift"}))}
    assert found == {"Slow": (1, 100.0), "Idle": (1, 5.0), "Quick": (1, 1.0)}


def test_all_is_found_by_the_tests_that_are_chosen():
    """The quick test comes first and would find half; the slow one finds it all, so the quick one is not needed."""
    choice = choose(campaign(FINDS, SECONDS, {"jam", "drift"}))
    assert [(step.test, step.total_seconds, step.share) for step in choice.steps] == [("Slow", 100.0, 1.0)]
    assert (choice.needs, choice.missed, choice.found_by_none) == (6, (), ())


def test_a_budget_limits_the_choice():
    """In five seconds the quick test finds three of six; what is missed is reported."""
    choice = choose(campaign(FINDS, SECONDS, {"jam", "drift"}), 5.0)
    assert [(step.test, step.share) for step in choice.steps] == [("Quick", 0.5)]
    assert [(need.fault, need.severity) for need in choice.missed] == [("drift", 1.0), ("jam", 1.0), ("jam", 2.0)]


def test_what_no_test_finds_is_reported():
    """It is no need of the choice."""
    choice = choose(campaign(FINDS, SECONDS, {"jam", "drift", "ghost"}))
    assert choice.needs == 6
    assert {need.fault for need in choice.found_by_none} == {"ghost"}


def test_robots_have_a_choice_of_their_own():
    """What is found on one robot says nothing of another."""
    outcomes = [faulty(1.0, found=True, robot="icub", test="A"), faulty(1.0, found=True, robot="panda", test="B")]
    found = choices(detection_curves(outcomes, lambda _: ""), costs(outcomes))
    assert [(choice.robot, [step.test for step in choice.steps]) for choice in found] == [
        ("icub", ["A"]),
        ("panda", ["B"]),
    ]


KINDS = ["a", "b", "c", "d", "e"]


@given(
    st.dictionaries(
        st.sampled_from(["T1", "T2", "T3", "T4", "T5"]),
        st.tuples(st.sets(st.sampled_from(KINDS)), st.integers(1, 50)),
        min_size=1,
    ),
    st.one_of(st.none(), st.integers(0, 120)),
)
def test_the_choice_is_nearly_the_best(tests: dict[str, tuple[set[str], int]], budget: int | None):
    """It finds all that any test finds, with no test too many, at a known factor of the least time; or is in time."""
    outcomes = [outcome(test=test, seconds=float(price)) for test, (_, price) in tests.items()]
    outcomes += [
        faulty(None, found=kind in kinds, fault=kind, test=test) for test, (kinds, _) in tests.items() for kind in KINDS
    ]
    choice = choose(outcomes, budget)
    chosen = [step.test for step in choice.steps]
    total = sum(tests[test][1] for test in chosen)
    found = set().union(*(tests[test][0] for test in chosen))
    everything = set().union(*(kinds for kinds, _ in tests.values()))
    assert len(choice.missed) == len(everything) - len(found)
    assert sum(len(step.adds) for step in choice.steps) == len(found)
    if budget is not None:
        assert total <= budget
        return
    assert found == everything
    subsets = chain.from_iterable(combinations(tests, count) for count in range(len(tests) + 1))
    covers = [subset for subset in subsets if set().union(*(tests[test][0] for test in subset)) == everything]
    best = min(sum(tests[test][1] for test in subset) for subset in covers)
    assert total <= (log(len(everything)) + 1.0) * best if everything else total == 0
    for test in chosen:
        assert set().union(*(tests[other][0] for other in chosen if other != test)) != everything


def test_a_campaign_without_faults_has_no_choice():
    """There is nothing to be found."""
    assert choices((), costs([outcome()])) == ()


@pytest.mark.parametrize("seconds", [0.0, 1e-9])
def test_a_test_that_costs_nothing_is_no_division_by_zero(seconds: float):
    """The clock may have been too coarse."""
    assert choose([faulty(1.0, found=True, seconds=seconds), faulty(2.0, found=True)]).missed == ()
