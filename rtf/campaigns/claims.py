"""The proof as a campaign: the runs that the claims of tests ask for, and whether the claims hold."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from rtf.campaigns.errors import CampaignError
from rtf.campaigns.tasks import FaultValues, Task, text_of
from rtf.robot.model import default_robot
from rtf.robot_testing.proof import judge, shipped_cases
from rtf.simulator.faults import find_kind
from rtf.testing import journal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.campaigns.store import CampaignStore
    from rtf.robot_testing.proof import Case, JudgedCase


def task_of(case: Case, seed: int) -> Task:
    """Return the run of a case."""
    return Task(
        test=case.test,
        parameters=tuple((name, text_of(value)) for name, value in case.parameters.items()),
        model=case.robot or default_robot().name,
        seed=seed,
        fault=_fault(case) if case.fault else None,
        cameras=case.needs_cameras,
        simulator=tuple((name, text_of(value)) for name, value in case.simulator.items()),
        configuration=case.configuration,
    )


def _fault(case: Case) -> FaultValues:
    times = {"delay": case.delay or None, "duration": case.duration}
    values = {name: float(value) for name, value in (case.values | times).items() if value is not None}
    return FaultValues(case.fault, case.target, tuple(values.items()), find_kind(case.fault).severity(case.values))


def judged(store: CampaignStore) -> Iterator[JudgedCase]:
    """Yield the cases of a campaign with their judgements. Raises CampaignError for a run that no claim asks for."""
    cases = {task_of(case, 0).key: case for case in shipped_cases()}
    cases |= {task_of(case, 0).key: case for case in shipped_cases(fast=True)}
    for task, packed in store.journals():
        case = cases.get(msgspec.structs.replace(task, seed=0).key)
        if case is None:
            raise CampaignError(f"{store.path}: no claim has the case {task.described!r}; start a new campaign")
        with tempfile.TemporaryDirectory(prefix="rtf-claims-") as folder:
            path = Path(folder) / journal.FILE_NAME
            path.write_bytes(packed)
            yield judge(case, next(iter(journal.results_of(path).tests.values()), None) if packed else None)
