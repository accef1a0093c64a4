"""Folders of YARP's data dumper, written: one folder a stream, with ``info.log``, ``data.log`` and files of images.

``info.log`` has the type, which stamps there are, and when sources came and went; ``data.log`` has a line for each
message: count and time of the sender (-1 and 0.0 if it set none), time of the receiver, and the message as text or the
name of its image. Both stamps are what YARP calls ``tx+rx``.
"""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

from rtf.middleware.types.image import Image
from rtf.recording.errors import RecordingError
from rtf.recording.pictures import DEPTH, write_picture
from rtf.recording.sample import Store

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.recording.sample import Sample

_BUFFER = 1 << 16


class DumpFolder(Store):
    """A folder of streams that is being written. It must be new, or empty. Raises RecordingError."""

    period = 0.1

    def __init__(self, path: Path) -> None:
        self.path = path
        self._streams: dict[str, _DumpStream] = {}
        self._notes: dict[str, list[str]] = {}  # of sources that have sent nothing yet
        try:
            path.mkdir(parents=True, exist_ok=True)
            used = any(path.iterdir())
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from None
        if used:
            raise RecordingError(f"{path} is not empty; give a folder that is new")

    def add(self, sample: Sample) -> None:
        stream = self._streams.get(sample.source) or self._open(sample)
        stream.add(sample)

    def note(self, time: float, source: str, *, connected: bool) -> None:
        line = f"[{time:.6f}] {source} [{'connected' if connected else 'disconnected'}]"
        stream = self._streams.get(source)
        if stream is None:
            self._notes.setdefault(source, []).append(line)
        else:
            stream.note(line)

    def flush(self) -> None:
        for stream in self._streams.values():
            stream.flush()

    def close(self) -> None:
        while self._streams:
            self._streams.popitem()[1].close()

    def _open(self, first: Sample) -> _DumpStream:
        """Open the stream of a source: its type is that of its first message."""
        wanted = folder_name(first.source)
        taken = {stream.folder.name for stream in self._streams.values()}
        name, number = wanted, 1
        while name in taken:
            number += 1
            name = f"{wanted}_{number}"
        notes = self._notes.pop(first.source, None) or [f"[{first.time:.6f}] {first.source} [connected]"]
        stream = _DumpStream(self.path / name, _type_of(first), notes)
        self._streams[first.source] = stream
        return stream


class _DumpStream:
    """The folder of one stream."""

    def __init__(self, folder: Path, kind: str, notes: list[str]) -> None:
        self.folder = folder
        self._images = kind != "Bottle"
        self._count = 0
        try:
            folder.mkdir()
            self._data: IO[str] = (folder / "data.log").open(
                "w", _BUFFER, encoding="utf-8", errors="surrogateescape", newline="\n"
            )
            begun = folder / "info.new"  # info.log is there when it says the type, so that no crash leaves it without
            self._info: IO[str] = begun.open("w", encoding="utf-8", errors="surrogateescape")
            for line in (f"Type: {kind};", "Stamp: tx+rx;", *notes):
                self.note(line)
            begun.rename(folder / "info.log")
        except OSError as error:
            raise _failed(folder, error) from None

    def note(self, line: str) -> None:
        try:
            self._info.write(f"{line}\n")
            self._info.flush()
        except OSError as error:
            raise _failed(self.folder / "info.log", error) from None

    def add(self, sample: Sample) -> None:
        value, stamp = sample.value, sample.stamp
        if isinstance(value, Image) != self._images:
            kinds = ("images", "other messages")
            sent, begun = kinds if self._images is False else kinds[::-1]
            raise RecordingError(f"{self.folder}: {sample.source} sends {sent} among {begun}; record it as MCAP")
        try:
            if isinstance(value, Image):
                text = f"{write_picture(self.folder, self._count, value)} [{value.code}]"
            else:
                text = value.to_text().replace("\n", " ")  # only a vocab has a line break that is not escaped
            self._data.write(f"{stamp.count} {stamp.time!r} {sample.time!r} {text}\n")
        except OSError as error:
            raise _failed(self.folder, error) from None
        self._count += 1

    def flush(self) -> None:
        try:
            self._data.flush()
        except OSError as error:
            raise _failed(self.folder / "data.log", error) from None

    def close(self) -> None:
        try:
            with self._info, self._data:
                pass
        except OSError as error:
            raise _failed(self.folder / "data.log", error) from None


def folder_name(source: str) -> str:
    """Return the name of the folder of a port: ``/icub/left_arm/state:o`` is in ``icub_left_arm_state_o``."""
    name = "".join(one if one.isalnum() or one in "-._" else "_" for one in source.strip("/"))
    return name.lstrip(".") or "stream"


def _type_of(first: Sample) -> str:
    if isinstance(first.value, Image):
        return "Depth" if first.value.code == DEPTH else "Image"
    return "Bottle"


def _failed(place: Path, error: OSError) -> DiskError:
    return DiskError(f"{place} cannot be written: {error.strerror}")


class DiskError(RecordingError):
    """A file cannot be written any more, as of a full disk. What was written before can be read."""
