"""A campaign of trivial tests, which need no robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

#: Does what the parameter says: passes, fails, or kills its runner.
TRIVIAL = """
import os
import signal

from rtf.testing import Parameter, TestCase


class Trivial(TestCase):
    does = Parameter(str, "what it does", default="pass")

    def run(self):
        self.measure("height", 1.5, "m", high=2.0)
        if self.does == "kill":
            os.kill(int(os.environ["RTF_RUNNER_PID"]), signal.SIGKILL)
        with self.subresult("l_elbow"):
            self.check(self.does == "pass", "it holds")
"""
HEAD = 'schema = 1\nname = "trivial"\n'


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    """Write a campaign's file, beside a trivial test, and return its path."""
    (tmp_path / "trivial.py").write_text(TRIVIAL)

    def make(text: str, *, head: str = HEAD) -> Path:
        path = tmp_path / "campaign.toml"
        path.write_text(head + text)
        return path

    return make
