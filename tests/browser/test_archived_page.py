"""The archived page: one file with everything in it, opened without a network."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect

from archives import archive_of, numbered, put
from harness import run_command, write_files
from rtf.page.archive import Extras
from rtf.testing.events import Attached, ParametersResolved, RunStarted, SuitePlanned, TestPlanned, TestStarted

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from playwright.sync_api import Page

VERDICTS = {"crash": "error", "hang": "error", "measure": "failed", "flaky": "flaky", "skip": "skipped"}


def state_of(page: Page, test: str) -> Any:
    """Return the row of a test in the list."""
    return list_of_tests(page).get_by_role("option", name=re.compile(rf"^{test} "))


def list_of_tests(page: Page) -> Any:
    """Return the list of tests."""
    return page.get_by_role("listbox", name="Tests")


def test_it_opens_without_a_network(finished: Any, visit: Any, shoot: Callable[..., None]):
    """The page shows all verdicts without any request."""
    page = visit(finished.address, offline=True)
    expect(page.get_by_role("heading", level=1)).to_have_text("failed")
    for test, verdict in VERDICTS.items():
        expect(state_of(page, test)).to_contain_text(verdict)
    expect(state_of(page, "collapse")).to_contain_text("passed")
    shoot(page, "archive-tests")


def test_failures_stand_first(finished: Any, visit: Any):
    """Failed tests are at the top of the list."""
    page = visit(finished.address, offline=True)
    rows = list_of_tests(page).get_by_role("option")
    expect(rows).to_have_count(7)
    states = [
        re.findall("failed|error|flaky|skipped|passed", text.replace("\n", " "))[0] for text in rows.all_inner_texts()
    ]
    assert states == ["failed", "error", "error", "flaky", "skipped", "passed", "passed"]


def test_a_test_is_shown_in_depth(finished: Any, visit: Any, shoot: Callable[..., None]):
    """A test shows its parts, measurements with unit and limits, plots, and attachments."""
    page = visit(f"{finished.address}#bench/measure", offline=True)
    detail = page.get_by_role("region", name="Details")
    expect(detail.get_by_role("heading", name="measure", exact=True)).to_be_visible()
    expect(detail).to_contain_text("joint 3")
    row = detail.get_by_role("row").filter(has_text="joint 3").first
    expect(row).to_contain_text("1.7")
    expect(row).to_contain_text("deg")
    expect(detail.locator("canvas").first).to_be_visible()
    picture = detail.locator("img").first
    picture.scroll_into_view_if_needed()
    expect(picture).to_have_js_property("naturalWidth", 48)
    with page.expect_download() as download:
        detail.get_by_role("link", name="words.txt").click()
    assert download.value.path().read_bytes() == b"the last words of the arm\n"
    shoot(page, "archive-test")


def test_plots_show_something(finished: Any, visit: Any, shoot: Callable[..., None]):
    """A plot has more colours than its background."""
    page = visit(f"{finished.address}#bench/measure", offline=True)
    canvas = page.locator("canvas").first
    canvas.scroll_into_view_if_needed()
    expect(canvas).to_be_visible()
    page.wait_for_function(
        """() => [...document.querySelectorAll("canvas")].some((canvas) => {
          const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          const colours = new Set();
          for (let at = 0; at < data.length; at += 4) colours.add(data.slice(at, at + 4).join());
          return colours.size > 20;
        })"""
    )
    shoot(page, "archive-plot")


def test_links_lead_to_the_same_place_for_ever(finished: Any, visit: Any):
    """The address of a part of a test shows it, also after reloading."""
    page = visit(f"{finished.address}#bench/measure/joint%203", offline=True)
    detail = page.get_by_role("region", name="Details")
    expect(detail).to_contain_text("show the whole test")
    expect(detail).not_to_contain_text("joint 1")
    page.reload()
    expect(detail).to_contain_text("show the whole test")
    page.go_back()
    page.go_forward()
    expect(detail).to_contain_text("joint 3")


def test_the_fixture_is_shown_with_its_incident(finished: Any, visit: Any, shoot: Callable[..., None]):
    """A fixture shows its generations, and its incident with cause and last output."""
    page = visit(f"{finished.address}#~fixtures", offline=True)
    view = page.get_by_role("region", name="Fixtures", exact=True)
    expect(view).to_contain_text("server")
    expect(view).to_contain_text("collapse")
    expect(view.get_by_text("cannot bear it")).to_be_visible()
    shoot(page, "archive-fixtures")


def test_measurements_are_compared_across_tests(finished: Any, visit: Any, shoot: Callable[..., None]):
    """All measurements are in one table, which can be sorted and filtered."""
    page = visit(f"{finished.address}#~measurements", offline=True)
    rows = page.get_by_role("row").filter(has_text="tracking error")
    expect(rows).to_have_count(3)
    page.get_by_role("button", name=re.compile("^Value")).click()
    expect(rows.first).to_contain_text("joint 1")
    page.get_by_role("button", name=re.compile("^Value")).click()
    expect(rows.first).to_contain_text("joint 3")
    page.get_by_role("searchbox").first.fill("joint 2")
    expect(rows).to_have_count(1)
    shoot(page, "archive-measurements")


def test_the_log_is_filtered(finished: Any, visit: Any, shoot: Callable[..., None]):
    """The log can be filtered by words, severity and source."""
    page = visit(f"{finished.address}#~log", offline=True)
    log = page.get_by_role("listbox", name="Log")
    log.press("End")
    expect(log.get_by_text("the run has ended: failed")).to_be_visible()
    page.get_by_role("searchbox", name="Filter log").fill("three joints")
    expect(log.get_by_role("option")).to_have_count(1)
    page.get_by_role("searchbox", name="Filter log").fill("")
    page.get_by_label("Source").select_option(label="fixtures")
    expect(log.get_by_text("three joints")).to_have_count(0)
    expect(log.get_by_text("ready").first).to_be_visible()
    shoot(page, "archive-log")


def test_the_environment_is_in_it(finished: Any, visit: Any, shoot: Callable[..., None]):
    """The page shows robot, station and versions."""
    page = visit(f"{finished.address}#~environment", offline=True)
    view = page.get_by_role("region", name="Environment", exact=True)
    for fact in ("icubSim", "bench", "python"):
        expect(view).to_contain_text(re.compile(fact, re.IGNORECASE))
    shoot(page, "archive-environment")


def test_it_is_compared_with_an_earlier_run(finished: Any, visit: Any, shoot: Callable[..., None]):
    """The comparison begins with the measurement that became worse, with both values."""
    page = visit(f"{finished.address}#~compare", offline=True)
    view = page.get_by_role("region", name="Comparison", exact=True)
    expect(view).to_contain_text("joint 3")
    expect(view).to_contain_text("1.4")
    expect(view).to_contain_text("1.7")
    shoot(page, "archive-compare")


def test_trends_of_all_runs_are_in_it(finished: Any, visit: Any, shoot: Callable[..., None]):
    """The page shows the trend of each measurement over the history."""
    page = visit(f"{finished.address}#~trends", offline=True)
    view = page.get_by_role("region", name="Trends", exact=True)
    expect(view).to_contain_text("tracking error")
    expect(view).to_contain_text("joint 3")
    shoot(page, "archive-trends")


def test_the_trend_of_several_robots_has_a_line_for_each(tmp_path: Path, visit: Any, barriers: Any, shoot: Any):
    """Robots, and the units of a campaign, are lines with a legend; a table and the cursor name them, too."""
    robots = [f"bench-unit{run % 10}" for run in range(20)]
    runs = [{"run": f"r{run}", "started": 1e9 + run, "robot": robot, "station": ""} for run, robot in enumerate(robots)]
    points = [[run, 1.0 + run % 10, None, 20.0, "passed"] for run in range(20)]
    item = {"unit": "deg", "points": points, "drift": None, "pass_rate": [1.0, 0.8, 1.0]}
    found = {"runs": runs, "measurements": {"s/one\nelbow\nerror": item}, "tests": {}}
    events = [RunStarted(run="r", version="1"), SuitePlanned(suite="s", name="s")]
    archive = archive_of(put(tmp_path / "run", *numbered(events)), Extras(history=found))
    page = visit(f"{archive.as_uri()}#~trends", offline=True)
    view = page.get_by_role("region", name="Trends", exact=True)
    expect(view).to_contain_text("10 robots")
    view.get_by_role("button", name="plot error").click()
    expect(view.get_by_role("list", name="robots").get_by_role("listitem")).to_have_count(10)
    expect(view.get_by_role("list", name="robots")).to_contain_text("bench-unit9")
    shoot(page, "trends-of-robots")
    assert barriers(page) == []


@pytest.mark.parametrize(("locale", "word"), [("de-DE", "Messwerte"), ("it-IT", "Misure"), ("fr-FR", "Measurements")])
def test_it_speaks_the_language_of_its_reader(finished: Any, visit: Any, locale: str, word: str):
    """The page is in German or Italian for readers of these languages, else in English."""
    page = visit(finished.address, offline=True, locale=locale)
    expect(page.get_by_role("link", name=word)).to_be_visible()


def test_a_run_that_was_killed_is_shown_as_such(tmp_path: Path, visit: Any, shoot: Callable[..., None]):
    """A killed run is shown without a verdict, and its running test as interrupted."""
    events = [
        RunStarted(run="r", version="1"),
        SuitePlanned(suite="s", name="s"),
        TestPlanned(test="s/one", suite="s", name="one"),
        TestPlanned(test="s/two", suite="s", name="two"),
        TestStarted(test="s/one"),
    ]
    page = visit(archive_of(put(tmp_path / "run", *numbered(events))).as_uri(), offline=True)
    expect(page.get_by_role("heading", level=1)).to_have_text("did not end")
    expect(page.get_by_text("is being stopped")).to_have_count(0)
    expect(state_of(page, "one")).to_contain_text("interrupted")
    shoot(page, "archive-killed")


def test_a_fault_that_was_injected_stands_in_the_heading(tmp_path: Path, visit: Any):
    """The heading of a test has its injected fault, as text."""
    fault = {"name": "inject", "value": '"crash <b>- delay=1"', "unit": "", "source": "--set"}
    events = [
        RunStarted(run="r", version="1"),
        SuitePlanned(suite="s", name="s"),
        TestPlanned(test="s/one", suite="s", name="one"),
        TestPlanned(test="s/two", suite="s", name="two"),
        TestStarted(test="s/one"),
        ParametersResolved(test="s/one", parameters=(fault,)),
        TestStarted(test="s/two"),
        ParametersResolved(test="s/two", parameters=(fault | {"value": '""'},)),
    ]
    page = visit(f"{archive_of(put(tmp_path / 'run', *numbered(events))).as_uri()}#s/one", offline=True)
    heading = page.get_by_role("region", name="Details").locator("header").first
    expect(heading).to_contain_text("fault injected: crash <b>- delay=1")
    state_of(page, "two").click()
    expect(heading.get_by_role("heading", name="two", exact=True)).to_be_visible()
    expect(heading.get_by_text("fault injected")).to_be_hidden()


def test_what_was_too_large_is_said(tmp_path: Path, visit: Any):
    """An attachment that is too large is named, with the reason."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "large.bin").write_bytes(bytes(3 << 20))
    events = [
        RunStarted(run="r", version="1"),
        SuitePlanned(suite="s", name="s"),
        TestPlanned(test="s/one", suite="s", name="one"),
        TestStarted(test="s/one"),
        Attached(test="s/one", name="large.bin", path="large.bin", size=3 << 20),
    ]
    page = visit(f"{archive_of(put(folder, *numbered(events))).as_uri()}#s/one", offline=True)
    item = page.get_by_role("region", name="Details").get_by_role("listitem").filter(has_text="large.bin")
    expect(item).to_contain_text("not in this page: larger than 2 MiB")


def test_the_cases_of_a_program_are_shown_below_it(tmp_path: Path, visit: Any):
    """Cases are listed as tests after their program, and in its details."""
    write_files(
        tmp_path,
        {
            "s.xml": '<suite name="s"><test>p.sh</test><test>q.sh</test></suite>',
            "p.sh": "#!/bin/sh\necho 1..2; echo ok 1 - moves; echo not ok 2 - '<b>stops</b>'\n",
            "q.sh": "#!/bin/sh\necho 1..1; echo ok 1 - turns\n",
        },
    )
    run_command(tmp_path, "s.xml", "--html", "r.html")
    page = visit((tmp_path / "r.html").as_uri(), offline=True)
    page.get_by_role("combobox").select_option("plan")
    rows = list_of_tests(page).locator(".row-name")
    expect(rows).to_have_text(["s", "p", "p::moves", "p::<b>stops</b>", "q", "q::turns"])
    expect(state_of(page, "p")).to_contain_text("2 cases")
    page.goto(f"{(tmp_path / 'r.html').as_uri()}#s/p")
    detail = page.get_by_role("region", name="Details")
    expect(detail.locator(".verdict-line")).to_contain_text("passed")
    detail.get_by_role("link", name="<b>stops</b>").click()
    expect(detail.get_by_role("heading", name="p::<b>stops</b>")).to_be_visible()
    expect(detail.locator(".verdict-line")).to_contain_text("failed")
    detail.get_by_role("link", name="s/p", exact=True).click()
    expect(detail.get_by_role("heading", name="p", exact=True)).to_be_visible()
