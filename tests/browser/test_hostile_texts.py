"""Hostile texts in every field of every event are shown as text."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect

from archives import archive_of, numbered, put
from hostile import hostile_run, long_run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Page

    from rtf.testing.events import Event

#: The browser's messages about the files of hostile paths, which do not exist.
MISSING = re.compile(r"Failed to load resource.*(status of 40[04]|net::ERR_)")

VIEWS = ("#", "#~measurements", "#~fixtures", "#~log", "#~environment")

#: Elements that RTF's page does not have, so that they can only come from a text; pictures are counted apart.
_INJECTED = """() => {
  const found = [...document.querySelectorAll(
    "body script, iframe, object, embed, base, body style, body link, body meta, body svg script, [srcdoc]")];
  const leads = /^(href|src|action|formaction|xlink:href)$/;
  for (const element of document.querySelectorAll("*")) {
    for (const { name, value } of element.attributes) {
      if (name.startsWith("on")) found.push(element);
      if (leads.test(name) && /^\\s*(javascript|vbscript|data:text)/i.test(value)) found.push(element);
    }
  }
  for (const picture of document.images) if (picture.getAttribute("src") === "x") found.push(picture);
  return found.map((element) => element.outerHTML.slice(0, 200));
}"""


@pytest.fixture(params=["archived", "live"])
def opened(request: pytest.FixtureRequest, tmp_path: Path, visit: Any, served: Any) -> Callable[..., Page]:
    """Opens the page of a run with these events, as a file and from the server."""

    def open_page(events: Iterator[Event]) -> Page:
        folder = put(tmp_path / "run", *numbered(events))
        if request.param == "archived":
            page = visit(archive_of(folder).as_uri(), offline=True)
        else:
            page = visit(served(folder).address, expected=MISSING)
        expect(page.get_by_role("heading", level=1)).to_have_text("failed")
        return page

    return open_page


def go(page: Page, hash_: str) -> None:
    """Go to a place of the page, and wait until it is drawn."""
    page.evaluate("(hash) => { location.hash = hash; }", hash_)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_texts_stay_texts(opened: Callable[..., Page], shoot: Callable[..., None], request: pytest.FixtureRequest):
    """No text is injected as markup or script in any view, and the page works."""
    page = opened(hostile_run())
    for view in VIEWS:
        go(page, view)
        assert page.evaluate(_INJECTED) == []
        shoot(page, f"hostile-{request.node.callspec.id}-{view.strip('#~') or 'tests'}")
    go(page, "#")
    tests = page.get_by_role("listbox", name="Tests")
    planned = {event.test for event in hostile_run() if event.kind == "test_planned"}
    planned -= {test for event in hostile_run() if event.kind == "plan_changed" for test in event.removed}
    expect(tests.get_by_role("option").first).to_have_attribute("aria-setsize", str(len(planned)))
    page.keyboard.press("Home")
    for place in range(1, len(planned) + 1):
        expect(tests.locator("[aria-selected=true]")).to_have_attribute("aria-posinset", str(place))
        page.keyboard.press("Enter")
        expect(page.get_by_role("region", name="Details").get_by_role("heading", level=2)).to_have_count(1)
        assert page.evaluate(_INJECTED) == []
        page.keyboard.press("j")
    shoot(page, f"hostile-{request.node.callspec.id}-test")
    page.keyboard.press("/")
    page.keyboard.type("<script>alert(1)")
    expect(tests.get_by_role("option").first).to_contain_text("<script>alert(1)</script>")
    assert page.evaluate("() => Object.prototype.toString.call({}.polluted)") == "[object Undefined]"


def test_long_lines_do_no_harm(opened: Callable[..., Page], shoot: Callable[..., None], request: pytest.FixtureRequest):
    """With a megabyte in every field each view opens and fits, and keys work."""
    page = opened(long_run())
    for view in (*VIEWS, "#s/t", "#s"):
        go(page, view)
        width = page.evaluate("() => [document.documentElement.scrollWidth, innerWidth]")
        assert width[0] <= width[1]
        shoot(page, f"long-{request.node.callspec.id}-{view.strip('#~').replace('/', '-') or 'tests'}")
    page.keyboard.press("/")
    page.keyboard.type("nothing of that kind")
    expect(page.get_by_text("No test matches.")).to_be_visible()
