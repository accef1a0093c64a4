"""The live page: what happens, while it happens, in every browser that is pointed here.

The page is served by a process of its own, which reads the journal; this reporter starts it, tells it that there is
something new, and ends it. ``host`` and ``port`` say where, ``keep`` (``yes``) that the page stays up when the run is
over, until somebody ends it. ``compare`` and ``history`` are shown beside the run.
"""

from __future__ import annotations

import importlib.util
import secrets
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.page.compare import journal_of
from rtf.page.server_process import ServerProcess, listen
from rtf.page.settings import LOG_NAME, Settings
from rtf.testing.reporting import Reporter, ReportError

if TYPE_CHECKING:
    import threading

    from rtf.testing.events import Event
    from rtf.testing.results import RunResult

_TOKEN_BYTES = 18
_NEEDED = ("starlette", "uvicorn")


class WebReporter(Reporter):
    """Serves the page of the run."""

    plugin_name = "web"

    _server: ServerProcess | None = None

    def open(self) -> None:
        """Open the port, start the server, and say where it is. Raises ReportError."""
        missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
        if missing:
            raise ReportError(f"the web page needs {' and '.join(missing)}: pip install {' '.join(missing)}")
        extra = self.options.extra
        compare = extra.get("compare")
        if compare is not None:
            compare = str(journal_of(Path(compare)).resolve())
        history = extra.get("history")
        if history:
            history = str(Path(history).resolve())
        host = extra.get("host", "127.0.0.1")
        listener = listen(host, int(extra.get("port", "8080")))
        settings = Settings(
            run_folder=str(self.options.run_folder),
            host=host,
            port=listener.getsockname()[1],
            token=secrets.token_urlsafe(_TOKEN_BYTES),
            keep=extra.get("keep") == "yes",
            compare=compare,
            history=history,
        )
        self.stays = settings.keep
        self._address = settings.address
        self._server = ServerProcess(settings, listener, self.options.run_folder / LOG_NAME, self.options.control)
        sys.stderr.write(f"web page: {self._address}#token={settings.token}\n")
        sys.stderr.flush()

    def handle(self, event: Event, results: RunResult) -> None:  # noqa: ARG002 - the journal has it
        """Let the server look at the journal."""
        if self._server is not None:
            self._server.notify()

    def linger(self, stop: threading.Event) -> None:
        server, self._server = self._server, None
        if server is None:
            return
        if self.stays and server.alive:
            server.announce_end()
            sys.stderr.write(f"web page: stays at {self._address} until Ctrl-C\n")
            while server.alive and not stop.wait(1.0):
                pass
        server.close()
