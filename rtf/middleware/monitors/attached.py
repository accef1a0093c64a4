"""A monitor at its connection or port: called, kept within limits, and ended when it fails."""

from __future__ import annotations

import ctypes
import threading
from typing import TYPE_CHECKING, TypeVar

from rtf import clock
from rtf.bottle import Bottle, Property
from rtf.middleware.monitors.events import EVENTS
from rtf.middleware.monitors.monitor import MonitoredMessage, PortMonitor
from rtf.middleware.types.codecs import codec_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from rtf.middleware.monitors.script import ScriptName
    from rtf.middleware.wire.incoming_message import IncomingMessage

R = TypeVar("R")
#: Seconds that a call of a monitor may take.
LIMIT = 1.0
_LOOK = LIMIT / 4
#: Jumps back, at the first of which an exception that is on its way to a thread is raised.
_JUMPS = 10


class TooLongError(BaseException):
    """A call of a monitor took too long. It is raised in the thread of the call, past the handlers of a script."""


class Attached:
    """A monitor in use. Any thread may call it; calls are one after the other. ``report`` gets the reason for its end.

    After its end every message passes unchanged.
    """

    def __init__(self, name: ScriptName, ends: Mapping[str, object], report: Callable[[str], None]) -> None:
        """Load the script, and begin. Raises ConnectError."""
        self.name = name
        self._report = report
        self._lock = threading.RLock()
        self._monitor: PortMonitor | None = name.load()
        self._guard = threading.Lock()
        self._thread, self._began, self._struck = 0, 0.0, False
        self._replaces = _overridden(self._monitor, "update")
        self._answers = _overridden(self._monitor, "update_reply")
        self._over = threading.Event()
        _WATCHDOG.add(self)
        info = Property({**name.settings, **ends, "filename": str(name.find()), "type": name.type})
        if not self._call(lambda monitor: monitor.create(info), default=False):
            self.end("it was not created")
        if self.works and _overridden(self._monitor, "trig"):
            threading.Thread(target=self._trigger, name="rtf-monitor", daemon=True).start()

    @property
    def works(self) -> bool:
        """Whether it has not ended."""
        return self._monitor is not None

    def passes(self, message: IncomingMessage, others: Callable[[], Iterable[Attached]]) -> bool:
        """Return whether a message is delivered; ``others`` returns those of the connections of the port."""
        seen = MonitoredMessage(message)
        if not self._call(lambda monitor: bool(monitor.accept(seen)), default=True):
            return False
        if self._monitor is None or not self._monitor.constraint:
            return True
        for other in others():
            if other is not self:
                other.trig()
        return self._call(lambda monitor: monitor.holds(), default=True)

    def updated(self, message: IncomingMessage) -> object | None:
        """Return what a message becomes; None if it stays as it is."""
        return self._changed(message, "update") if self._replaces else None

    def updated_reply(self, reply: IncomingMessage) -> object | None:
        """Return what a reply becomes; None if it stays as it is."""
        return self._changed(reply, "update_reply") if self._answers else None

    def _changed(self, message: IncomingMessage, method: str) -> object | None:
        seen = MonitoredMessage(message)
        found = self._call(lambda monitor: getattr(monitor, method)(seen), default=seen)
        if found is seen or found is None:
            return None
        return self._call(lambda _: _with_codec(found), default=None)

    def trig(self) -> None:
        """Let the monitor look at the time."""
        self._call(lambda monitor: monitor.trig(), default=None)

    def set(self, settings: Bottle) -> None:
        """Give the monitor settings."""
        self._call(lambda monitor: monitor.setparam(settings), default=None)

    def get(self) -> Property:
        """Ask the monitor for its settings."""
        found = self._call(lambda monitor: monitor.getparam(), default=Property())
        return found if isinstance(found, Property) else Property()

    def end(self, reason: str = "") -> None:
        """End the monitor; ``reason`` is reported unless it is empty."""
        with self._lock:
            monitor = self._monitor
            if monitor is None:
                return
            if not reason:
                self._call(lambda one: one.destroy(), default=None)
            self._monitor = None
        self._over.set()
        _WATCHDOG.discard(self)
        EVENTS.forget(monitor)
        if reason:
            self._report(f"the port monitor {self.name.file} has ended: {reason}; messages pass as they are")

    # Calls ------------------------------------------------------------------------------------------------------------

    def _call(self, what: Callable[[PortMonitor], R], *, default: R) -> R:
        """Call the monitor; its error ends it, and the result is the default."""
        with self._lock:
            monitor = self._monitor
            if monitor is None:
                return default
            try:
                return self._timed(monitor, what)
            except TooLongError:
                self._clear()
                reason = f"a call took more than {LIMIT:g} s"
            except Exception as error:  # noqa: BLE001 - of the script, whatever it is
                reason = f"{type(error).__name__}: {error}"
            self.end(reason)
            return default

    def _timed(self, monitor: PortMonitor, what: Callable[[PortMonitor], R]) -> R:
        if self._thread:  # a call within a call
            return what(monitor)
        self._began = clock.monotonic()
        self._thread = threading.get_ident()
        try:
            found = what(monitor)
        finally:
            struck = self._clear()
        if struck:
            raise TooLongError
        return found

    def _clear(self) -> bool:
        """End the watch over a call. Return whether it was struck; an exception that is on its way arrives here.

        It is never called back: Python 3.11 would then look for it at every jump, and for ever in a profiler.
        """
        struck = False
        while True:
            try:
                with self._guard:
                    struck, self._thread, self._struck = struck or self._struck, 0, False
                for _ in range(_JUMPS if struck else 0):
                    pass
            except TooLongError:
                struck = True
            else:
                return struck

    def strike(self, now: float) -> None:
        """Raise TooLongError in the thread of a call that takes too long. Called by the watchdog, again and again."""
        with self._guard:
            if self._thread and now - self._began > LIMIT:
                self._struck = True
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._thread), ctypes.py_object(TooLongError))

    def _trigger(self) -> None:
        while (monitor := self._monitor) is not None:
            interval = monitor.trig_interval
            if self._over.wait(interval if interval > 0 else _LOOK):
                return
            if interval > 0:
                self.trig()


def _overridden(monitor: PortMonitor | None, method: str) -> bool:
    return getattr(type(monitor), method) is not getattr(PortMonitor, method)


def _with_codec(value: object) -> object:
    codec_of(value)
    return value


class _Watchdog:
    """One thread that looks for calls that take too long, while there are monitors."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watched: set[Attached] = set()
        self._running = False

    def add(self, one: Attached) -> None:
        """Watch the calls of a monitor."""
        with self._lock:
            self._watched.add(one)
            if not self._running:
                self._running = True
                threading.Thread(target=self._watch, name="rtf-monitors", daemon=True).start()

    def discard(self, one: Attached) -> None:
        """Watch it no more."""
        with self._lock:
            self._watched.discard(one)

    def _watch(self) -> None:
        pause = threading.Event()
        while True:
            pause.wait(_LOOK)
            with self._lock:
                watched = [*self._watched]
                self._running = bool(watched)
            if not watched:
                return
            for one in watched:
                one.strike(clock.monotonic())


_WATCHDOG = _Watchdog()
