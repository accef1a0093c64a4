"""Recording and playing what ports send: folders of YARP's data dumper, and MCAP files."""

from rtf.recording.errors import MissingPackageError, RecordingError
from rtf.recording.files import create_store, open_recording
from rtf.recording.player import Player
from rtf.recording.recorder import Recorder
from rtf.recording.sample import Sample, Store, Stream

__all__ = [
    "MissingPackageError",
    "Player",
    "Recorder",
    "RecordingError",
    "Sample",
    "Store",
    "Stream",
    "create_store",
    "open_recording",
]
