"""A real browser with real runs: an error that the browser reports fails the test."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect, sync_playwright

import bench
from harness import Command, run_command
from wire import Wire

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, Request

ROOT = Path(__file__).parents[2]
FLAGS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
)
#: Generous, for a busy machine; no test here measures time.
PATIENCE = 30_000
DESKTOP = {"width": 1366, "height": 768}
#: URLs that a page may request without a network.
INSIDE = frozenset({"data", "blob", "about"})
#: Chromium's message about an unreachable server; expected only where a test takes the network away.
UNREACHABLE = re.compile(r"net::ERR_|Failed to load resource|Failed to fetch")

expect.set_options(timeout=PATIENCE)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One browser for all tests of a process, with new profiles for each test."""
    path = os.environ.get("RTF_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.fail(
            "the page is tested in a real browser, and there is none: apt install chromium, or set RTF_CHROMIUM"
        )
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=path, args=[*FLAGS])
        yield launched
        launched.close()


@dataclass
class Visit:
    """An open page, and the errors that the browser has reported."""

    page: Page
    context: BrowserContext
    complaints: list[str] = field(default_factory=list)
    #: Messages that are expected, because the test itself took the network away.
    expected: re.Pattern[str] | None = None

    def unexpected(self) -> list[str]:
        """Return the reported errors that are not expected."""
        return [text for text in self.complaints if self.expected is None or not self.expected.search(text)]


class Visitor:
    """Opens pages, each in a new profile unless it is another tab."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self.visits: list[Visit] = []

    def __call__(
        self,
        address: str,
        *,
        viewport: dict[str, int] | None = None,
        dark: bool = False,
        locale: str = "en-GB",
        offline: bool = False,
        expected: re.Pattern[str] | None = None,
        **more: Any,
    ) -> Page:
        """Open an address in a new profile. With ``offline`` there is no network, and a request is an error."""
        context = self._browser.new_context(
            viewport=viewport or DESKTOP,  # type: ignore[arg-type]
            color_scheme="dark" if dark else "light",
            locale=locale,
            offline=offline,
            reduced_motion="reduce",
            **more,
        )
        context.set_default_timeout(PATIENCE)
        return self._visit(context, address, offline=offline, expected=expected)

    def another_tab(self, page: Page, address: str) -> Page:
        """Open an address in the same profile."""
        return self._visit(page.context, address, offline=False, expected=None)

    def _visit(self, context: BrowserContext, address: str, *, offline: bool, expected: re.Pattern[str] | None) -> Page:
        page = context.new_page()
        visit = Visit(page, context, expected=expected)
        self.visits.append(visit)
        _listen(page, visit.complaints, offline=offline)
        page.goto(address)
        return page

    def close(self) -> list[str]:
        """Close all pages, and return the unexpected errors."""
        for context in {id(visit.context): visit.context for visit in self.visits}.values():
            context.close()
        return [text for visit in self.visits for text in visit.unexpected()]


def _listen(page: Page, complaints: list[str], *, offline: bool) -> None:
    def on_console(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            complaints.append(f"console: {message.text}")

    def on_request(request: Request) -> None:
        scheme = urlsplit(request.url).scheme
        if offline and scheme not in INSIDE and not (scheme == "file" and request.is_navigation_request()):
            complaints.append(f"request without a network: {request.url}")

    page.on("console", on_console)
    page.on("pageerror", lambda error: complaints.append(f"error: {error.message}\n{error.stack}"))
    page.on("dialog", lambda dialog: (complaints.append(f"dialog: {dialog.message}"), dialog.dismiss()))
    page.on("request", on_request)
    page.on("crash", lambda _: complaints.append("the page crashed"))
    page.add_init_script(
        "document.addEventListener('securitypolicyviolation', (event) => "
        "console.error(`policy: ${event.violatedDirective} ${event.blockedURI} ${event.sample}`));"
    )


@pytest.fixture
def visit(browser: Browser, live_run: object, served: object, wire: object) -> Iterator[Visitor]:
    """Opens pages; fails the test if a browser reported an error. Pages are closed before their servers."""
    visitor = Visitor(browser)
    yield visitor
    assert visitor.close() == []


class LivePage(Command):
    """A process that serves a page, and its address."""

    def __init__(self, folder: Path, *arguments: str, **environment: str) -> None:
        super().__init__(folder, *arguments, "--web-port", "0", **environment)
        self.printed: list[str] = []
        self.address = self._printed_address()

    @property
    def origin(self) -> str:
        """The address without the token, which allows to look only."""
        return self.address.partition("#")[0]

    @property
    def run_folder(self) -> Path:
        """The folder of the run."""
        return self.folder / "rtf-runs" / "latest"

    def _printed_address(self) -> str:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.printed.append(line)
            found = re.search(r"http://\S+", line)
            if found:
                return found[0]
        raise AssertionError(f"no address was printed: {self.printed} {self.process.communicate()}")

    def end(self) -> None:
        """Kill the process, and check that none of its processes is left."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()
        assert self.left_over() == []


@pytest.fixture
def live_run(tmp_path: Path) -> Iterator[Callable[..., LivePage]]:
    """Starts runs of a bench's suite with the live page; they end with the test."""
    runs: list[LivePage] = []

    def start(suite: str, *arguments: str) -> LivePage:
        folder = tmp_path / f"live{len(runs)}"
        bench.write(folder, suite)
        runs.append(LivePage(folder, "--suite", "suite.xml", "--grace", "0.3", "--web-reporter", *arguments))
        return runs[-1]

    yield start
    for run in runs:
        run.end()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Callable[..., LivePage]]:
    """Serves the pages of finished runs."""
    pages: list[LivePage] = []

    def start(folder: Path, *arguments: str) -> LivePage:
        pages.append(LivePage(tmp_path, "page", str(folder), *arguments))
        return pages[-1]

    yield start
    for page in pages:
        page.end()


@pytest.fixture
def wire() -> Iterator[Callable[[str], tuple[Wire, str]]]:
    """Lays a connection that can be cut before a page; returns it, and the address at its near end."""
    wires: list[Wire] = []

    def lay(address: str) -> tuple[Wire, str]:
        port = urlsplit(address).port
        assert port is not None
        wires.append(Wire(port))
        return wires[-1], address.replace(f":{port}/", f":{wires[-1].port}/")

    yield lay
    for laid in wires:
        laid.close()


# Runs that are over ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bench:
    """Two runs of the bench, the second compared with the first, both in a history, and its archived page."""

    folder: Path
    earlier: Path
    run: Path

    @property
    def address(self) -> str:
        """The archived page of the second run."""
        return (self.folder / "page.html").as_uri()


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """The bench, run twice to its end; in the second run joint 3 is worse."""
    folder = tmp_path_factory.mktemp("finished")
    bench.write(folder)
    words = "--suite suite.xml --answer default --grace 0.3 --robot icubSim --station bench --history history.sqlite"
    common = words.split()
    first = run_command(folder, *common, "--run-folder", "first")
    assert first.exit_code == 1, first.stderr
    for mark in ("die", "died", "again", "tried"):
        (folder / mark).unlink()
    measure = folder / "measure.py"
    measure.write_text(measure.read_text(encoding="utf-8").replace("(3, 1.4)", "(3, 1.7)"), encoding="utf-8")
    arguments = (*common, "--run-folder", "second", "--compare", "first", "--html", "page.html")
    second = run_command(folder, *arguments)
    assert second.exit_code == 1, second.stderr
    return Bench(folder, folder / "first", folder / "second")


@pytest.fixture(scope="session")
def unreachable() -> re.Pattern[str]:
    """The errors that a browser reports without a network."""
    return UNREACHABLE


# Looking ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def shoot() -> Callable[[Page, str], None]:
    """Keeps a screenshot of a page."""
    folder = Path(os.environ.get("RTF_SCREENSHOTS", ROOT / "build" / "screenshots"))
    folder.mkdir(parents=True, exist_ok=True)

    def keep(page: Page, name: str) -> None:
        page.screenshot(path=folder / f"{name}.png")

    return keep


@pytest.fixture(scope="session")
def axe_source() -> str:
    """The text of axe-core, which finds barriers in a page."""
    path = Path(os.environ.get("RTF_AXE", ROOT / ".venv/npm/node_modules/axe-core/axe.min.js"))
    if not path.is_file():
        pytest.fail(f"{path} is missing: npm install --prefix .venv/npm axe-core, or make test, which does it")
    return path.read_text(encoding="utf-8")


@pytest.fixture
def barriers(axe_source: str) -> Callable[[Page], list[str]]:
    """Returns the accessibility violations of a page, a line for each rule and element."""

    def find(page: Page) -> list[str]:
        if not page.evaluate("() => typeof axe === 'object'"):
            page.evaluate(axe_source)
        found = page.evaluate("() => axe.run(document, {resultTypes: ['violations']})")
        return [
            f"{violation['id']}: {node['target']} {node.get('failureSummary', '')}"
            for violation in found["violations"]
            for node in violation["nodes"]
        ]

    return find
