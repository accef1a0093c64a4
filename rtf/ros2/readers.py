"""Messages that have arrived at a reader, and callbacks with them. One that cannot be read is told and skipped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cyclonedds.core import Listener
from cyclonedds.idl import IdlStruct

from rtf.ros2.errors import MalformedMessageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

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


class Arrival(Listener):
    """Calls back with each message that has arrived, in a thread of the DDS, which an error must not end."""

    def __init__(self, callback: Callable[[Any], object], report: Callable[[str], None]) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._callback, self._report = callback, report

    def on_data_available(self, reader: DataReader[Any]) -> None:
        for message in taken(reader, self._report):
            try:
                self._callback(message)
            except Exception as error:  # noqa: BLE001 - whatever it is, the next message is taken
                self._report(f"{reader.topic.name}: {type(error).__name__}: {error}")
