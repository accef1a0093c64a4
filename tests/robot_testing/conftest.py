"""What is in-process here is judged as on a machine that has time, however busy the one is that runs these tests."""

from __future__ import annotations

import pytest

from rtf.robot_testing.judging import real_time_checks


@pytest.fixture(autouse=True)
def machine_with_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing has ever waited for a processor, unless a test says otherwise."""
    monkeypatch.setattr(real_time_checks, "stalled_seconds", lambda: 0.0)
