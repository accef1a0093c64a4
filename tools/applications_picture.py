"""The picture of the page of applications: ``python tools/applications_picture.py FILE.png`` (needs Chromium).

A small application is run for it, with a name server and a node of its own.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from playwright.sync_api import sync_playwright

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Page

_SIZE = {"width": 1280, "height": 800}
#: Programs of the application: what they say, the ports that they write and read.
_PROGRAMS = {
    "camera": ("left eye, 30 pictures a second", "/camera/left", ""),
    "tracker": ("the ball is at 0.31 -0.05 0.12", "/tracker/target", "/tracker/image"),
    "gaze": ("fixating", "/gaze/angles", "/gaze/target"),
    "recorder": ("writing ball.log", "", "/recorder/data"),
}
_SCRIPT = """#!/bin/sh
{read}
{write}
while sleep 0.5; do echo "{said}"; done
"""
_DESCRIPTION = """<module><name>{name}</name><description>{said}.</description><data>{ports}</data></module>"""
_LINKS = [
    ("/camera/left", "/tracker/image"),
    ("/tracker/target", "/gaze/target"),
    ("/gaze/angles", "/recorder/data"),
    ("/tracker/target", "/grasp/object"),
]


def _write(folder: Path) -> Path:
    """Write the application, its programs and their descriptions; return its file."""
    (folder / "modules").mkdir()
    modules = []
    for name, (said, output, source) in _PROGRAMS.items():
        script = folder / name
        command = f"'{sys.executable}' -P -m rtf"
        read = f"{command} read {source} >/dev/null &" if source else ""
        write = f"(while sleep 0.2; do echo 1; done) | {command} write {output} &" if output else ""
        script.write_text(_SCRIPT.format(read=read, write=write, said=said))
        script.chmod(script.stat().st_mode | stat.S_IXUSR)
        ports = "".join(
            f"<{kind}><type>Bottle</type><port>{port}</port></{kind}>"
            for kind, port in (("output", output), ("input", source))
            if port
        )
        (folder / "modules" / f"{name}.xml").write_text(_DESCRIPTION.format(name=name, said=said, ports=ports))
        node = "<node>pc104</node>" if name == "tracker" else ""
        modules.append(f"<module><name>{name}</name>{node}</module>")
    modules.append("<module><name>grasp</name><parameters>--name /grasp</parameters></module>")
    links = "".join(f"<connection><from>{source}</from><to>{target}</to></connection>" for source, target in _LINKS)
    file = folder / "ball.xml"
    file.write_text(
        "<application><name>ball</name><description>The eyes follow a ball.</description>"
        f"{''.join(modules)}{links}</application>"
    )
    return file


@contextmanager
def _running(*words: str, environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-P", "-m", "rtf", *words]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()


def _show(page: Page) -> None:
    """Run the application, and select a program."""
    page.get_by_role("button", name="Run all").click()
    page.locator(".apps-table tr", has_text="recorder").get_by_text("running").wait_for()
    page.locator(".apps-table tr", has_text="grasp").get_by_text("failed").wait_for()
    page.get_by_role("tab", name="Connections").click()
    for _, target in _LINKS[:3]:
        page.locator(".apps-table tr", has_text=target).get_by_text("connected").wait_for()
    page.get_by_role("tab", name="Modules").click()
    page.get_by_role("button", name="tracker", exact=True).click()
    page.locator(".output", has_text=_PROGRAMS["tracker"][0]).wait_for()


def main() -> None:
    """Write the picture to the file named on the command line."""
    with tempfile.TemporaryDirectory() as place, ExitStack() as stack:
        file = _write(Path(place))
        path = f"{place}:{os.environ['PATH']}"
        environment = {
            **os.environ,
            "PATH": path,
            "YARP_CONFIG_HOME": f"{place}/yarp",
            "XDG_STATE_HOME": f"{place}/state",
        }

        def run(*words: str) -> str:
            """Start a program of RTF that runs until the end, and return its first line."""
            process = stack.enter_context(_running(*words, environment=environment))
            assert process.stdout is not None
            return process.stdout.readline()

        run("nameserver", "--socket", "0", "--write", "--no-discovery", "--silent")
        run("run", "--server", "/pc104")
        address = run("app", "page", str(file), "--web-port", "0").split()[2]
        chromium = os.environ.get("RTF_CHROMIUM") or shutil.which("chromium")
        browser = stack.enter_context(sync_playwright()).chromium.launch(
            executable_path=chromium, args=["--no-sandbox"]
        )
        page = browser.new_page(viewport=_SIZE, color_scheme="light")  # type: ignore[arg-type]  # a plain dict will do
        page.goto(address)
        _show(page)
        page.screenshot(path=sys.argv[1])
        browser.close()


if __name__ == "__main__":
    main()
