"""The formats of recordings, by name and by what is at a path."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.recording.dump_reading import DumpRecording
from rtf.recording.dumper import DumpFolder
from rtf.recording.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.recording.sample import Recording, Store

FORMATS = ("dumper", "mcap")
_SUFFIX = ".mcap"


def format_of(path: Path) -> str:
    """Return the format that a path stands for: files that end with ``.mcap`` are MCAP, all others the dumper's."""
    return "mcap" if path.suffix == _SUFFIX else "dumper"


def create_store(path: Path, kind: str = "") -> Store:
    """Begin a recording: a folder of the data dumper's, or a file ``.mcap``. ``kind`` is a format, else the path's.

    Raises RecordingError if it cannot be written or is there already, and MissingPackageError.
    """
    if (kind or format_of(path)) == "mcap":
        from rtf.recording.mcap_file import McapFile

        return McapFile(path)
    return DumpFolder(path)


def open_recording(path: Path) -> Recording:
    """Open a recording: a folder with ``info.log``, or with folders of such, or an MCAP file.

    Raises RecordingError, and MissingPackageError.
    """
    if path.is_dir():
        return DumpRecording(path)
    if path.name in ("data.log", "info.log"):
        return DumpRecording(path.parent)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder")
    from rtf.recording.mcap_file import McapRecording

    return McapRecording(path)
