"""The standard streams of a program as ports, and the terminal in which a node shows those of another node's program.

The node that runs the program opens ``UUID/stdin`` and ``UUID/stdout``. The other one opens a window in which a program
of RTF, or of YARP, opens ``UUID/stdio:o`` and ``UUID/stdio:i`` and connects them to these.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from rtf.applications.run.client import RunClient
from rtf.applications.run.errors import NodeError, StartError
from rtf.applications.run.output import InputPort
from rtf.applications.run.protocol import aborted

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.applications.run.protocol import Start
    from rtf.middleware.ports.network import Network

#: The program that opens a window on a desktop, as for YARP's nodes.
WINDOW = "xterm"


class Streams:
    """The ports of a program that is about to start. ``stdin`` is the descriptor for it, closed by the caller.

    Raises MiddlewareError if the port of the input cannot be opened.
    """

    def __init__(self, uuid: str, request: Start, *, network: Network, report: Callable[[str], None]) -> None:
        self.uuid = uuid
        self._request = request
        self._report = report
        self._terminal: RunClient | None = None
        self._network = network
        self.stdin, ours = os.pipe2(os.O_CLOEXEC)
        try:
            self._entrance = InputPort(f"{uuid}/stdin", ours, network)
        except BaseException:
            os.close(self.stdin)
            raise

    def open_terminal(self, node: str) -> list[object]:
        """Ask the other node for the terminal, and return its answer; a refusal does not end the program."""
        client = RunClient(self._request.stdio, network=self._network)
        try:
            reply = client.start(replace(self._request, uuid=self.uuid))
        except NodeError as error:
            return aborted(node, self._request, f"Can't open a terminal: {error}", WINDOW)
        if reply.pid > 0:
            self._terminal = client
        return [reply.pid, reply.text]

    def close(self) -> None:
        """Close the port of the input, and the terminal if there is one. Runs when all output has been sent."""
        self._entrance.close()
        if self._terminal is not None:
            try:
                self._terminal.close_terminal(self._request.tag)
            except NodeError as error:
                self._report(f"the terminal of {self._request.tag} is not closed: {error}")


def window_words(request: Start) -> list[str]:
    """Return the command of the window for the streams of a program. Raises StartError if the request names none."""
    if not request.uuid.startswith("/") or any(map(str.isspace, request.uuid)):
        raise StartError(f"{request.uuid!r} is not the name of a program's ports")
    geometry = ["-geometry", request.geometry] if request.geometry else []
    hold = "-hold" if request.hold else "+hold"
    terminal = [sys.executable, "-m", "rtf", "run", "--terminal", request.uuid]
    return [WINDOW, hold, *geometry, "-title", request.tag, "-e", *terminal]
