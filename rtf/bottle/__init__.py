"""Bottles: the values of messages and configuration files, with YARP's types and YARP's text form.

``Bottle.parse('[set] [pos] 0 10.0')`` parses, ``bottle.to_text()`` formats, ``bottle.find("key")`` looks up, and
``as_int``, ``as_float``, ``as_string`` … convert as YARP does. :class:`Property` stores groups by key. The other names
are scalar types that Python does not have. This package uses neither files nor ports.
"""

from rtf.bottle.access import (
    as_bool,
    as_bytes,
    as_float,
    as_float32,
    as_int,
    as_string,
    as_vocab,
    is_bool,
)
from rtf.bottle.balance import Balance, is_complete
from rtf.bottle.bottle import Bottle, as_list, coerce, same
from rtf.bottle.containers import MAX_DEPTH, Value, kind_of
from rtf.bottle.errors import BottleError, BottleLimitError, BottleSyntaxError, BottleTypeError
from rtf.bottle.property import Property, as_dict
from rtf.bottle.reading import MAX_TEXT
from rtf.bottle.values import FALSE, TRUE, Dialect, Float32, Int8, Int16, Int64, Kind, Vocab, Vocab64
from rtf.bottle.writing import to_string, to_text

__all__ = [
    "FALSE",
    "MAX_DEPTH",
    "MAX_TEXT",
    "TRUE",
    "Balance",
    "Bottle",
    "BottleError",
    "BottleLimitError",
    "BottleSyntaxError",
    "BottleTypeError",
    "Dialect",
    "Float32",
    "Int8",
    "Int16",
    "Int64",
    "Kind",
    "Property",
    "Value",
    "Vocab",
    "Vocab64",
    "as_bool",
    "as_bytes",
    "as_dict",
    "as_float",
    "as_float32",
    "as_int",
    "as_list",
    "as_string",
    "as_vocab",
    "coerce",
    "is_bool",
    "is_complete",
    "kind_of",
    "same",
    "to_string",
    "to_text",
]
