"""Folders of YARP's data dumper, read: those that :mod:`rtf.recording.dumper` writes, and those of YARP."""

from __future__ import annotations

import re
from heapq import merge
from math import isfinite
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle
from rtf.bottle.values import INT32_MAX
from rtf.errors import Location, RtfError
from rtf.middleware.types.stamp import Stamp
from rtf.recording.errors import RecordingError
from rtf.recording.pictures import read_picture
from rtf.recording.sample import Recording, Sample, Stream

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

    from rtf.middleware.types.image import Image

#: The types of messages, and whether they are images.
TYPES = {
    "Bottle": False,
    "Image": True,
    "Image:ppm": True,
    "Image:jpg": True,
    "Image:png": True,
    "Depth": True,
    "DepthCompressed": True,
}
_STAMPS = ("rx", "tx", "tx+rx")
_EVENT = re.compile(r"\[[^\]]*\]\s+(?P<source>/\S*)\s+\[connected\]")
_PICTURE = re.compile(r"(?P<name>[^/\s]+)(?:\s+\[(?P<code>[^\]]*)\])?\s*")
#: The longest line that is read, in bytes, and the most lines of ``info.log``.
_MAX_LINE, _MAX_EVENTS = 64 << 20, 100_000


class Info(NamedTuple):
    """What ``info.log`` says: type, stamps, and the port that was recorded; an empty name if it is not said."""

    kind: str
    stamps: str
    source: str


class DumpRecording(Recording):
    """The streams in a folder and in those below it. Raises RecordingError, also if there is none."""

    def __init__(self, path: Path) -> None:
        self.notes = []
        self._streams: dict[str, tuple[Path, Info]] = {}
        for file in sorted(path.rglob("info.log")):
            info = parse_info(_read(file), str(file))
            source = info.source or f"/{file.parent.name}"
            if source in self._streams:
                raise RecordingError(f"{file}: {source} is in {self._streams[source][0]}, too; play one of them")
            self._streams[source] = file.parent, info
        if not self._streams:
            raise RecordingError(f"{path}: there is no info.log in it, nor in a folder below it")

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(
            Stream(source, str(folder), TYPES[info.kind]) for source, (folder, info) in sorted(self._streams.items())
        )

    def samples(self, sources: Collection[str]) -> Iterator[Sample]:
        wanted = [self._samples(source) for source in self._streams if source in sources]
        return merge(*wanted, key=attrgetter("time"))

    def _samples(self, source: str) -> Iterator[Sample]:
        folder, info = self._streams[source]
        path = folder / "data.log"
        try:
            with path.open("rb") as file:
                number = 0
                while data := file.readline(_MAX_LINE):
                    number += 1
                    if not data.endswith(b"\n"):
                        self.leave_out(f"{path}:{number}: the last line is cut off, and left out")
                        return
                    text = data.decode("utf-8", "surrogateescape")
                    yield parse_line(text, info, source, folder, Location(str(path), number))
        except OSError as error:
            raise RecordingError(f"{path} cannot be read: {error.strerror}") from None


def _read(file: Path) -> str:
    try:
        with file.open("rb") as opened:
            return opened.read(_MAX_LINE).decode("utf-8", "surrogateescape")
    except OSError as error:
        raise RecordingError(f"{file} cannot be read: {error.strerror}") from None


def parse_info(text: str, file: str = "info.log") -> Info:
    """Parse the text of an ``info.log``. Raises RecordingError with file and line."""
    lines = text.split("\n", _MAX_EVENTS)
    kind, stamps, source = "", "rx", ""
    for number, line in enumerate(lines, 1):
        word, _, rest = line.partition(":")
        value = rest.partition(";")[0].strip()
        if word == "Type":
            kind = _known(value, TYPES, Location(file, number))
        elif word == "Stamp":
            stamps = _known(value, _STAMPS, Location(file, number))
        elif not source and (found := _EVENT.match(line)):
            source = found["source"]
    if not kind:
        raise RecordingError(f"{file}:1: it does not say 'Type: Bottle;', or another of {', '.join(TYPES)}")
    return Info(kind, stamps, source)


def _known(value: str, known: Collection[str], where: Location) -> str:
    if value not in known:
        raise RecordingError(f"{where}: {value[:40]!r} is not one of {', '.join(known)}")
    return value


def parse_line(text: str, info: Info, source: str, folder: Path, where: Location) -> Sample:
    """Parse a line of a ``data.log``; the image that it names is read from ``folder``. Raises RecordingError."""
    words = text.split(maxsplit=1)
    count = _count(words[0] if words else "", where)
    # the data dumper adds the receiver's time to a message without a stamp even if only the sender's is asked for
    both = info.stamps == "tx+rx" or (info.stamps == "tx" and count < 0)
    columns = 3 if both else 2
    parts = text.split(maxsplit=columns)
    times = [_time(part, where) for part in parts[1:columns]]
    if len(times) < columns - 1:
        raise RecordingError(f"{where}: a line is a count, {columns - 1} times and a message, not {text[:60]!r}")
    stamp = Stamp(count, times[0]) if count >= 0 else Stamp()
    rest = parts[columns] if len(parts) > columns else ""
    if TYPES[info.kind]:
        return Sample(source, times[-1], stamp, _picture(rest, folder, where))
    try:
        return Sample(source, times[-1], stamp, Bottle.parse(rest))
    except RtfError as error:
        raise RecordingError(f"{where}: {error}") from None


def _picture(text: str, folder: Path, where: Location) -> Image:
    found = _PICTURE.fullmatch(text)
    if found is None:
        raise RecordingError(
            f"{where}: {text[:60]!r} is not the name of an image with its pixels, '00000000.ppm [rgb]'"
        )
    path = folder / found["name"]
    if not path.suffix:
        raise RecordingError(f"{where}: images that were recorded as a film cannot be played")
    return read_picture(path, found["code"] or "")


def _count(text: str, where: Location) -> int:
    number = text.removeprefix("-")
    if not (number.isascii() and number.isdecimal() and len(number) <= len(str(INT32_MAX))):
        raise RecordingError(f"{where}: {text[:60]!r} is not the number of a message")
    if not -1 <= int(text) <= INT32_MAX:
        raise RecordingError(f"{where}: the number of a message is from -1 to {INT32_MAX}, not {text}")
    return int(text)


def _time(text: str, where: Location) -> float:
    try:
        time = float(text)
    except ValueError:
        time = float("nan")
    if not isfinite(time):
        raise RecordingError(f"{where}: {text[:60]!r} is not a time in seconds")
    return time
