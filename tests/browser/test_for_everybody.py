"""Accessibility: keyboard, tablet and phone, dark mode, screen readers and print."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect

if TYPE_CHECKING:
    from collections.abc import Callable

    from playwright.sync_api import Page

VIEWS = {
    "tests": "#",
    "test": "#bench/measure",
    "crash": "#bench/crash",
    "part": "#bench/measure/joint%203",
    "suite": "#bench",
    "measurements": "#~measurements",
    "fixtures": "#~fixtures",
    "log": "#~log",
    "environment": "#~environment",
    "compare": "#~compare",
    "trends": "#~trends",
}
PHONE = {"width": 390, "height": 844}
TABLET = {"width": 1024, "height": 768}


def go(page: Page, hash_: str) -> None:
    """Go to a place of the page, and wait until it is drawn."""
    page.evaluate("(hash) => { location.hash = hash; }", hash_)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.wait_for_load_state()


@pytest.mark.parametrize(("live", "dark"), [(False, False), (True, True)], ids=["archived-light", "live-dark"])
def test_every_view_is_accessible(
    finished: Any, visit: Any, served: Any, barriers: Any, shoot: Callable[..., None], *, dark: bool, live: bool
):
    """axe-core finds no violation in any view. The archived page and the live one have the same views and colours."""
    if live:
        arguments = ("--compare", str(finished.earlier), "--history", str(finished.folder / "history.sqlite"))
        page = visit(served(finished.run, *arguments).address, dark=dark)
    else:
        page = visit(finished.address, offline=True, dark=dark)
    expect(page.get_by_role("heading", level=1)).to_have_text("failed")
    found = []
    for name, place in {**VIEWS, **({"operator": "#~operator"} if live else {})}.items():
        go(page, place)
        found += [f"{name}: {barrier}" for barrier in barriers(page)]
        shoot(page, f"view-{name}-{'live' if live else 'archived'}-{'dark' if dark else 'light'}")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    found += [f"keys: {barrier}" for barrier in barriers(page)]
    assert found == []


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_operators_parts_are_accessible(
    live_run: Any, visit: Any, barriers: Any, shoot: Callable[..., None], *, dark: bool
):
    """axe-core finds no violation in questions and in the stop dialog."""
    run = live_run('<test name="ask" fixtures="">ask.py</test>')
    page = visit(run.address, dark=dark, viewport=TABLET)
    expect(page.get_by_role("region", name="Question").get_by_role("button", name="Yes")).to_be_visible()
    found = barriers(page)
    shoot(page, f"question-{'dark' if dark else 'light'}")
    go(page, "#~operator")
    found += barriers(page)
    shoot(page, f"operator-{'dark' if dark else 'light'}")
    page.keyboard.press("s")
    expect(page.get_by_role("dialog")).to_be_visible()
    found += barriers(page)
    shoot(page, f"stop-{'dark' if dark else 'light'}")
    assert found == []


@pytest.mark.parametrize(("name", "viewport"), [("phone", PHONE), ("tablet", TABLET)])
def test_it_fits(finished: Any, visit: Any, shoot: Callable[..., None], name: str, viewport: Any):
    """No view is wider than the screen of a phone or tablet."""
    page = visit(finished.address, offline=True, viewport=viewport, has_touch=True, is_mobile=name == "phone")
    expect(page.get_by_role("heading", level=1)).to_have_text("failed")
    wide = []
    for view, place in VIEWS.items():
        go(page, place)
        shoot(page, f"{name}-{view}")
        width = page.evaluate("() => document.documentElement.scrollWidth")
        if width > viewport["width"]:
            wide.append((view, width))
    assert wide == []


def test_fingers_find_what_they_press(finished: Any, visit: Any):
    """On a touch screen controls have at least 24 pixels, rows of the list 44."""
    page = visit(finished.address, offline=True, viewport=TABLET, has_touch=True)
    rows = page.get_by_role("listbox", name="Tests").get_by_role("option")
    expect(rows.first).to_be_visible()
    assert rows.first.bounding_box()["height"] >= 44
    small = page.evaluate(
        """() => [...document.querySelectorAll("button, nav a, select, input")]
          .filter((one) => one.checkVisibility())
          .map((one) => [one.textContent || one.tagName, one.getBoundingClientRect()])
          .filter(([, box]) => box.height < 24 || box.width < 24)
          .map(([name, box]) => `${name} ${box.width}x${box.height}`)"""
    )
    assert small == []


def selected(page: Page) -> Any:
    """Return the selected test."""
    return page.get_by_role("listbox", name="Tests").locator("[aria-selected=true]")


def test_the_keyboard_is_enough(finished: Any, visit: Any, shoot: Callable[..., None]):
    """Keys move, open, filter and go back; the stop key does nothing in an archived page."""
    page = visit(finished.address, offline=True)
    tests = page.get_by_role("listbox", name="Tests")
    detail = page.get_by_role("region", name="Details")
    expect(tests.get_by_role("option")).to_have_count(7)
    page.keyboard.press("j")
    expect(selected(page)).to_contain_text("measure")
    page.keyboard.press("j")
    expect(selected(page)).to_contain_text("crash")
    page.keyboard.press("k")
    page.keyboard.press("Enter")
    expect(detail.get_by_role("heading", name="measure", exact=True)).to_be_visible()
    assert page.url.endswith("#bench/measure")
    page.keyboard.press("f")
    expect(tests.get_by_role("option")).to_have_count(3)
    shoot(page, "keyboard-failures")
    page.keyboard.press("f")
    expect(tests.get_by_role("option")).to_have_count(7)
    page.keyboard.press("/")
    page.keyboard.type("flaky")
    expect(tests.get_by_role("option")).to_have_count(1)
    page.keyboard.press("Escape")
    expect(tests.get_by_role("option")).to_have_count(7)
    page.keyboard.press("Escape")
    page.keyboard.press("End")
    expect(selected(page)).to_have_attribute("aria-posinset", "7")
    page.keyboard.press("s")
    expect(page.get_by_role("dialog")).to_have_count(0)


def test_the_focus_goes_everywhere_and_is_seen(finished: Any, visit: Any):
    """Tab reaches views, filter, list and details in order, with a visible focus."""
    page = visit(f"{finished.address}#bench/measure", offline=True)
    expect(page.locator("canvas").first).to_be_visible()
    reached: list[str] = []
    unseen: list[str] = []
    for _ in range(60):
        page.keyboard.press("Tab")
        what, outlined = page.evaluate(
            """() => {
              const element = document.activeElement;
              const style = getComputedStyle(element);
              const name = element.getAttribute("aria-label") ?? element.textContent;
              return [`${element.tagName} ${name.trim().slice(0, 40)}`,
                style.outlineStyle !== "none" || style.boxShadow !== "none" || element === document.body];
            }"""
        )
        reached.append(what)
        if not outlined:
            unseen.append(what)
    order = ["A Log", "INPUT Filter tests", "DIV Tests", "DIV Details"]
    places = [next(index for index, what in enumerate(reached) if what.startswith(name)) for name in order]
    assert places == sorted(places)
    assert "A Tests" in reached
    assert unseen == []


def test_a_live_region_reports_the_end(live_run: Any, visit: Any):
    """The page has landmarks, and a live region that reports failures and the end."""
    run = live_run('<test name="gate" fixtures="">gate.py</test><test name="flaky" fixtures="">flaky.py</test>')
    page = visit(run.address)
    for landmark in ("banner", "navigation", "main"):
        expect(page.get_by_role(landmark)).to_have_count(1)
    (run.folder / "go").touch()
    expect(page.get_by_role("status").filter(has_text=re.compile("flaky: failed|has ended: failed"))).to_have_count(1)
    run.wait()


def test_it_can_be_printed(finished: Any, visit: Any, shoot: Callable[..., None]):
    """In print the page has the verdict and every test, without controls."""
    page = visit(finished.address, offline=True)
    expect(page.get_by_role("heading", level=1)).to_have_text("failed")
    page.emulate_media(media="print")
    page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    expect(page.get_by_role("searchbox").locator("visible=true")).to_have_count(0)
    lines = page.get_by_role("table", name="All tests").get_by_role("row")
    expect(lines).to_have_count(7)
    expect(lines.filter(has_text="bench/hang")).to_contain_text("did not end within")
    shoot(page, "print")
