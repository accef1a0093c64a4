"""Classes of YARP that interface files name: vectors, pictures, bottles, with the codecs that write them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Bottle, Property, coerce
from rtf.idl.types import NativeType
from rtf.middleware.types import IMAGE, MATRIX, PROPERTY, SOUND, STAMP, VECTOR, Image, Sound, Stamp, vector_of
from rtf.middleware.types.codecs import BOTTLE

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.types.codecs import Codec


def _array(kind: str, dimensions: int) -> Callable[[Any], object]:
    def make(value: Any) -> object:
        array = np.ascontiguousarray(value, dtype=kind)
        if array.ndim != dimensions:
            raise ValueError(f"{array.ndim} dimensions instead of {dimensions}")
        return array

    return make


def _instance(*kinds: type) -> Callable[[Any], object]:
    def make(value: Any) -> object:
        if not isinstance(value, kinds):
            raise TypeError(f"a {type(value).__name__} is none of {kinds}")
        return value

    return make


#: By name: the codec, what makes a value ready for it, and the value of a field that is not given.
_KNOWN: dict[str, tuple[Codec[Any], Callable[[Any], object], Callable[[], object]]] = {
    "yarp::os::Bottle": (BOTTLE, lambda value: value if isinstance(value, Bottle) else Bottle(value), Bottle),
    "yarp::os::Property": (PROPERTY, Property, Property),
    "yarp::os::Stamp": (STAMP, _instance(Stamp), lambda: Stamp(0, 0.0)),
    "yarp::sig::Vector": (VECTOR, _array("<f8", 1), lambda: np.zeros(0)),
    "yarp::sig::VectorOf<double>": (VECTOR, _array("<f8", 1), lambda: np.zeros(0)),
    "yarp::sig::VectorOf<float>": (vector_of("f4"), _array("<f4", 1), lambda: np.zeros(0, "<f4")),
    "yarp::sig::VectorOf<int>": (vector_of("i4"), _array("<i4", 1), lambda: np.zeros(0, "<i4")),
    "yarp::sig::Matrix": (MATRIX, _array("<f8", 2), lambda: np.zeros((0, 0))),
    "yarp::sig::FlexImage": (IMAGE, _instance(Image), lambda: None),
    "yarp::sig::Sound": (SOUND, _instance(Sound), lambda: None),
}


@cache
def native(name: str) -> NativeType:
    """Return the type of a class. Values of one that is not known here are elements of bottles, such as Bottle."""
    codec, make, _ = _KNOWN.get(name, (None, coerce, None))
    return NativeType(name, codec, make)


def default_of(name: str) -> Any:
    """Return the value of a field that is not given: an empty one, or an empty bottle for an unknown class."""
    known = _KNOWN.get(name)
    return Bottle() if known is None else known[2]()
