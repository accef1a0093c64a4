"""The proof as a campaign: the shipped file has every case of the claims once, and its results are judged by them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.claims import judged, task_of
from rtf.campaigns.designs import make_design
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.store import CampaignStore, State
from rtf.campaigns.tasks import Task, from_json, to_json
from rtf.robot_testing.proof import Judgement, shipped_cases
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from pathlib import Path


def test_the_shipped_campaign_is_the_proof():
    """Each case of the claims is one run, with its test, robot, fault and parameters; healthy robots are among them."""
    campaign = load_campaign(shipped_folder("suites") / "campaigns" / "proof.toml")
    tasks, cases = [*make_design(campaign).tasks({})], shipped_cases()
    assert len({task.key for task in tasks}) == len(tasks) == len(cases)
    for task, case in zip(tasks, cases, strict=True):
        fault = (task.fault.kind, task.fault.target, dict(task.fault.values)) if task.fault else ("", "", {})
        times = {"delay": case.delay or None, "duration": case.duration}
        values = {name: value for name, value in (case.values | times).items() if value is not None}
        assert (task.test, *fault) == (case.test, case.fault, case.target, values)
        assert [name for name, _ in task.parameters] == [*case.parameters]
        assert task.model == (case.robot or "icub")
        assert from_json(to_json(task)).key == task.key
    assert {task.test for task in tasks if task.fault is None} == {case.test for case in cases}


def test_results_are_judged_by_their_claims(tmp_path: Path):
    """A case that killed its worker is not tested, of any seed; a run that is no case is reported."""
    case = next(case for case in shipped_cases(["Imu"]) if case.fault)
    with CampaignStore(tmp_path / "proof.sqlite", create=True) as store:
        store.add([task_of(case, 3)])
        store.fail(*store.take(1), State.KILLED, "killed")
        assert [(one.case, one.judgement) for one in judged(store)] == [(case, Judgement.NOT_TESTED)]
        store.add([Task(test="Imu", seed=9)])
        store.fail(*store.take(1), State.KILLED, "killed")
        with pytest.raises(CampaignError, match="no claim has the case 'Imu seed 9'"):
            list(judged(store))
