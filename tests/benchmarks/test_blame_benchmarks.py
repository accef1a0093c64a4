"""The benchmark of blame counts who was named first, and which healthy joints failed."""

from __future__ import annotations

from collections import Counter
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf.testing.events import Message, SubResultEnded
from rtf.testing.journal import FILE_NAME, Journal
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from types import ModuleType

pytestmark = pytest.mark.skipif(not find_spec("icub_models"), reason="needs pip install 'rtf[sim]'")

SWAPPED = "the encoders of l_wrist_pitch and l_wrist_yaw are swapped"


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script as a module."""
    monkeypatch.syspath_prepend(Path(__file__).parent)
    return import_module("run_blame_benchmarks")


def test_a_kind_that_exchanges_something_concerns_two_joints(benchmark: ModuleType):
    """The last tested joint of a part is exchanged with the one before it."""
    swapped = [*benchmark.cases(["T"], ["encoders_swapped"], ["l_elbow", "l_wrist_yaw"])]
    assert [benchmark.faulty_joints(one) for one in swapped] == [
        {"l_elbow", "l_wrist_prosup"},
        {"l_wrist_yaw", "l_wrist_pitch"},
    ]
    (jam,) = benchmark.cases(["T"], ["jam"], ["l_elbow"])
    assert benchmark.faulty_joints(jam) == {"l_elbow"}


def test_the_first_failure_counts_or_what_explains_the_first_doubt(benchmark: ModuleType, tmp_path: Path):
    """A test that passes counts for nothing."""
    right, doubt, wrong, passed = benchmark.cases(["A", "B", "C", "D"], ["encoders_swapped"], ["l_wrist_pitch"])
    journal = Journal(tmp_path / FILE_NAME)
    fail, end = Severity.FAILURE, SubResultEnded
    for event in (
        Message(test="s/right", subject="l_wrist_yaw", severity=fail, title="fails", detail=SWAPPED),
        end(test="s/right", subject="l_elbow", verdict=Verdict.PASSED),
        end(test="s/right", subject="l_wrist_yaw", verdict=Verdict.FAILED, reason=SWAPPED),
        end(test="s/doubt", subject="l_elbow", verdict=Verdict.INCONCLUSIVE, reason=f"late; explained by: {SWAPPED}"),
        Message(test="s/wrong", subject="l_elbow single", severity=fail, title="fails", detail="broken"),
        end(test="s/wrong", subject="l_elbow single", verdict=Verdict.FAILED),
        end(test="s/wrong", subject="l_elbow group", verdict=Verdict.PASSED),
        end(test="s/passed", subject="l_elbow", verdict=Verdict.PASSED),
    ):
        journal.append(event)
    journal.close()
    by_test = {"s/right": right, "s/doubt": doubt, "s/wrong": wrong, "s/passed": passed}
    blamed, verdicts = benchmark.judged(tmp_path, by_test)
    assert [(one.test, one.first, one.right, one.wrong) for one in blamed] == [
        ("A", "l_wrist_yaw", True, ()),
        ("B", "l_wrist_pitch", True, ()),
        ("C", "l_elbow", False, ("l_elbow",)),
    ]
    assert verdicts == Counter(passed=2, failed=2, inconclusive=1)
    assert benchmark.table(blamed).splitlines()[-1] == "| encoders_swapped | 3 | 2 | 1 of 3 |"
