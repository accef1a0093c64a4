"""MCAP files, written and read by the package ``mcap``: a channel for each stream, with a schema that Foxglove knows.

The times of a message are that of its arrival (``log_time``) and that of its stamp (``publish_time``), its ``sequence``
is the number of the stamp. When sources came and went are metadata.
"""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from typing import IO, TYPE_CHECKING

from rtf.errors import RtfError
from rtf.middleware.types.image import Image
from rtf.recording import mcap_messages as messages
from rtf.recording.dumper import DiskError
from rtf.recording.errors import MissingPackageError, RecordingError
from rtf.recording.sample import Recording, Sample, Store, Stream

try:
    import lz4.frame  # type: ignore[import-untyped]  # noqa: F401 - raises RuntimeError for damaged data
    import zstandard
    from mcap.exceptions import McapError, RecordLengthLimitExceeded
    from mcap.reader import make_reader
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import CRCValidationError, StreamReader
    from mcap.writer import CompressionType, Writer
except ImportError as missing:
    raise MissingPackageError(f"MCAP needs the package mcap: pip install 'rtf[mcap]' ({missing})") from missing

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

_MAGIC = b"\x89MCAP0\r\n"
_MAX_TIME = (1 << 64) - 1
#: What the package raises for a damaged file.
_DAMAGE = (
    McapError,
    CRCValidationError,
    struct.error,
    zlib.error,
    zstandard.ZstdError,
    RuntimeError,
    ValueError,
    KeyError,
    OverflowError,
    MemoryError,
)
_SCHEMAS = {messages.BOTTLE_SCHEMA: "json", messages.IMAGE_SCHEMA: "cdr"}


class McapFile(Store):
    """An MCAP file that is being written; there must be no such file. Raises RecordingError."""

    period = 1.0

    def __init__(self, path: Path) -> None:
        self.path = path
        self._channels: dict[tuple[str, bool], int] = {}
        self._schemas: dict[bool, int] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: IO[bytes] | None = path.open("xb")
        except FileExistsError:
            raise RecordingError(f"{path} is there already; give a file that is new") from None
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from None
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(library="rtf")
        self.flush()

    def add(self, sample: Sample) -> None:
        value, stamp = sample.value, sample.stamp
        is_image = isinstance(value, Image)
        if isinstance(value, Image):
            data = messages.image_to_cdr(value, stamp, sample.source.strip("/"))
        else:
            data = messages.bottle_to_json(value, stamp)
        channel = self._channels.get((sample.source, is_image)) or self._channel(sample.source, is_image=is_image)
        arrived = _nano(sample.time)
        try:
            self._writer.add_message(
                channel, arrived, data, _nano(stamp.time) if stamp.valid else arrived, max(stamp.count, 0)
            )
        except OSError as error:
            raise self._failed(error) from None

    def note(self, time: float, source: str, *, connected: bool) -> None:
        what = "connected" if connected else "disconnected"
        try:
            self._writer.add_metadata(what, {"port": source, "time": f"{time:.6f}"})
        except OSError as error:
            raise self._failed(error) from None

    def flush(self) -> None:
        try:
            self._writer.flush()  # type: ignore[no-untyped-call]
        except OSError as error:
            raise self._failed(error) from None

    def close(self) -> None:
        file, self._file = self._file, None
        if file is None:
            return
        try:
            with file:
                self._writer.finish()  # type: ignore[no-untyped-call]
        except OSError as error:
            raise self._failed(error) from None

    def _channel(self, source: str, *, is_image: bool) -> int:
        name = messages.IMAGE_SCHEMA if is_image else messages.BOTTLE_SCHEMA
        if is_image not in self._schemas:
            encoding, definition = (
                ("ros2msg", messages.IMAGE_DEFINITION) if is_image else ("jsonschema", messages.BOTTLE_DEFINITION)
            )
            self._schemas[is_image] = self._writer.register_schema(name, encoding, definition)
        channel = self._writer.register_channel(source, _SCHEMAS[name], self._schemas[is_image])
        self._channels[source, is_image] = channel
        return channel

    def _failed(self, error: OSError) -> DiskError:
        """Close the file as it is: its end cannot be written."""
        file, self._file = self._file, None
        if file is not None:
            with suppress(OSError):  # which says the same again
                file.close()
        return DiskError(f"{self.path} cannot be written: {error.strerror}")


def _nano(seconds: float) -> int:
    return min(max(messages.nanoseconds(seconds), 0), _MAX_TIME)


class McapRecording(Recording):
    """An MCAP file of this package. Channels of other schemas are left out. Raises RecordingError."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes = []
        self._images: dict[str, bool] = {}
        foreign = set()
        for topic, schema in self._channels():
            if schema in _SCHEMAS:
                self._images[topic] = self._images.get(topic, False) or schema == messages.IMAGE_SCHEMA
            else:
                foreign.add(f"{topic} ({schema or 'without a schema'})")
        if foreign:
            self.leave_out(f"{path}: streams of other programs are left out: {', '.join(sorted(foreign))}")

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(Stream(source, str(self.path), images) for source, images in sorted(self._images.items()))

    def samples(self, sources: Collection[str]) -> Iterator[Sample]:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels.get(record.channel_id)
                if channel is None:
                    raise RecordingError(f"{self.path}: a message of channel {record.channel_id}, which is not there")
                schema = schemas.get(channel.schema_id)
                if schema is not None and schema.name in _SCHEMAS and channel.topic in sources:
                    yield self._sample(channel.topic, schema.name, record)

    def _sample(self, topic: str, schema: str, record: Message) -> Sample:
        try:
            if schema == messages.IMAGE_SCHEMA:
                value, stamp = messages.cdr_to_image(record.data, record.sequence)
                return Sample(topic, record.log_time / messages.NANO, stamp, value)
            bottle, stamp = messages.json_to_bottle(record.data)
            return Sample(topic, record.log_time / messages.NANO, stamp, bottle)
        except RtfError as error:
            raise RecordingError(f"{self.path}: {topic} at {record.log_time / messages.NANO:.9f}: {error}") from None

    def _channels(self) -> list[tuple[str, str]]:
        """Return topics and names of schemas: from the summary, or, without one, from the whole file."""
        with self._opened() as file:
            try:
                summary = make_reader(file).get_summary()
            except (*_DAMAGE, OSError):  # a file that was not finished, or is none: reading it says more
                summary = None
        if summary is not None:
            schemas, channels = summary.schemas, summary.channels
        else:
            schemas, channels = {}, {}
            for record in self._records():
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
        names = {number: schema.name for number, schema in schemas.items()}
        return [(channel.topic, names.get(channel.schema_id, "")) for channel in channels.values()]

    def _records(self) -> Iterator[object]:
        """Yield the records of the file. One that ends early, as after a crash, gives those that are whole."""
        with self._opened() as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise RecordingError(f"{self.path} is no MCAP file")
            size = file.seek(0, 2)
            file.seek(0)
            try:
                yield from StreamReader(file, record_size_limit=size).records
            except RecordLengthLimitExceeded:
                self.leave_out(
                    f"{self.path}: its last record is cut off, and left out: it was not finished, or is damaged"
                )
            except _DAMAGE as error:
                if file.tell() < size:
                    raise RecordingError(f"{self.path}: damaged before byte {file.tell()}: {error}") from None
                self.leave_out(f"{self.path}: the file was not finished, and its end is left out")
            except OSError as error:
                raise RecordingError(f"{self.path} cannot be read: {error.strerror}") from None

    def _opened(self) -> IO[bytes]:
        try:
            return self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be read: {error.strerror}") from None
