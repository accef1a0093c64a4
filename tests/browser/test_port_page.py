"""The page of a port in a real browser: its form, its live image, and no scripts."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest
from playwright.sync_api import expect

from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.types.image import Image
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page

    from rtf.middleware.wire.incoming_message import IncomingMessage

HOSTILE = "<img/src=x/onerror=alert(1)>"


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page; an error that the browser reports fails the test."""
    complaints: list[str] = []
    context = browser.new_context()
    opened = context.new_page()
    opened.on("console", lambda message: complaints.append(message.text))
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("dialog", lambda dialog: complaints.append(dialog.message))
    yield opened
    context.close()
    assert complaints == []


def echo(message: IncomingMessage) -> None:
    """Reply with the request itself."""
    message.reply(message.read())


def test_from_the_name_server_to_an_answer(page: Page) -> None:
    """The name server's page links to a port's page, whose form shows the reply as text."""
    with NameServer() as server, Port(f"/robot/{HOSTILE}", echo, network=Network(server.names)) as port:
        page.goto(f"http://127.0.0.1:{server.contact.port}/")
        page.get_by_role("link", name=port.name).click()
        page.get_by_label("Request, as text").fill(f'get 2.5 "{HOSTILE}"')
        page.get_by_role("button", name="Send").click()
        expect(page.locator("pre").last).to_have_text(f'get 2.5 "{HOSTILE}"')
        assert page.locator("img").count() == 0


def test_camera_is_shown_live(page: Page) -> None:
    """The page of a port of images shows them while it is open."""
    with (
        NameServer() as server,
        BufferedPort("/cam", Image.codec, network=Network(server.names)) as camera,
    ):
        page.goto(f"http://127.0.0.1:{camera.contact.port}/", wait_until="commit")
        page.get_by_role("img").wait_for(state="attached")
        eventually(lambda: camera.outputs, "the browser does not ask for pictures", limit=30)
        ended = threading.Event()

        def film() -> None:
            while not ended.wait(0.02):
                camera.write(Image(np.full((60, 80, 3), 128, np.uint8)))

        thread = threading.Thread(target=film)
        thread.start()
        try:
            eventually(lambda: page.evaluate("document.images[0].naturalWidth") == 80, "no picture is shown", limit=30)
            page.goto("about:blank")
            eventually(lambda: not camera.outputs, "the picture is still sent", limit=30)
        finally:
            ended.set()
            thread.join()
