"""``rtf campaign report`` and ``compare`` on files of real campaigns of trivial tests."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from rtf.campaigns.backends.local import LocalBackend
from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.conductor import Conductor
from rtf.campaigns.designs import make_design
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.store import CampaignStore
from rtf.cli.campaign_report import compare, report
from rtf.testing.history import History, trends, trends_for_a_run
from rtf.testing.history.database import HistoryError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from pathlib import Path

#: Fails where the value is above its limit.
TEST = """
from rtf.testing import Parameter, TestCase


class Reach(TestCase):
    error = Parameter(float, "what it measures", default=0.5)

    def run(self):
        with self.subresult("l_elbow"):
            self.measure("error", self.error, "deg", high=1.0)
"""
CAMPAIGN = """
schema = 1
name = "reach"
seeds = 2
[[tests]]
name = "reach.py"
[[overrides]]
parameter = "error"
values = {values}
"""


@dataclass(frozen=True)
class Lab:
    """Two campaigns: before and after a change that made each second value too large."""

    folder: Path
    before: Path
    after: Path


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """Run both campaigns by two workers."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "reach.py").write_text(TEST)
    paths = []
    for name, values in (("before", "[0.5]"), ("after", "[1.5, 0.6]")):
        path = folder / f"{name}.toml"
        path.write_text(CAMPAIGN.format(values=values))
        campaign, backend = load_campaign(path), LocalBackend(2, 0)
        paths.append(path.with_suffix(".sqlite"))
        with CampaignStore(paths[-1], create=True, exclusive=True) as store:
            Conductor(campaign, make_design(campaign), store, backend).run()
        backend.close()
    return Lab(folder, *paths)


def test_a_report_is_printed_and_written(lab: Lab, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """The main figures as text, and all of them as page, JSON and tables."""
    page, data, tables = tmp_path / "page.html", tmp_path / "data.json", tmp_path / "tables"
    words = [str(lab.after), "-o", str(page), "--json", str(data), "--csv", str(tables), "--budget", "5min"]
    assert report(words) is ExitCode.PASSED
    said = capsys.readouterr().out
    assert said.startswith("after: 4 runs, 4 without a fault; 1 test\n")
    assert "2 of 4 (6.8 to 93 %)" in said
    assert said.endswith(f"\n{page}\n")
    assert json.loads(data.read_bytes())["alarms"][0]["alarms"]["count"] == 2
    assert page.stat().st_size > 50_000
    assert (tables / "runs.csv").read_text().count("\n") == 5


def test_the_page_is_beside_the_campaign(lab: Lab, capsys: pytest.CaptureFixture[str]):
    """Without another place it has the name of the campaign."""
    assert report([str(lab.before)]) is ExitCode.PASSED
    assert capsys.readouterr().out.endswith(f"{lab.folder / 'before.html'}\n")
    assert (lab.folder / "before.html").is_file()


def test_a_campaign_without_runs_has_no_report(lab: Lab, tmp_path: Path):
    """Nor has a file that is not there, or is no campaign; the error names the file."""
    with CampaignStore(tmp_path / "empty.sqlite", create=True):
        pass
    with pytest.raises(CampaignError, match=r"empty\.sqlite: no run of this campaign is done yet"):
        report([str(tmp_path / "empty.sqlite")])
    with pytest.raises(CampaignError, match=r"there is no campaign .*none\.sqlite: 'rtf campaign FILE.toml' runs one"):
        report([str(tmp_path / "none.sqlite")])
    with pytest.raises(HistoryError, match=r"before\.toml"):
        report([str(lab.folder / "before.toml")])


def test_what_moved_is_reported(lab: Lab, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Four runs say too little of a half: the distribution is reported as it is, and nothing as a change."""
    assert compare([str(lab.before), str(lab.after), "--json", str(tmp_path / "changes.json")]) is ExitCode.PASSED
    assert capsys.readouterr().out == "before and after: 0 of 2 comparisons differ by more than chance\n"
    changes = json.loads((tmp_path / "changes.json").read_bytes())["changes"]
    found = {change["what"]: (change["before"], change["after"]) for change in changes}
    assert found == {"false alarms": (0.0, 0.5), "distribution": (0.5, pytest.approx(1.05))}
    assert compare([str(lab.before), str(lab.before)]) is ExitCode.PASSED


def test_the_history_takes_the_file_of_a_campaign(lab: Lab):
    """Its trends are those of all robots and units, and without runs in which a robot had a fault."""
    with History(lab.after) as history:
        assert history.is_campaign
        everything = trends(history)
        assert len(everything["runs"]) == 4
        assert trends_for_a_run(history, frozenset({"campaign"}), "another robot", "") == everything
        history._connection.execute(
            "UPDATE tasks SET task = json_set(task, '$.fault', json('{}')) WHERE id = (SELECT min(id) FROM tasks)"
        )
        assert len(trends(history)["runs"]) == 3


def test_another_history_is_of_one_robot(tmp_path: Path):
    """It is no campaign, and no run of it had a fault."""
    with History(tmp_path / "history.sqlite", create=True) as history:
        assert not history.is_campaign
        assert history.faulty() == frozenset()
