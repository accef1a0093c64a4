"""``isolation="none"``: the test runs inside the runner, for a debugger's sake; nothing can end one that hangs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing.events import TestStarted
from rtf.testing.isolation.attempt import Outcome
from rtf.testing.isolation.worker import run_test
from rtf.testing.session import Session
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.testing.events import Event
    from rtf.testing.isolation.job import Job


def run_in_process(job: Job, emit: Callable[[Event], None]) -> Outcome:
    """Run one attempt here and now; limits, memory and questions do not apply."""
    began = clock.monotonic()
    emit(TestStarted(test=job.id, attempt=job.attempt))
    session = Session(job.id, emit, folder=Path(job.folder), run_folder=Path(job.run_folder))
    finished = run_test(job, session)
    return Outcome(
        verdict=Verdict(finished["outcome"]),
        reason=finished["reason"],
        detail=finished["detail"],
        duration=clock.monotonic() - began,
        cut_short=session.undoing_failed,
    )
