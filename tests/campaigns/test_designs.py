"""Designs: which runs they want, and when a sequential one has seen enough."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.designs import make_design

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from rtf.campaigns.designs import Design
    from rtf.campaigns.tasks import Task

ELBOW = """
seeds = 4
[[tests]]
name = "JointSweep"
[[robots]]
model = "icub"
units = { first = 0, last = 9 }
[[faults]]
kind = "friction"
targets = ["l_elbow", "l_shoulder_roll"]
severities = { low = 0.1, high = 10.0, levels = 3, scale = "log" }
"""


def run_all(design: Design, fails: Callable[[Task], bool | None]) -> dict[str, bool | None]:
    """Do what the design wants until it wants nothing more."""
    found: dict[str, bool | None] = {}
    while wanted := [task for task in design.tasks(found) if task.key not in found]:
        found.update((task.key, fails(task)) for task in wanted)
    return found


def test_a_grid_is_all_combinations(write: Callable[[str], Path]):
    """A grid has each fault at each level, and the healthy robot, with each unit and seed."""
    design = make_design(load_campaign(write(ELBOW)))
    tasks = [*design.tasks({})]
    assert design.most == len(tasks) == (1 + 2 * 3) * 10 * 4
    assert {task.fault.severity for task in tasks if task.fault} == {0.1, 1.0, 10.0}


@pytest.mark.parametrize("kind", ["random", "latin_hypercube"])
def test_drawn_points_are_reproducible_and_spread(write: Callable[[str], Path], kind: str):
    """Two readings draw the same points; a Latin hypercube has one in each of as many slices of the severity."""
    path = write(f'{ELBOW}[design]\nkind = "{kind}"\npoints = 40\n'.replace("seeds = 4", "seeds = 4\nhealthy = false"))
    first, second = ([*make_design(load_campaign(path)).tasks({})] for _ in range(2))
    assert first == second
    severities = [task.fault.severity for task in first if task.fault and task.fault.severity]
    assert len(severities) == 40
    if kind == "latin_hypercube":
        from math import log10

        slices = Counter(int((log10(severity) + 1) / 2 * 40 - 1e-9) for severity in severities)
        assert max(slices.values()) == 1


def test_more_random_points_continue_the_same_draw(write: Callable[[str], Path]):
    """The points that are done stay when there are to be more."""
    few, many = (
        [
            task.key
            for task in make_design(load_campaign(write(f'{ELBOW}[design]\nkind="random"\npoints={n}\n'))).tasks({})
        ]
        for n in (10, 20)
    )
    assert many[:10] == few


SEQUENTIAL = f'{ELBOW}[design]\nkind = "sequential"\nresolution = 0.02\n'.replace(
    "[[tests]]", "healthy = false\n[[tests]]"
)


@settings(max_examples=10, deadline=None)
@given(limit=st.floats(0.11, 9.9))
def test_bisection_brackets_the_limit(tmp_path_factory: pytest.TempPathFactory, limit: float):
    """A fault that is always found above a limit and never below: the last two levels enclose the limit."""
    folder = tmp_path_factory.mktemp("bisection")
    path = folder / "c.toml"
    path.write_text(f'schema = 1\nname = "b"\n{SEQUENTIAL}')
    design = make_design(load_campaign(path))
    severities: dict[float, bool] = {}

    def fails(task: Task) -> bool:
        assert task.fault is not None
        assert task.fault.severity is not None
        return severities.setdefault(task.fault.severity, task.fault.severity >= limit)

    found = run_all(design, fails)
    missed = max(one for one, seen in severities.items() if not seen)
    seen = min(one for one, seen in severities.items() if seen)
    assert missed < limit <= seen
    assert seen / missed <= (10.0 / 0.1) ** 0.02 * 1.001
    assert len(found) < design.most


def test_what_is_never_found_is_given_up_at_the_greatest_severity(write: Callable[[str], Path]):
    """Smaller severities are not tried where the greatest one is not found."""
    design = make_design(load_campaign(write(SEQUENTIAL)))
    tried = set()

    def fails(task: Task) -> bool:
        assert task.fault is not None
        tried.add(task.fault.severity)
        return False

    assert len(run_all(design, fails)) < design.most
    assert tried == {10.0}


def test_healthy_runs_stop_when_the_alarm_rate_is_decided(write: Callable[[str], Path]):
    """Without alarms the interval falls below the rate; with nothing but judgements that say nothing, all is used."""
    text = SEQUENTIAL.replace("healthy = false\n", "").replace("seeds = 4", "seeds = 40").partition("[[faults]]")
    design = make_design(load_campaign(write(f'{text[0]}[design]\nkind = "sequential"\n')))
    assert design.most == 400
    assert 30 <= len(run_all(design, lambda _: False)) < 150
    assert len(run_all(design, lambda _: True)) <= 10
    assert len(run_all(design, lambda _: None)) == 400
