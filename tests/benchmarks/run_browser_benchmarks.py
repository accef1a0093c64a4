"""Measure the page in a real browser: ``python tests/benchmarks/run_browser_benchmarks.py [pixel|archive|live …]``.

``pixel``: from the moment a test says something to the frame that shows it. ``archive`` and ``live``: a run of many
tests, opened from a file and from the server, until its verdict stands there; then its list and its log are scrolled
and the frames counted that took too long. Numbers of a busy machine mean little.
"""

from __future__ import annotations

import argparse
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from long_run import write_journal
from measuring import TESTRUNNER
from playwright.sync_api import sync_playwright

from rtf import clock
from rtf.page.archive import write_archive

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page

FLAGS = ("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking")
#: A frame that takes longer than this is seen as a jerk, in milliseconds.
JANK = 50
LATE = 120_000

TICKER = """
from pathlib import Path
from rtf import clock
from rtf.testing import TestCase

class Ticker(TestCase):
    def run(self):
        while not Path(__file__).with_name("enough").exists():
            clock.sleep(0.05)
            self.report(f"tick {clock.now():.6f}")
"""

#: Keeps, for each tick that came into the document, the milliseconds from its saying to the end of the next frame; but
#: for those that were said before the page was there to see them.
_WATCH_TICKS = """
window.late = new Map();
new MutationObserver(() => {
  const rows = [...document.querySelectorAll("[role=option]")];
  const texts = rows.flatMap((row) => row.textContent.match(/tick [0-9.]+/) ?? []);
  const said = texts.map((text) => 1000 * Number(text.slice(5)));
  const fresh = said.filter((time) => time > performance.timeOrigin + 1000 && !window.late.has(time));
  requestAnimationFrame(() => setTimeout(() => {
    for (const time of fresh) window.late.set(time, Date.now() - time);
  }));
}).observe(document, { subtree: true, childList: true, characterData: true });
"""

#: Keeps the milliseconds since the navigation when the verdict of the whole run and its counts stood there.
_WATCH_OPENING = """
const look = () => {
  const verdict = document.querySelector("h1")?.textContent;
  const counts = document.querySelector("[role=group]")?.textContent ?? "";
  if (verdict === "failed" && counts.includes("COUNT passed") && document.querySelector("[role=option]")) {
    setTimeout(() => { window.opened = performance.now(); });
  } else requestAnimationFrame(look);
};
requestAnimationFrame(look);
"""

#: Scrolls a list through, a third of a screen a frame, and gives back how long each frame took.
_SCROLL = """(selector) => new Promise((done) => {
  const list = document.querySelector(selector);
  const frames = [];
  let last = performance.now();
  list.scrollTop = 0;
  const step = (now) => {
    frames.push(now - last);
    last = now;
    list.scrollTop += list.clientHeight / 3;
    if (frames.length < 300 && list.scrollTop + list.clientHeight < list.scrollHeight - 1) requestAnimationFrame(step);
    else done(frames.slice(1));
  };
  requestAnimationFrame(step);
})"""


def line(name: str, value: str, limit: str = "") -> None:
    """Print one row."""
    print(f"  {name:44}{value:>24}   {f'({limit})' if limit else ''}", flush=True)


@contextmanager
def serving(*arguments: str, folder: Path) -> Iterator[str]:
    """A process that serves a page; gives its address, and ends it."""
    process = subprocess.Popen(
        [*TESTRUNNER, *arguments, "--web-port", "0"],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        said = process.stderr.readline()
        found = re.search(r"http://\S+", said)
        if found is None:
            raise RuntimeError(f"no address was printed: {said}{process.stderr.read()}")
        yield found[0]
    finally:
        process.terminate()
        process.communicate()


def new_page(browser: Browser, watch: str) -> Page:
    """A page in a profile of its own, with a script that runs before it."""
    context = browser.new_context(viewport={"width": 1366, "height": 768}, locale="en-GB")
    context.set_default_timeout(LATE)
    page = context.new_page()
    page.add_init_script(watch)
    return page


def measure_pixel(browser: Browser, folder: Path, options: argparse.Namespace) -> None:
    """From a test that says something to the frame that shows it."""
    (folder / "ticker.py").write_text(TICKER)
    with serving("--test", "ticker.py", "--web-reporter", "--quiet", folder=folder) as address:
        page = new_page(browser, _WATCH_TICKS)
        origin, _, token = address.partition("#")
        page.goto(f"{origin}#{token}")
        page.evaluate("() => { location.hash = '#~log'; }")
        page.wait_for_function("(count) => window.late.size >= count", arg=options.ticks)
        (folder / "enough").touch()
        late = page.evaluate("() => [...window.late.values()]")
        page.context.close()
    print(f"Event to pixel, {len(late)} messages")
    line("median", f"{statistics.median(late):.0f} ms", "goal: 200 ms")
    line("nine in ten within", f"{sorted(late)[len(late) * 9 // 10]:.0f} ms")


def measure_archive(browser: Browser, folder: Path, options: argparse.Namespace) -> None:
    """A long run as a file."""
    write_journal(folder / "run", options.tests, options.events)
    target = folder / "report.html"
    began = clock.monotonic()
    with target.open("wb") as stream:
        write_archive(stream, folder / "run")
    took = clock.monotonic() - began
    print(f"Archive of {options.tests} tests, {options.tests * options.events} events")
    line("written in", f"{took:.2f} s, {target.stat().st_size / (1 << 20):.1f} MiB")
    measure_long_run(browser, target.as_uri(), options)


def measure_live(browser: Browser, folder: Path, options: argparse.Namespace) -> None:
    """A long run from the server, for somebody who comes late."""
    write_journal(folder / "run", options.tests, options.events)
    print(f"Late join of {options.tests} tests, {options.tests * options.events} events")
    with serving("page", "run", folder=folder) as address:
        measure_long_run(browser, address, options)


def measure_long_run(browser: Browser, address: str, options: argparse.Namespace) -> None:
    """Open the page several times, and scroll it in the last one."""
    failed = -(-options.tests // 50)
    opened = []
    for _ in range(options.rounds):
        page = new_page(browser, _WATCH_OPENING.replace("COUNT", str(options.tests - failed)))
        page.goto(address)
        page.wait_for_function("() => window.opened")
        opened.append(page.evaluate("() => window.opened"))
        if len(opened) < options.rounds:
            page.context.close()
    line("opens in, median", f"{statistics.median(opened) / 1000:.2f} s", "goal: 3 s")
    line("opens in, worst", f"{max(opened) / 1000:.2f} s")
    scroll(page, "list", "#")
    scroll(page, "log", "#~log")
    scroll(page, "measurements", "#~measurements")
    page.context.close()


def scroll(page: Page, name: str, view: str) -> None:
    """Scroll a view through, and tell of its frames."""
    began = clock.monotonic()
    page.evaluate("(hash) => { location.hash = hash; }", view)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    took = clock.monotonic() - began
    selector = page.evaluate(
        """() => {
          const inside = [...document.querySelectorAll("main .view *")].filter((one) => one.checkVisibility());
          const scrolls = inside.filter((one) => one.scrollHeight > 2 * one.clientHeight && one.clientHeight > 100);
          const longest = scrolls.sort((one, other) => other.scrollHeight - one.scrollHeight)[0];
          longest.dataset.longest = "";
          return "[data-longest]";
        }"""
    )
    frames: list[Any] = page.evaluate(_SCROLL, selector)
    page.evaluate("() => delete document.querySelector('[data-longest]').dataset.longest")
    janky = sum(frame > JANK for frame in frames)
    line(f"{name}: shown in", f"{took:.2f} s")
    line(f"{name}: frames over {JANK} ms", f"{janky} of {len(frames)}, worst {max(frames):.0f} ms", "goal: none")


def main(arguments: list[str] | None = None) -> None:
    """Measure what was asked for, in a folder that is gone afterwards."""
    parser = argparse.ArgumentParser(description="Benchmarks of the page in a real browser; about a minute.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="pixel, archive, live (default: all)")
    parser.add_argument("--rounds", type=int, default=5, help="how often a long run is opened")
    parser.add_argument("--tests", type=int, default=10_000, help="tests of the long run")
    parser.add_argument("--events", type=int, default=10, help="events of each of them")
    parser.add_argument("--ticks", type=int, default=100, help="messages that are waited for")
    options = parser.parse_args(arguments)
    known = {"pixel": measure_pixel, "archive": measure_archive, "live": measure_live}
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("the page is measured in a real browser, and there is none: apt install chromium")
    with sync_playwright() as playwright, tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as folder:
        browser = playwright.chromium.launch(executable_path=chromium, args=[*FLAGS])
        for name in options.names or known:
            inside = Path(folder) / name
            inside.mkdir()
            known[name](browser, inside, options)
        browser.close()


if __name__ == "__main__":
    main()
