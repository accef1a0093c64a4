"""What the output of a child comes to: its last lines, and lines that are sent to a port."""

from __future__ import annotations

import contextlib
import os
import select
import threading
from collections import deque
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.logs.record import bytes_of
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.pipelined_port import PipelinedPort
from rtf.middleware.types.codecs import RAW
from rtf.testing.languages.program import LineCutter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.middleware.ports.buffered import Received
    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output

#: Bytes of the end of a child's output that are kept.
TAIL = 4096
#: Bytes of lines that wait for a reader of the port; further lines are counted and left out.
WAITING = 1 << 20
#: A line is cut after this many bytes.
LINE = 4096
#: Seconds between two attempts to reach the reader.
_AGAIN = 5.0
#: Seconds after the end of a child in which a terminal may still connect to read what it wrote.
LINGER = 2.0
_TOGETHER = 16
_LOOK = 0.2


def printable(text: str) -> str:
    """Return a text that others have made without the characters that steer a terminal; lines are kept."""
    return "".join(one if one.isprintable() or one == "\n" else "?" for one in text)


class Tail:
    """The end of what a child wrote."""

    def __init__(self) -> None:
        self._kept = b""

    def feed(self, data: bytes) -> None:
        """Take what was read."""
        self._kept = data[-TAIL:] if len(data) >= TAIL else (self._kept + data)[-TAIL:]

    def lines(self, most: int) -> list[str]:
        """Return the last lines."""
        return self._kept.decode("utf-8", "backslashreplace").splitlines()[-most:]


class LineSender:
    """Sends the lines of a child from a port, in a thread of its own: a slow reader must not stop the child.

    With a ``target``, such as the logger, the port is connected to it, and each line has the port's name before it, as
    those of YARP's own have; otherwise others connect. Lines wait, :data:`WAITING` bytes at most, until somebody reads.
    ``at_end`` is called when the port is closed.
    """

    def __init__(
        self,
        name: str,
        *,
        network: Network,
        target: str = "",
        report: Callable[[str], None],
        at_end: Callable[[], None] = lambda: None,
    ) -> None:
        self.name = name
        self._network = network
        self._target = target
        self._tag = f"[{name}]"
        self._report = report
        self._at_end = at_end
        self._cutter = LineCutter(LINE)
        self._lines: deque[str] = deque()
        self._size = 0
        self._left_out = 0
        self._changed = threading.Condition()
        self._closing = False
        self._reported = False
        self._thread = threading.Thread(target=self._run, name=f"rtf-run-output {name}", daemon=True)
        self._thread.start()

    def feed(self, data: bytes) -> None:
        """Take what was read. Does not wait."""
        with self._changed:
            if self._size >= WAITING:
                self._left_out += data.count(b"\n")  # without cutting: a flood must cost little
                return
            self._take(self._cutter.feed(data))

    def close(self) -> None:
        """Send what waits, if somebody reads it, and close the port. Does not wait."""
        with self._changed:
            self._take(self._cutter.finish())
            self._closing = True
            self._changed.notify_all()

    def join(self, timeout: float) -> None:
        """Wait until the port is closed, ``timeout`` seconds at most."""
        self._thread.join(timeout)

    @property
    def open(self) -> bool:
        """Whether the port is open, or is about to be."""
        return self._thread.is_alive()

    def _take(self, lines: Iterable[str]) -> None:
        for line in lines:
            self._lines.append(line)
            self._size += len(line) + 1
        self._changed.notify_all()

    # The thread --------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._serve():
                pass
        finally:
            self._at_end()

    def _serve(self) -> bool:
        """Open the port, and send lines until the child has ended. False if that has to be tried again."""
        try:
            with _LinePort(self.name, self._wake, self._network) as port:
                while self._await_lines() and self._await_reader(port):
                    self._send(port)
                    port.settle()
        except MiddlewareError as error:  # the name server is away
            self._report_once(f"{self.name} cannot be opened: {error}")
            with self._changed:
                return self._changed.wait_for(lambda: self._closing, _AGAIN)
        return True

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _await_lines(self) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: self._lines or self._closing)
            return bool(self._lines)

    def _await_reader(self, port: _LinePort) -> bool:
        """Wait until somebody reads. False if the child has ended before."""
        while not port.outputs:
            if self._target:
                try:
                    port.add_output(self._target)
                except MiddlewareError as error:
                    self._report_once(f"{self.name}: {error}; the last lines are kept until it can be reached")
            with self._changed:
                if self._closing:
                    linger = 0.0 if self._target else LINGER
                    return bool(self._changed.wait_for(lambda: port.outputs, linger))
                self._changed.wait_for(lambda: self._closing or port.outputs, _AGAIN)
        self._reported = False
        return True

    def _report_once(self, text: str) -> None:
        if not self._reported:
            self._reported = True
            self._report(text)

    def _send(self, port: _LinePort) -> None:
        for _ in range(_TOGETHER):
            with self._changed:
                if not self._lines:
                    if self._left_out:
                        self._lines.append(f"[WARNING] {self._left_out} lines are left out here: they came too fast")
                        self._left_out = 0
                    return
                line = self._lines[0]
            text = f"{line}\n"
            if not (port.write(bytes_of(self._tag, text), RAW) if self._target else port.write(Bottle([text]))):
                return  # its reader is gone: the line is kept for the next one
            with self._changed:
                self._lines.popleft()
                self._size = max(0, self._size - len(line) - 1)


class _LinePort(PipelinedPort):
    """A port that says when somebody reads."""

    def __init__(self, name: str, woken: Callable[[], None], network: Network) -> None:
        self._woken = woken
        super().__init__(name, network=network)

    def connected(self, output: Output) -> None:
        super().connected(output)
        self._woken()


class InputPort:
    """The port by which lines come to the standard input of a child."""

    def __init__(self, name: str, descriptor: int, network: Network) -> None:
        self._descriptor = descriptor
        self._closed = False
        os.set_blocking(descriptor, False)
        try:
            self._port = BufferedPort(name, strict=True, callback=self._write, network=network, outputs=False)
        except MiddlewareError:
            os.close(descriptor)
            raise

    def _write(self, received: Received[Bottle]) -> None:
        message = received.value
        first = message.get(0)
        text = first if len(message) == 1 and isinstance(first, str) else f"{message.to_text()}\n"
        view = memoryview(text.encode("utf-8", "surrogateescape"))
        with contextlib.suppress(BrokenPipeError):  # it reads no more
            while view and not self._closed:
                if select.select([], [self._descriptor], [], _LOOK)[1]:
                    with contextlib.suppress(BlockingIOError):
                        view = view[os.write(self._descriptor, view) :]

    def close(self) -> None:
        """Close the port, and the standard input of the child."""
        self._closed = True
        self._port.close()
        os.close(self._descriptor)
