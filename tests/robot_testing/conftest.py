"""What is in-process here is judged as on a machine that has time, however busy the one is that runs these tests."""

from __future__ import annotations

import pytest

from rtf.robot_testing import lateness


@pytest.fixture(autouse=True)
def machine_with_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing has ever waited for a processor, unless a test says otherwise."""
    monkeypatch.setattr(lateness, "waited", lambda: 0.0)
