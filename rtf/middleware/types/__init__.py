"""The types of messages besides bottles, each with its codec.

A name is imported on first use, because most of these need numpy and most programs need only some.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.middleware.types.image import IMAGE, Image, ImageCodec
    from rtf.middleware.types.matrix import MATRIX
    from rtf.middleware.types.pair import Pair, PairCodec
    from rtf.middleware.types.plain import BYTES, PROPERTY, STRING
    from rtf.middleware.types.point_cloud import POINT_CLOUD, PointCloud
    from rtf.middleware.types.record import Record, call, read_call
    from rtf.middleware.types.service import FAIL, Function, Service
    from rtf.middleware.types.sound import SOUND, Sound
    from rtf.middleware.types.stamp import STAMP, Stamp
    from rtf.middleware.types.vector import VECTOR, VectorCodec, vector_of
    from rtf.middleware.types.version import ProtocolVersion

_HOMES = {
    "image": ("IMAGE", "Image", "ImageCodec"),
    "matrix": ("MATRIX",),
    "pair": ("Pair", "PairCodec"),
    "plain": ("BYTES", "PROPERTY", "STRING"),
    "point_cloud": ("POINT_CLOUD", "PointCloud"),
    "record": ("Record", "call", "read_call"),
    "service": ("FAIL", "Function", "Service"),
    "sound": ("SOUND", "Sound"),
    "stamp": ("STAMP", "Stamp"),
    "vector": ("VECTOR", "VectorCodec", "vector_of"),
    "version": ("ProtocolVersion",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "BYTES",
    "FAIL",
    "IMAGE",
    "MATRIX",
    "POINT_CLOUD",
    "PROPERTY",
    "SOUND",
    "STAMP",
    "STRING",
    "VECTOR",
    "Function",
    "Image",
    "ImageCodec",
    "Pair",
    "PairCodec",
    "PointCloud",
    "ProtocolVersion",
    "Record",
    "Service",
    "Sound",
    "Stamp",
    "VectorCodec",
    "call",
    "read_call",
    "vector_of",
]


def __getattr__(name: str) -> object:
    """Import the module that defines a name."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{home}"), name)
