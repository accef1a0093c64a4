"""The player: a port for each stream of a recording, under the name of the port that was recorded."""

from __future__ import annotations

from contextlib import ExitStack
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.errors import did_you_mean
from rtf.middleware.errors import ConnectError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from rtf.recording.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Collection
    from types import TracebackType

    from rtf.middleware.ports.network import Network
    from rtf.recording.sample import Recording

_LOOK = 0.01


class Player:
    """A recording whose ports are open. ``prefix`` is put before their names, ``only`` chooses streams.

    Each of ``only`` is a port, a folder of the recording, or a pattern such as ``/icub/head/*``. Raises RecordingError
    if nothing is left, and ConnectError if there is a port of one of the names already.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        only: Collection[str] = (),
        prefix: str = "",
        network: Network | None = None,
    ) -> None:
        #: Messages that were sent, and the longest delay of one behind its time, in seconds.
        self.sent = 0
        self.latest = 0.0
        self._recording = recording
        self._ports: dict[str, Port] = {}
        with ExitStack() as opening:
            for source in choose(recording, only):
                port = Port(f"{prefix}{source}", network=network, inputs=False)
                self._ports[source] = opening.enter_context(port)
            self._closing = opening.pop_all()

    @property
    def ports(self) -> tuple[Port, ...]:
        """The open ports."""
        return tuple(self._ports.values())

    def await_readers(self, timeout: float) -> tuple[str, ...]:
        """Wait until a port reads from each of these; return those that nobody reads after ``timeout`` seconds."""
        deadline = clock.Deadline.after(timeout)
        while (unread := tuple(port.name for port in self.ports if not port.outputs)) and not deadline.expired:
            clock.sleep(_LOOK)
        return unread

    def play(self, rate: float = 1.0) -> None:
        """Send all messages at their times, ``rate`` times as fast as they came, with their stamps.

        Every reader gets every message: one that is slow delays the others. Raises RecordingError.
        """
        begun = clock.monotonic()
        first: float | None = None
        for sample in self._recording.samples(self._ports):
            first = sample.time if first is None else first
            due = begun + (sample.time - first) / rate
            clock.sleep(due - clock.monotonic())
            self.latest = max(self.latest, clock.monotonic() - due)
            envelope = str(sample.stamp) if sample.stamp.valid else ""
            self._ports[sample.source].write(sample.value, envelope=envelope)
            self.sent += 1

    def close(self) -> None:
        """Close the ports. A second call has no effect."""
        self._closing.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def choose(recording: Recording, only: Collection[str]) -> tuple[str, ...]:
    """Return the sources that are to be played. Raises RecordingError for a name that none has."""
    streams = recording.streams
    if not only:
        if not streams:
            raise RecordingError("there is no stream in this recording")
        return tuple(stream.source for stream in streams)
    chosen: dict[str, None] = {}
    for name in only:
        found = [one.source for one in streams if name in (one.source, Path(one.place).name)]
        found = found or [one.source for one in streams if fnmatchcase(one.source, name)]
        if not found:
            known = [one.source for one in streams]
            raise RecordingError(f"no stream {name!r}{did_you_mean(name, known)}; there are {', '.join(known)}")
        chosen.update(dict.fromkeys(found))
    return tuple(chosen)


def check_free(network: Network, names: Collection[str]) -> None:
    """Raise ConnectError if one of the ports is there already: a robot that runs, or another player."""
    for name in names:
        if remote.exists(network, Contact(name)):
            raise ConnectError(f"there is a port {name} already; play with --prefix, or end the program that has it")
