"""The page of a campaign in a real browser: offline, accessible, and made of texts only."""

from __future__ import annotations

import threading
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from playwright.sync_api import expect

from rtf.campaigns import Measured
from rtf.campaigns.backends.local import LocalBackend
from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.conductor import Conductor
from rtf.campaigns.designs import make_design
from rtf.campaigns.live_page import LivePage, serve_campaign
from rtf.campaigns.report.files import write_page
from rtf.campaigns.report.summary import make_report
from rtf.campaigns.store import CampaignStore
from rtf.testing.verdict import Verdict
from simulated_truth import Truth, faulty, measured, outcome

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from playwright.sync_api import Page

HOSTILE = "<img src=x onerror=alert(1)>\u202e&lt;"
PHONE = {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def campaign_page(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of a page with every kind of figure, and hostile names."""
    random = np.random.default_rng(1)
    severities = [0.25, 0.5, 1.0, 1.5, 2.0, 4.0]
    outcomes = [
        *Truth().campaign(random, severities, 15),
        *Truth(middle=0.5).campaign(random, severities, 15, test=HOSTILE, robot="bench", seconds=20.0),
        *[faulty(size, found=size > 1.0, fault="jam", joint=joint) for size in severities for joint in ("a", HOSTILE)],
        *[faulty(None, found=True, fault="motor_sign") for _ in range(4)],
        *[faulty(size, found=False, fault="encoder_noise", test=HOSTILE, robot="bench") for size in severities],
        *measured(random.normal(1.0, 0.1, 40), None, 1.2),
        *measured([1.0, 1.0, 1.0], 0.0, None),
        outcome(
            Verdict.FAILED, test=HOSTILE, robot="bench", measurements={HOSTILE: Measured(float("nan"), "deg", 0.0)}
        ),
        outcome(test="Never", verdict=Verdict.BLOCKED),
    ]
    path: Path = tmp_path_factory.mktemp("campaign") / "report.html"
    write_page(path, make_report(outcomes, HOSTILE))
    return path.as_uri()


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_it_is_accessible_and_needs_no_network(
    campaign_page: str, visit: Any, barriers: Callable[[Page], list[str]], shoot: Callable[..., None], *, dark: bool
):
    """All figures are there, each with words for those who do not see it; axe-core finds no violation."""
    page = visit(campaign_page, offline=True, dark=dark)
    expect(page.get_by_role("heading", level=2)).to_have_text(
        ["Detection limits", "False alarms and flakiness", "Measurements over the population", "What to run"]
    )
    expect(page.get_by_role("img", name="Sweep · encoder_drift · icub: found in 99 % from")).to_have_count(1)
    expect(page.locator("figure svg path.band")).to_have_count(2)
    expect(page.get_by_text("No curve: a severity separates")).to_have_count(1)
    expect(page.get_by_text("No curve: none was found")).to_have_count(1)
    shoot(page, f"campaign-{'dark' if dark else 'light'}")
    assert barriers(page) == []


def test_texts_of_others_are_shown_as_they_are(campaign_page: str, visit: Any):
    """They are no markup, and characters that would turn the text are made visible."""
    page = visit(campaign_page, offline=True)
    expect(page.get_by_role("heading", level=1)).to_contain_text("<img src=x onerror=alert(1)>\\u202e&lt;")
    expect(page.locator("img")).to_have_count(0)


def test_it_fits_a_phone(campaign_page: str, visit: Any, shoot: Callable[..., None]):
    """Nothing but its tables is wider than the screen."""
    page = visit(campaign_page, offline=True, viewport=PHONE, has_touch=True, is_mobile=True)
    expect(page.locator("figure").first).to_be_visible()
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
    shoot(page, "campaign-phone")


def test_paper_has_all_tables(campaign_page: str, visit: Any):
    """In print nothing scrolls, and the rows of tables are there."""
    page = visit(campaign_page, offline=True)
    expect(page.locator("figure").first).to_be_visible()
    page.emulate_media(media="print")
    page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    cut = page.evaluate(
        """() => [...document.querySelectorAll(".sort-region")]
          .filter((one) => one.scrollHeight > one.clientHeight + 1).length"""
    )
    assert cut == 0
    expect(page.get_by_role("table", name="detection limits").get_by_role("row")).to_have_count(6)


def test_tables_are_sorted_by_their_heads(campaign_page: str, visit: Any):
    """As all tables of the page."""
    page = visit(campaign_page, offline=True)
    table = page.get_by_role("table", name="costs")
    table.get_by_role("button", name="Mean time").click()
    expect(table.get_by_role("row").nth(1)).to_contain_text("2.00 s")
    table.get_by_role("button", name="Mean time").click()
    expect(table.get_by_role("row").nth(1)).to_contain_text("img src=x")


WAITING = """
from pathlib import Path

from rtf import clock
from rtf.testing import Parameter, TestCase


class Waiting(TestCase):
    gate = Parameter(str, "it waits for this file, if there is to be one", default="-")

    def run(self):
        while self.gate != "-" and not Path(self.gate).exists():
            clock.sleep(0.02)
        with self.subresult(SUBJECT):
            self.check(self.gate == "-", "it holds")
"""


def test_it_is_live_while_a_campaign_runs(
    tmp_path: Path, visit: Any, barriers: Callable[[Page], list[str]], shoot: Callable[..., None]
):
    """What runs, the latest results and the report appear by themselves; the printed address stops the campaign."""
    gate = tmp_path / "<b>gate"
    (tmp_path / "waiting.py").write_text(WAITING.replace("SUBJECT", repr(HOSTILE)))
    file = tmp_path / "live.toml"
    file.write_text(
        f'schema = 1\nname = "live"\nseeds = 2\n[[tests]]\nname = "waiting.py"\n'
        f'[[overrides]]\nparameter = "gate"\nvalues = ["-", "{gate}"]\n'
    )
    campaign, state = load_campaign(file), tmp_path / "live.sqlite"
    live = LivePage(state, "live")
    with (
        CampaignStore(state, create=True) as store,
        closing(LocalBackend(1)) as backend,
        serve_campaign(live, "127.0.0.1", 0) as address,
    ):
        conductor = Conductor(campaign, make_design(campaign), store, backend)
        running = threading.Thread(target=conductor.run, args=[live.beside(lambda _: None, conductor.stop)])
        running.start()
        try:
            page = visit(address)
            watching = page.context.new_page()
            watching.goto(address.partition("#")[0])
            expect(page.get_by_role("listitem").filter(has_text="waiting.py gate=")).to_contain_text("<b>gate")
            expect(page.get_by_role("table", name="latest results").get_by_role("row")).to_have_count(2)
            expect(page.get_by_role("heading", name="False alarms and flakiness")).to_be_visible()
            shoot(page, "campaign-live")
            assert barriers(page) == []
            page.get_by_role("button", name="Begin no further run").click()
            expect(page.get_by_role("button", name="Drop running ones")).to_be_visible()
            expect(watching.get_by_role("heading", name="Now stopping")).to_be_visible()
            expect(watching.get_by_role("button", name="Drop running ones")).to_have_count(0)
        finally:
            gate.touch()
            conductor.stop()
            running.join()
        live.end()
        expect(page.get_by_role("heading", name="Now over")).to_be_visible()
        expect(page.get_by_role("table", name="latest results")).to_contain_text("<img src=x onerror=alert(1)>\\u202e")
        expect(page.locator("img, b")).to_have_count(0)
