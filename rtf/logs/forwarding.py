"""Forwarding of the standard library's logging to ``/yarplogger``, as YARP's own programs do.

``logging.getLogger().addHandler(rtf.logs.handler())`` is all that a program needs. The port
``/log/<host>/<program>/<process number>`` is opened by the first record, and connected once; without a logger the
records are not sent, and a line on stderr says so. A thread sends, so logging waits for nobody: what waits is limited,
and records beyond that are dropped and counted by a warning.

These variables are those of YARP: ``YARP_FORWARD_LOG_ENABLE`` (for :func:`forward_if_enabled`),
``YARP_FORWARD_CODEINFO_ENABLE``, ``YARP_FORWARD_HOSTNAME_ENABLE``, ``YARP_FORWARD_PROCESSINFO_ENABLE``,
``YARP_FORWARD_BACKTRACE_ENABLE`` and ``YARP_LOG_PROCESS_LABEL``.
"""

from __future__ import annotations

import logging
import os
import platform
import re
import sys
import threading
import weakref
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.logs.record import COLLECTOR, COMPONENT, Level, LogRecord, details_text
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.pipelined_port import PipelinedPort
from rtf.middleware.types.codecs import RAW

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.ports.network import Network

#: Records that may wait to be sent.
LIMIT = 20_000
#: Records that are sent in one piece, and seconds in which they are collected for that.
_TOGETHER = 16
_PAUSE = 0.01
#: Seconds that the logger may take for a piece, and all that waits at the end of the program.
_PATIENCE, _CLOSING = 30.0, 3.0
_LAST_WORDS = "Execution terminated"
_TRUE = frozenset({"1", "true", "True", "TRUE", "on", "On", "ON", "yes"})
_LEVELS = (
    (logging.CRITICAL, Level.FATAL),
    (logging.ERROR, Level.ERROR),
    (logging.WARNING, Level.WARNING),
    (logging.INFO, Level.INFO),
    (logging.DEBUG, Level.DEBUG),
)


@dataclass(frozen=True, slots=True)
class Options:
    """What a record has beside time, level, component and message; ``label`` distinguishes processes of one program."""

    code: bool = False
    host: bool = False
    process: bool = False
    backtrace: bool = False
    label: str = ""

    @classmethod
    def of(cls, environ: Mapping[str, str]) -> Options:
        """Read YARP's variables."""
        names = ("CODEINFO", "HOSTNAME", "PROCESSINFO", "BACKTRACE")
        code, host, process, backtrace = [environ.get(f"YARP_FORWARD_{name}_ENABLE") in _TRUE for name in names]
        return cls(code, host, process, backtrace, environ.get("YARP_LOG_PROCESS_LABEL", ""))


class ForwardingHandler(logging.Handler):
    """Sends records to ``/yarplogger``. The name of a logger is the record's component.

    ``program`` is its name in the port's; empty: that of its file. ``network`` is that of the port; None: that of the
    process. A process that is forked from this one has a port of its own. :meth:`close`, which :mod:`logging` calls at
    the end of the program, sends what waits and a last record.
    """

    def __init__(
        self,
        level: int = logging.NOTSET,
        *,
        program: str = "",
        options: Options | None = None,
        network: Network | None = None,
    ) -> None:
        super().__init__(level)
        self._options = options or Options.of(os.environ)
        self._program = re.sub(r"[^\w.+-]", "-", program or _program())
        self._network = network
        self.dropped = 0
        self._begin()
        _handlers.add(self)

    def _begin(self) -> None:
        """Begin in a new process, with nothing sent."""
        self._queue: deque[_Queued] = deque()
        self._arrived = threading.Event()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._given_up = False
        self._dropped_reported = self.dropped  # how many of the dropped records the log knows of

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a record. Called with the handler's lock."""
        if self._given_up or self._closing.is_set() or threading.current_thread() is self._thread:
            return  # what is logged while a record is sent would be sent for ever
        if len(self._queue) >= LIMIT:
            self.dropped += 1
            return
        try:  # now, because the values may change
            message = record.getMessage()
            trace = record.exc_text or (_FORMATTER.formatException(record.exc_info) if record.exc_info else "")
        except Exception:  # noqa: BLE001 - the message and its values do not fit: reported as logging does
            self.handleError(record)
            return
        self._queue.append((record, message, trace, _network_time()))
        if not self._arrived.is_set():
            self._arrived.set()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="rtf-log-forwarder", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Send what waits, in at most three seconds, and a last record; close the port."""
        thread, closing = self._thread, self._closing
        if not closing.is_set():
            closing.set()
            self._arrived.set()
            if thread is not None:
                thread.join(_CLOSING)
        super().close()

    # In the sending thread -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        label = f"[{self._options.label}]" if self._options.label else ""
        name = f"/log/{platform.node()}/{self._program}{label}/{os.getpid()}"
        try:
            with PipelinedPort(name, RAW, network=self._network, patience=_PATIENCE, together=_TOGETHER) as port:
                try:
                    port.add_output(COLLECTOR, "fast_tcp")
                except MiddlewareError as error:  # a logger that is started later connects to this port
                    _say(f"no logger gets the records of this program yet: {error}; start one with 'rtf logger'")
                self._send(port)
        except MiddlewareError as error:
            self._given_up = True
            self._queue.clear()
            _say(f"the records of this program are not forwarded: {error}")

    def _send(self, port: PipelinedPort) -> None:
        """Send records until the end, many at a time."""
        process = self._details_of_process()
        while not self._closing.is_set():
            self._arrived.wait()
            self._arrived.clear()
            self._send_waiting(port, process)
            self._closing.wait(_PAUSE)
        self._send_waiting(port, process)
        self._send_own(port, Level.INFO, _LAST_WORDS, process)
        port.settle()

    def _send_waiting(self, port: PipelinedPort, process: tuple[str, str]) -> None:
        queue, write = self._queue, port.write
        if not port.outputs:
            queue.clear()
            return
        while queue:
            write(self._message(queue.popleft(), port.name, process).to_bytes())
        if dropped := self.dropped - self._dropped_reported:
            self._dropped_reported += dropped
            self._send_own(port, Level.WARNING, f"{dropped} records were dropped: they came faster than sent", process)
        port.flush()

    def _send_own(self, port: PipelinedPort, level: Level, text: str, process: tuple[str, str]) -> None:
        details = " ".join(filter(None, process))
        port.write(LogRecord(port.name, level, clock.now(), text, COMPONENT, "", details).to_bytes())

    def _message(self, queued: _Queued, sender: str, process: tuple[str, str]) -> LogRecord:
        record, message, trace, network_time = queued
        host, program = process
        parts = [] if network_time is None else [details_text(networktime=network_time)]
        if self._options.code:
            parts.append(details_text(filename=record.pathname, line=record.lineno, function=record.funcName))
        if host:
            parts.append(host)
        if program:
            parts.append(f"{program} {details_text(thread_id=(record.thread or 0) & 0xFFFFFFFF)}")
        if trace and not self._options.backtrace:
            message, trace = f"{message}\n{trace}", ""
        return LogRecord(
            sender,
            _level_of(record.levelno),
            record.created,
            message,
            "" if record.name == "root" else record.name,
            str(getattr(record, "id", "")),
            " ".join(parts),
            trace,
        )

    def _details_of_process(self) -> tuple[str, str]:
        """Return the groups of the computer and of the program, each empty unless it is asked for."""
        host = details_text(hostname=platform.node()) if self._options.host else ""
        if not self._options.process:
            return host, ""
        return host, details_text(pid=os.getpid(), cmd=self._program, args=" ".join(sys.argv[1:]))


def _say(text: str) -> None:
    sys.stderr.write(f"[WARNING] |{COMPONENT}| {text}\n")


#: A record, its text and that of its exception, and the network time.
_Queued = tuple[logging.LogRecord, str, str, float | None]
_FORMATTER = logging.Formatter()
_handlers: weakref.WeakSet[ForwardingHandler] = weakref.WeakSet()


def _begin_in_child() -> None:
    for handler in _handlers:
        handler._begin()  # noqa: SLF001 - of this module


os.register_at_fork(after_in_child=_begin_in_child)


def handler(level: int = logging.NOTSET) -> ForwardingHandler:
    """Return a handler that forwards to ``/yarplogger``, with the details that YARP's variables ask for."""
    return ForwardingHandler(level)


def forward_if_enabled(program: str = "") -> ForwardingHandler | None:
    """Forward the log of this program, whose name is found out if it is not given, if ``YARP_FORWARD_LOG_ENABLE`` is 1.

    Records of the framework are forwarded from DEBUG on, those of other libraries from INFO on. A second call returns
    the same handler.
    """
    if os.environ.get("YARP_FORWARD_LOG_ENABLE") not in _TRUE:
        return None
    root = logging.getLogger()
    for known in root.handlers:
        if isinstance(known, ForwardingHandler):
            return known
    made = ForwardingHandler(program=program)
    root.addHandler(made)
    root.setLevel(logging.INFO)
    logging.getLogger("rtf").setLevel(logging.DEBUG)
    return made


def _program() -> str:
    """Return the name of this program; that of its package if it was started with ``python -m``."""
    path = Path(sys.argv[0] if sys.argv and sys.argv[0] not in ("", "-c", "-m") else sys.executable)
    return path.parent.name if path.name == "__main__.py" else path.name


def _network_time() -> float | None:
    """Return the time of the robot's clock where that is not the machine's: a simulator's, or that of a network."""
    robot = clock.current()
    return None if isinstance(robot, clock.SystemClock) else robot.now()


def _level_of(number: int) -> Level:
    return next((level for least, level in _LEVELS if number >= least), Level.TRACE)
