"""Code that runs in this process is judged as on a machine without load."""

from __future__ import annotations

import pytest

from rtf.robot_testing.judging import real_time_checks


@pytest.fixture(autouse=True)
def machine_with_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """No process has waited for a processor, unless a test says otherwise."""
    monkeypatch.setattr(real_time_checks, "stalled_seconds", lambda: 0.0)
