"""The page of a log in a real browser: it follows the file, pauses, filters, shows a record, and needs no mouse."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect

from rtf import clock
from rtf.logs import store
from rtf.logs.record import Level, LogRecord
from rtf.logs.store import LogStore
from rtf.page.log_page import serve_log
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Locator, Page, Request

HOSTILE = "<img/src=x/onerror=alert(1)> \u202e&amp; \x1b[31m"
#: The rows that the list of a screen may have, and the records that the page may keep.
FEW_ROWS, MOST_KEPT = 120, 5000


class Log:
    """A log that a test writes, and the address of its page."""

    def __init__(self, opened: LogStore, address: str) -> None:
        self._store = opened
        self.file = opened.path
        self.address = address

    def write(self, *messages: str, level: Level = Level.INFO, sender: str = "/log/pc/arm/7") -> None:
        """Add records that are made now."""
        now = clock.now()
        records = [LogRecord(sender, level, now, message, "lab.arm") for message in messages]
        self._store.add([(now, record) for record in records])


@pytest.fixture
def log(tmp_path: Path) -> Iterator[Log]:
    """An empty log with its page."""
    with (
        LogStore(tmp_path / "logs.sqlite") as opened,
        serve_log(tmp_path / "logs.sqlite", "127.0.0.1", 0) as address,
    ):
        yield Log(opened, address)


def rows(page: Page) -> Locator:
    """Return the visible records."""
    return page.locator(".row:not([hidden])")


def test_it_follows_pauses_and_goes_on(log: Log, visit: Any):
    """New records appear by themselves, but not while it is paused; hostile texts are texts."""
    page = visit(log.address)
    page.clock.install()
    page.reload()
    expect(page.get_by_text("Nothing was logged yet.")).to_be_visible()
    log.write("hello", HOSTILE)
    expect(rows(page)).to_have_count(2)
    expect(rows(page).filter(has_text="<img/src=x/onerror=alert(1)>")).to_have_count(1)
    assert page.locator("img").count() == 0
    expect(page.get_by_role("status")).to_have_text("following")
    underway: set[Request] = set()
    asked: list[str] = []

    def begun(request: Request) -> None:
        underway.add(request)
        asked.append(request.url)

    def finished(request: Request) -> None:
        underway.discard(request)

    page.on("request", begun)
    page.on("requestfinished", finished)
    page.clock.pause_at(clock.now() + 3600)
    page.get_by_role("button", name="follow").click()
    expect(page.get_by_role("status")).to_have_text("paused")
    eventually(lambda: page.evaluate("() => true") and not underway, "a request is not answered", limit=30)
    log.write(*(f"line {number}" for number in range(2000)))
    asked.clear()
    page.clock.run_for(60_000)
    page.evaluate("() => fetch('facts')")
    assert asked == [f"{log.address}facts"]
    page.clock.resume()
    with page.expect_response("**/records?*"):
        page.get_by_role("button", name="follow").click()
    expect(rows(page).filter(has_text="line 1999")).to_be_visible()
    expect(page.get_by_text("2,002 records in the file")).to_be_visible()
    log.write("the last one")
    expect(rows(page).filter(has_text="the last one")).to_be_visible()


def test_filters_and_a_record(log: Log, visit: Any):
    """Filters are those of ``rtf log`` and survive a reload; a record is shown whole; messages fit on a phone."""
    log.write("warm")
    log.write("hot", level=Level.WARNING, sender="/log/pc/head/8")
    log.write("burning " + "x" * 1000 + " end", level=Level.ERROR)
    page = visit(log.address)
    expect(rows(page)).to_have_count(3)
    page.get_by_label("Level").select_option("warning")
    expect(rows(page)).to_have_count(2)
    page.get_by_label("Process").fill("arm")
    expect(rows(page)).to_have_count(1)
    page.reload()
    expect(rows(page)).to_have_count(1)
    rows(page).click()
    record = page.get_by_role("region", name="Record")
    expect(record).to_contain_text("burning")
    expect(record.get_by_text("x end")).to_be_visible()
    expect(record).to_contain_text("/log/pc/arm/7")
    page.get_by_role("button", name="clear").click()
    expect(rows(page)).to_have_count(3)
    page.set_viewport_size({"width": 390, "height": 844})
    box = rows(page).first.locator(".entry-text").bounding_box()
    assert box is not None
    assert box["width"] > 150
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390
    page.get_by_label("Text").fill("nothing like it")
    expect(page.get_by_text("No record matches.")).to_be_visible()


def test_a_record_that_was_removed(log: Log, visit: Any, unreachable: Any):
    """A full file loses its oldest records: one that is shown and gone is marked as gone, and the page goes on."""
    log.write("old", "young")
    page = visit(log.address, expected=unreachable)
    expect(rows(page)).to_have_count(2)
    with closing(sqlite3.connect(log.file)) as connection, connection:
        connection.execute("DELETE FROM records WHERE message = 'old'")
    rows(page).first.click()
    expect(page.get_by_role("region", name="Record")).to_contain_text(
        "there is no such record; it may have been removed"
    )
    log.write("new")
    expect(rows(page)).to_have_count(3)


def test_a_wrong_filter_is_explained(log: Log, visit: Any, unreachable: Any):
    """What the server refuses is shown, until the filter is another one."""
    log.write("one")
    page = visit(log.address, expected=unreachable)
    expect(rows(page)).to_have_count(1)
    page.get_by_label("Since").fill("yesterday")
    expect(page.get_by_role("alert")).to_contain_text("'yesterday' is no time; write how long ago, such as 10min")
    page.get_by_label("Since").fill("10min")
    expect(page.get_by_role("alert")).to_be_hidden()
    expect(rows(page)).to_have_count(1)


def test_a_large_log_through_a_window(log: Log, visit: Any, monkeypatch: pytest.MonkeyPatch):
    """From its end to its beginning by the keyboard and back: few rows, few records, none missing."""
    monkeypatch.setattr(store, "SCAN", 2000)
    for start in range(0, 20_000, 5000):
        log.write(*(f"line {number}." for number in range(start, start + 5000)))
    log.write("the needle", level=Level.FATAL)
    log.write(*(f"line {number}." for number in range(20_000, 25_000)))
    page = visit(log.address)
    expect(rows(page).filter(has_text="line 24999.")).to_be_visible()
    page.keyboard.press("g")
    expect(rows(page).filter(has_text="line 0.")).to_be_visible()
    expect(page.get_by_role("status")).to_have_text("paused")
    seen = page.evaluate(
        """async () => {
          const list = document.querySelector(".rows");
          const seen = new Set();
          let [most, kept] = [0, 0];
          for (let frame = 0; seen.size < 12000 && frame < 5000; frame += 1) {
            const texts = [...document.querySelectorAll(".row:not([hidden]) .entry-text")];
            const shown = texts.map((one) => parseInt(one.textContent.slice(5)));
            shown.forEach((number) => seen.add(number));
            [most, kept] = [Math.max(most, shown.length), Math.max(kept, list.scrollHeight / 26)];
            list.scrollTop += list.clientHeight;
            await new Promise(requestAnimationFrame);
          }
          return [seen.size, Math.max(...seen), most, kept];
        }"""
    )
    count, last, most, kept = seen
    assert count == last + 1 >= 12_000
    assert most < FEW_ROWS
    assert kept <= MOST_KEPT
    page.get_by_label("Level").select_option("fatal")
    expect(rows(page)).to_have_count(1)
    expect(rows(page)).to_contain_text("the needle")


def test_the_keyboard_is_enough(log: Log, visit: Any):
    """Keys move, open, close, filter, pause, and go to both ends."""
    log.write(*(f"line {number}." for number in range(100)))
    page = visit(log.address)
    expect(rows(page).filter(has_text="line 99.")).to_be_visible()
    page.keyboard.press("k")
    expect(page.locator(".row[aria-selected=true]")).to_contain_text("line 99.")
    page.keyboard.press("k")
    page.keyboard.press("Enter")
    expect(page.get_by_role("region", name="Record")).to_contain_text("line 98.")
    page.keyboard.press("Escape")
    expect(page.get_by_role("region", name="Record")).to_be_hidden()
    page.keyboard.press("f")
    expect(page.get_by_role("status")).to_have_text("paused")
    page.keyboard.press("Home")
    expect(page.locator(".row[aria-selected=true]")).to_contain_text("line 0.")
    page.keyboard.press("/")
    page.keyboard.type("line 42.")
    expect(rows(page)).to_have_count(1)
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.keyboard.press("G")
    expect(rows(page).filter(has_text="line 99.")).to_be_visible()
    expect(page.get_by_role("status")).to_have_text("following")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_it_is_accessible(log: Log, visit: Any, barriers: Any, shoot: Any, *, dark: bool):
    """axe-core finds no violation: empty, with records of every level, with an open record."""
    page = visit(log.address, dark=dark)
    expect(page.get_by_text("Nothing was logged yet.")).to_be_visible()
    found = barriers(page)
    for level in Level:
        log.write(f"a record of {level.name}", level=level)
    expect(rows(page)).to_have_count(len(Level))
    rows(page).last.click()
    expect(page.get_by_role("region", name="Record")).to_be_visible()
    found += barriers(page)
    shoot(page, f"log-page-{'dark' if dark else 'light'}")
    assert found == []
