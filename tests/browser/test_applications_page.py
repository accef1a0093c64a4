"""The page of applications in a real browser: built by mouse and by keyboard, saved, run and stopped."""

from __future__ import annotations

import re
import threading
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect

from lab import LabFactory
from rtf.applications.page.control import ControlledApplication
from rtf.applications.page.web import serve_applications
from rtf.bottle import Bottle
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Locator, Page

EMPTY = "<application><name>lab</name><!-- ours --></application>"
VOICE = (
    "<module><name>tail</name><data><output><type>Bottle</type><port>/voice/out</port></output></data>"
    "<arguments><switch>f</switch></arguments></module>"
)
EARS = (
    "<module><name>sleep</name><data><input><type>Bottle</type><port>/ears/in</port><required>yes</required></input>"
    "</data></module>"
)
HOSTILE = "<img/src=x/onerror=alert(1)> \u202e&amp;"
MESSAGE = Bottle(["x" * 1000])
ESCAPED = HOSTILE.replace("&", "&amp;").replace("<", "&lt;")
MISSING = "nothing is connected to /ears/in, which sleep requires"


class Lab:
    """The page of an application, and its file."""

    def __init__(self, file: Path, address: str) -> None:
        self.file = file
        self.address = address


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Callable[[str], Lab]]:
    """Serves an application with this content, beside the descriptions of two programs."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "tail.xml").write_text(VOICE)
    (tmp_path / "modules" / "sleep.xml").write_text(EARS)
    opened: list[Any] = []

    def serve(content: str, network: Network | None = None) -> Lab:
        file = tmp_path / "lab.xml"
        file.write_text(content)
        controlled = ControlledApplication(file, {}, LabFactory(tmp_path, network))
        serving = serve_applications([controlled], "127.0.0.1", 0, "the-token")
        opened.append((serving, controlled))
        return Lab(file, serving.__enter__())

    yield serve
    for serving, controlled in opened:
        with closing(controlled):
            serving.__exit__(None, None, None)


def box(page: Page, title: str) -> Locator:
    """Return the box of a module."""
    return page.locator("[data-box]").filter(has_text=title)


def middle(part: Locator) -> tuple[float, float]:
    """Return the middle of an element on the screen."""
    area = part.bounding_box()
    assert area is not None
    return area["x"] + area["width"] / 2, area["y"] + area["height"] / 2


def drag(page: Page, start: Locator, end: tuple[float, float]) -> None:
    """Drag with the mouse."""
    page.mouse.move(*middle(start))
    page.mouse.down()
    page.mouse.move(end[0] - 20, end[1] - 10, steps=2)
    page.mouse.move(*end)
    page.mouse.up()


def state(page: Page, title: str) -> Locator:
    """Return the state of a module in the list."""
    return page.get_by_role("table", name="Modules").get_by_role("row").filter(has_text=title).locator(".badge")


def test_an_application_is_built_by_mouse(lab: Callable[[str], Lab], visit: Any, shoot: Callable[..., None]):
    """Programs of the palette are added, placed and connected; problems are marked; it is saved, run and stopped."""
    served = lab(EMPTY)
    page = visit(served.address)
    for program, parameters in (("tail", "-f /dev/null"), ("sleep", "60")):
        page.get_by_role("button", name="Add program").click()
        dialog = page.get_by_role("dialog", name="Add a program")
        dialog.get_by_role("option", name=program).click()
        dialog.get_by_label("Parameters").fill(parameters)
        dialog.get_by_role("button", name="Add").click()
        expect(box(page, program).locator("[data-port]")).to_have_count(1)
    expect(box(page, "sleep")).to_have_attribute("data-problem", "error")
    expect(page.get_by_role("complementary", name="Properties").get_by_text(MISSING)).to_be_visible()
    x, y = middle(box(page, "sleep").locator(".name"))
    drag(page, box(page, "sleep").locator(".name"), (x + 280, y - 150))
    drag(page, page.locator('[data-port="/voice/out"] circle'), middle(page.locator('[data-port="/ears/in"] path')))
    expect(box(page, "sleep")).not_to_have_attribute("data-problem", "error")
    page.get_by_role("button", name="Undo").click()
    expect(box(page, "sleep")).to_have_attribute("data-problem", "error")
    page.get_by_role("button", name="Redo").click()
    expect(box(page, "sleep")).not_to_have_attribute("data-problem", "error")
    shoot(page, "applications-built")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("button", name="Save")).to_be_disabled()
    text = served.file.read_text()
    assert "<!-- ours -->" in text
    assert text.count("<geometry>(Pos (x ") == 2
    assert "<from>/voice/out</from>\n        <to>/ears/in</to>" in text
    page.get_by_role("button", name="Run all").click()
    expect(state(page, "tail")).to_have_text("✓running")
    expect(state(page, "sleep")).to_have_text("✓running")
    page.get_by_role("button", name="Stop all").click()
    expect(state(page, "sleep")).to_have_text("\N{EN DASH}stopped")
    page.get_by_role("tab", name="What happened").click()
    expect(page.get_by_text("sleep 60 is stopped")).to_be_visible()


def add_by_keyboard(page: Page, program: str, parameters: str) -> None:
    """Add a program."""
    page.get_by_role("region", name="Graph", exact=True).press("a")
    page.keyboard.type(program)
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.type(parameters)
    page.keyboard.press("Enter")
    expect(box(page, program).locator("[data-port]")).to_have_count(1)


def test_an_application_is_built_by_keyboard(lab: Callable[[str], Lab], visit: Any):
    """All that the mouse does has a key, and screen readers are told what it did."""
    served = lab(EMPTY)
    page = visit(served.address)
    graph = page.get_by_role("region", name="Graph", exact=True)
    keys = page.keyboard
    expect(page.get_by_role("button", name="Add program")).to_be_enabled()
    for program, parameters in (("tail", "-f /dev/null"), ("sleep", "60")):
        add_by_keyboard(page, program, parameters)
    graph.focus()
    keys.press("ArrowUp")
    expect(box(page, "tail")).to_have_attribute("data-selected", "yes")
    before = middle(box(page, "tail"))
    keys.press("Shift+ArrowLeft")
    assert middle(box(page, "tail"))[0] == pytest.approx(before[0] - 20, abs=1)
    keys.press("c")
    expect(page.get_by_role("dialog").get_by_label("From")).to_have_value("/voice/out")
    page.get_by_role("dialog").get_by_label("To", exact=True).press_sequentially("/ears/in")
    keys.press("Enter")
    expect(page.get_by_text("connected /voice/out to /ears/in")).to_be_attached()
    graph.focus()
    keys.press("ArrowDown")
    keys.press("Enter")
    expect(page.get_by_label("Program", exact=True)).to_be_focused()
    keys.press("Tab")
    keys.press("ControlOrMeta+a")
    with page.expect_response("**/check"):
        keys.type("61")
        keys.press("Tab")
        keys.type("local")
    keys.type("host")
    keys.press("Control+s")
    expect(page.get_by_role("button", name="Save")).to_be_disabled()
    assert "<parameters>61</parameters>\n        <node>localhost</node>" in served.file.read_text()
    page.get_by_role("checkbox", name="select sleep").focus()
    keys.press("Space")
    page.get_by_role("button", name="Run 1").press("Enter")
    expect(state(page, "sleep")).to_have_text("✓running")
    expect(state(page, "tail")).to_have_text("\N{EN DASH}stopped")
    page.get_by_role("button", name="Kill 1").press("Enter")
    expect(state(page, "sleep")).to_have_text("\N{EN DASH}stopped")
    graph.focus()
    keys.press("Delete")
    expect(box(page, "sleep")).to_have_count(0)
    keys.press("Control+z")
    expect(box(page, "sleep")).to_have_count(1)


def test_dependencies_are_edited(lab: Callable[..., Lab], visit: Any):
    """A port that is dropped on a program is waited for; there is a key for it, and conditions are edited."""
    content = "<module><name>{}</name><parameters>{}</parameters></module>"
    both = content.format("tail", "-f /dev/null") + content.format("sleep", "60")
    served = lab(f"<application><name>lab</name>{both}</application>")
    page = visit(served.address)
    properties = page.get_by_role("complementary", name="Properties")
    drag(page, page.locator('[data-port="/voice/out"] circle'), middle(box(page, "sleep").locator(".name")))
    group = properties.get_by_role("group", name="/voice/out")
    group.get_by_label("Timeout").fill("20")
    group.get_by_label("Reply").fill("[ok]")
    page.get_by_role("region", name="Graph", exact=True).press("w")
    page.keyboard.type("/server")
    page.keyboard.press("Enter")
    expect(properties.get_by_role("group")).to_have_count(2)
    page.keyboard.press("Control+s")
    expect(page.get_by_role("button", name="Save")).to_be_disabled()
    assert '<port timeout="20" reply="[ok]">/voice/out</port>' in served.file.read_text()
    assert "<port>/server</port>" in served.file.read_text()
    page.get_by_role("button", name="sleep", exact=True).click()
    properties.get_by_role("button", name="wait no more for /server").click()
    expect(properties.get_by_role("group")).to_have_count(1)


def test_rates_are_live(lab: Callable[..., Lab], visit: Any):
    """The list of connections has what comes by each, and so have the properties of one."""
    network = Network(LocalNames())
    content = "<connection><from external='true'>/a</from><to external='true'>/b</to></connection>"
    with Port("/a", network=network) as source, BufferedPort("/b", network=network):
        source.add_output("/b", "tcp")
        page = visit(lab(f"<application><name>lab</name>{content}</application>", network).address)
        page.get_by_role("tab", name="Connections").click()
        row = page.get_by_role("table", name="Connections").get_by_role("row").filter(has_text="/a")
        expect(row).to_contain_text("0.0 /s, 0.0 KiB/s")
        done = threading.Event()
        writer = threading.Thread(target=lambda: [source.write(MESSAGE) for _ in iter(lambda: done.wait(0.01), True)])
        writer.start()
        expect(row).to_contain_text(re.compile(r"[1-9][0-9]*\.[0-9] /s, [1-9][0-9]*\.[0-9] KiB/s"))
        done.set()
        writer.join()
        row.get_by_role("button").click()
        expect(page.get_by_role("complementary", name="Properties")).to_contain_text("KiB/s")


def test_embedded_applications_are_run_and_not_edited(lab: Callable[[str], Lab], visit: Any, tmp_path: Path):
    """Their boxes have states, too; what is theirs cannot be changed or removed here."""
    (tmp_path / "inner.xml").write_text(
        "<application><name>inner</name><module><name>sleep</name><parameters>60</parameters></module>"
        "<connection><from>/a</from><to>/ears/in</to></connection></application>"
    )
    inner = "<application><name>inner.xml</name></application>"
    page = visit(lab(f"<application><name>lab</name>{inner}</application>").address)
    page.get_by_role("button", name="sleep", exact=True).click()
    properties = page.get_by_role("complementary", name="Properties")
    expect(properties.get_by_text("inner.xml")).to_be_visible()
    expect(properties.get_by_role("textbox")).to_have_count(0)
    page.get_by_role("button", name="Run 1").click()
    expect(box(page, "sleep 60")).to_have_attribute("data-tone", "good")
    page.get_by_role("region", name="Graph", exact=True).press("Delete")
    expect(page.get_by_role("button", name="Undo")).to_be_disabled()
    expect(box(page, "sleep 60")).to_have_count(1)


def test_hostile_names_are_texts(lab: Callable[[str], Lab], visit: Any):
    """Names of programs, nodes and ports, and what programs write, are never markup."""
    content = (
        f"<application><name>{ESCAPED}</name><description>{ESCAPED}</description><module><name>sh</name>"
        f"<parameters>-c \"echo '{ESCAPED}'; sleep 60\"</parameters></module><module><name>{ESCAPED}</name>"
        f"<node>{ESCAPED}</node></module><connection><from>/a{ESCAPED.replace(' ', '')}</from><to>/b</to></connection>"
        "</application>"
    )
    page = visit(lab(content).address)
    expect(page.get_by_role("complementary", name="Properties").get_by_role("heading")).to_contain_text("<img/src=x")
    expect(page.locator("[data-box] .name").filter(has_text="onerror=alert(1)")).to_have_count(1)
    page.get_by_role("checkbox", name="select sh").check()
    page.get_by_role("button", name="Run 1").click()
    expect(page.get_by_role("region", name="Output")).to_contain_text("<img/src=x/onerror=alert(1)>")
    for name in ("Connections", "Nodes", "Problems", "What happened"):
        page.get_by_role("tab", name=name).click()
        expect(page.get_by_role("tabpanel", name=name)).to_contain_text("<img/src=x")
    assert page.locator("img").count() == 0


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_page_is_accessible(lab: Callable[[str], Lab], visit: Any, barriers: Any, shoot: Any, *, dark: bool):
    """axe-core finds no violation: with problems, a selection, each list and each dialog."""
    content = (
        "<application><name>lab</name><module><name>tail</name><node>pc1</node></module><module><name>sleep</name>"
        "<dependencies><port>/x</port></dependencies></module><connection><from>/voice/out</from><to>/gaze/in</to><protocol>typ</protocol></connection></application>"
    )
    page = visit(lab(content).address, dark=dark)
    page.get_by_role("button", name="sleep", exact=True).click()
    page.get_by_role("button", name="Wait for a port").click()
    found = [f"dependency: {barrier}" for barrier in barriers(page)]
    page.keyboard.press("Escape")
    for name in ("What happened", "Nodes", "Connections", "Modules", "Problems"):
        page.get_by_role("tab", name=name).click()
        found += [f"{name}: {barrier}" for barrier in barriers(page)]
    page.get_by_role("button", name="show where").first.click()
    shoot(page, f"applications-{'dark' if dark else 'light'}")
    for button in ("Add program", "Add connection"):
        page.get_by_role("button", name=button).click()
        found += [f"{button}: {barrier}" for barrier in barriers(page)]
        page.keyboard.press("Escape")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="Keys")).to_be_visible()
    found += [f"keys: {barrier}" for barrier in barriers(page)]
    page.get_by_role("button", name="Close").click()
    assert found == []


def test_without_the_token_it_is_for_reading(lab: Callable[[str], Lab], visit: Any):
    """All is shown, and nothing can be changed."""
    page = visit(lab(EMPTY).address.partition("#")[0])
    expect(page.get_by_text("This page can only look")).to_be_visible()
    for name in ("Run all", "Kill all", "Disconnect all", "Add program", "Save"):
        expect(page.get_by_role("button", name=name).first).to_be_disabled()
