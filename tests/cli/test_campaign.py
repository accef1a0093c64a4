"""``rtf campaign``: planned, run, stopped, gone on with, and looked at."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.store import CampaignStore, State
from rtf.cli.campaign import plan, run, status

if TYPE_CHECKING:
    from collections.abc import Callable

TEST = """
import os
from pathlib import Path

from rtf import clock
from rtf.testing import Parameter, TestCase


class Slow(TestCase):
    gate = Parameter(str, "the file that it waits for", default="")

    def run(self):
        while self.gate and not Path(self.gate).exists():
            clock.sleep(0.02)
        self.check(True, "it holds")
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A campaign of two runs with one worker, which wait for a file."""
    (tmp_path / "slow.py").write_text(TEST)
    path = tmp_path / "slow.toml"
    gate = tmp_path / "gate"
    text = f'schema = 1\nname = "slow"\nseeds = 2\n[[tests]]\nname = "slow.py"\nparameters = {{ gate = "{gate}" }}\n'
    path.write_text(f"{text}[backend]\nworkers = 1\n")
    return path


def counts(campaign: Path) -> dict[State, int]:
    """Return the number of tasks in each state."""
    with CampaignStore(campaign.with_suffix(".sqlite")) as store:
        return dict(store.counts())


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = clock.Deadline.after(60.0)
    while not condition():
        assert not deadline.expired
        clock.sleep(0.05)


def test_a_campaign_is_planned_run_and_looked_at(campaign: Path, capsys: pytest.CaptureFixture[str]):
    """The plan assumes what it does not know, and knows it afterwards; the state has its own file."""
    (campaign.parent / "gate").touch()
    words = [str(campaign)]
    assert plan([*words, "--list"]) == 0
    said = capsys.readouterr().out
    assert "slow.py seed 1" in said
    assert "slow: 2 runs, 0 done, design grid" in said
    assert "assumed, as none is done" in said
    assert run(words) == 0
    assert "CAMPAIGN DONE  2 runs" in capsys.readouterr().out
    assert plan(words) == status(words) == 0
    assert "mean of the 2 that are done" in capsys.readouterr().out


def test_a_misspelt_parameter_is_reported_before_anything_runs(campaign: Path):
    """The runner's check of parameters is made by plan, and before the first run."""
    campaign.write_text(campaign.read_text().replace("gate =", "gte ="))
    for command in (plan, run):
        with pytest.raises(CampaignError, match=r"unknown parameter 'gte'.*did you mean 'gate'"):
            command([str(campaign)])
    assert counts(campaign) == {}


def start(campaign: Path) -> subprocess.Popen[str]:
    """Start the campaign, and return when its first run is going on."""
    words = [sys.executable, "-m", "rtf", "campaign", str(campaign)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    state = campaign.with_suffix(".sqlite")
    wait_for(lambda: state.exists() and state.stat().st_size > 0 and counts(campaign).get(State.RUNNING) == 1)
    return process


def test_ctrl_c_lets_running_tasks_finish(campaign: Path):
    """Ctrl-C begins no further run; the same command goes on."""
    with start(campaign) as process:
        process.send_signal(signal.SIGINT)
        (campaign.parent / "gate").touch()
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "CAMPAIGN INTERRUPTED" in said
    assert counts(campaign) == {State.DONE: 1, State.WAITING: 1}
    assert run([str(campaign)]) == 0
    assert counts(campaign) == {State.DONE: 2}


def test_sigterm_drops_running_tasks(campaign: Path):
    """SIGTERM ends what is running; it waits for the next time."""
    with start(campaign) as process:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
    assert process.returncode == 2
    assert counts(campaign) == {State.WAITING: 2}


def test_a_terminal_asks_what_becomes_of_running_tasks(campaign: Path):
    """On a terminal the question can be answered with d; the view is drawn there."""
    words = [sys.executable, "-m", "rtf", "campaign", str(campaign)]
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, words)
    seen = b""

    def read_until(text: bytes) -> None:
        nonlocal seen
        while text not in seen:
            seen += os.read(terminal, 4096)

    try:
        read_until(b"slow.py seed 0")
        os.write(terminal, b"\x03")  # Ctrl-C
        read_until(b"Type d and Enter")
        os.write(terminal, b"d\n")
        read_until(b"CAMPAIGN INTERRUPTED")
    finally:
        _, code = os.waitpid(pid, 0)
        os.close(terminal)
    assert os.waitstatus_to_exitcode(code) == 2
    assert counts(campaign) == {State.WAITING: 2}
