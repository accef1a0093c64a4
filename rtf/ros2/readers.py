"""What arrives at a reader, and callbacks with it: a message that cannot be read is reported and skipped."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, NamedTuple

from cyclonedds.core import Listener
from cyclonedds.idl import IdlStruct

from rtf.ros2.errors import MalformedMessageError

if TYPE_CHECKING:
    import uuid
    from collections.abc import Callable, Iterator

    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader


def taken(reader: DataReader[Any], report: Callable[[str], None]) -> Iterator[Any]:
    """Yield the messages that have arrived, with their ``sample_info``; ends of writers are left out."""
    while True:
        try:
            found = reader.take(N=1)
        except MalformedMessageError as error:
            report(f"{reader.topic.name}: {error}")
            continue
        if not found:
            return
        if isinstance(found[0], IdlStruct):
            yield found[0]


class Source(NamedTuple):
    """Who has sent a message: a participant of the DDS, which is a program; None of one that has gone since."""

    reader: DataReader[Any]
    writer: int

    @property
    def participant(self) -> uuid.UUID | None:
        """The identifier of the participant."""
        found = self.reader.get_matched_publication_data(self.writer)
        return None if found is None else found.participant_key


class Arrival(Listener):
    """Calls back with each message and its source, in a thread of the DDS, which an error must not end.

    The library calls it while the reader is still being made: messages wait until :meth:`begin`.
    """

    def __init__(self, callback: Callable[[Any, Source], object], report: Callable[[str], None]) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._callback, self._report = callback, report
        self._begun = threading.Event()
        self._order = threading.RLock()

    def begin(self, reader: DataReader[Any]) -> None:
        """Call back with what has arrived so far, and from now on with all that arrives."""
        with self._order:
            self._begun.set()
            self.on_data_available(reader)

    def on_data_available(self, reader: DataReader[Any]) -> None:
        if not self._begun.is_set():
            return
        with self._order:
            for message in taken(reader, self._report):
                try:
                    self._callback(message, Source(reader, message.sample_info.publication_handle))
                except Exception as error:  # noqa: BLE001 - whatever it is, the next message is taken
                    self._report(f"{reader.topic.name}: {type(error).__name__}: {error}")


class Changes(Listener):
    """Sets an event whenever something has arrived, or another end has appeared or gone."""

    def __init__(self, changed: threading.Event) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._changed = changed

    def on_data_available(self, reader: DataReader[Any]) -> None:  # noqa: ARG002 - as the library calls it
        self._changed.set()

    def on_publication_matched(self, writer: DataWriter[Any], status: Any) -> None:  # noqa: ARG002 - likewise
        self._changed.set()

    def on_subscription_matched(self, reader: DataReader[Any], status: Any) -> None:  # noqa: ARG002 - likewise
        self._changed.set()
