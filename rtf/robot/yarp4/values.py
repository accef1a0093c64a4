"""The values of service functions: the return value, and the types of arguments and results.

A kind converts elements of a message to a value and back. ``take`` raises BottleError for elements of another type, and
RefusedError for an invalid value of the right type, such as the number of a mode that does not exist.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TYPE_CHECKING, Any, TypeVar

from rtf.bottle import Bottle, BottleError, Dialect, Int16, Vocab
from rtf.bottle.binary import LIST, TruncatedBottleError, decode_from, encode_element
from rtf.bottle.tags import pair
from rtf.bottle.values import Kind as Type
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.record import FAILED, OK, Record
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CalibrationParameters, JointType, MotorTorqueParameters, Pid, PidType

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Value
    from rtf.middleware.types.codecs import Buffer

E = TypeVar("E", bound=IntEnum)


# The return value -----------------------------------------------------------------------------------------------------


class ReturnValue(Enum):
    """The result of a call: its word in YARP 4.0, and its number in 3.11 and 3.12."""

    OK = ("ok", 0)
    GENERIC = ("err1", 1)
    NOT_IMPLEMENTED = ("err2", 2)
    COMMUNICATION = ("err3", 3)
    DEPRECATED = ("err4", 4)
    METHOD_FAILED = ("err5", 5)
    NOT_READY = ("err6", 6)
    UNINITIALIZED = ("miss", 100)

    def __init__(self, word: str, number: int) -> None:
        self.word = word
        self.number = number

    @classmethod
    def of(cls, value: Value | None) -> ReturnValue:
        """Decode an element of an answer; unknown errors become the generic one.

        Raises BottleError for an element of another type.
        """
        if isinstance(value, Bottle) and len(value) == 1:
            value = value[0]
        if isinstance(value, Vocab):
            return _BY_WORD.get(value, cls.GENERIC)
        if isinstance(value, int):
            return _BY_NUMBER.get(value, cls.GENERIC)
        raise BottleError(f"an answer begins with a return value, not with {value!r}")

    @property
    def codec(self) -> ReturnValueCodec:
        """The codec of return values."""
        return RETURN_VALUE


class ReturnValueCodec(TextCodec[ReturnValue]):
    """Codec of return values: in YARP 4.0 a list of one word, in 3.x a number without a list."""

    def encode(self, value: ReturnValue, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        if dialect is Dialect.YARP3:
            return (pair.pack(Type.INT32, value.number),)
        return (pair.pack(LIST, 1) + encode_element(Vocab(value.word), dialect),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[ReturnValue, int]:
        if dialect is Dialect.YARP4:
            bottle, end = decode_from(data, 0, dialect)
            return ReturnValue.of(bottle), end
        if len(data) < pair.size:
            raise TruncatedBottleError(pair.size)
        code, number = pair.unpack_from(data)
        if code != Type.INT32:
            raise BottleError(f"a return value is a number, not an element of code {code}")
        return ReturnValue.of(number), pair.size

    def to_text(self, value: ReturnValue) -> str:
        """Return the word, as a tool for YARP 4.0 shows it."""
        return Bottle([Vocab(value.word)]).to_text()

    def from_text(self, text: str) -> ReturnValue:
        """Parse the word."""
        return ReturnValue.of(Bottle.parse(text))


RETURN_VALUE = ReturnValueCodec()
_BY_WORD = {Vocab(one.word): one for one in ReturnValue}
_BY_NUMBER = {one.number: one for one in ReturnValue}


# Kinds and single values ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Kind:
    """A type of value. ``cpp`` is its name in tools, ``default`` its value in an error answer, ``width`` its elements.

    ``take`` gets ``width`` elements. Any: the values have the types of the interfaces.
    """

    cpp: str
    take: Callable[[Sequence[Value]], Any]
    put: Callable[[Any], object]
    default: Any
    width: int = 1


def read_all(kinds: Sequence[Kind], elements: Sequence[Value]) -> list[Any]:
    """Convert elements to values. Raises BottleError for a wrong number of elements or a wrong type."""
    found: list[Any] = []
    wanted = 0
    for kind in kinds:
        wanted += kind.width
    if len(elements) != wanted:
        raise BottleError(f"{len(elements)} values arrived, expected {', '.join(kind.cpp for kind in kinds) or 'none'}")
    at = 0
    for kind in kinds:
        found.append(kind.take(elements[at : at + kind.width]))
        at += kind.width
    return found


def write_all(kinds: Sequence[Kind], values: Sequence[Any]) -> tuple[object, ...]:
    """Convert values, as many as there are kinds, to the fields of a record."""
    return tuple([kind.put(value) for kind, value in zip(kinds, values, strict=True)])


def _whole(value: Value) -> int:
    if isinstance(value, int):
        return int(value)
    raise BottleError(f"an integer was expected, not {value!r}")


def _number(value: Value) -> float:
    if isinstance(value, int | float):
        return float(value)
    raise BottleError(f"a number was expected, not {value!r}")


def _truth(value: Value) -> bool:
    if isinstance(value, Vocab) and value in (OK, FAILED):
        return value == OK
    if isinstance(value, int | Vocab):
        return int(value) != 0
    raise BottleError(f"[ok] or [fail] was expected, not {value!r}")


def _text(value: Value) -> str:
    if isinstance(value, str):
        return value
    raise BottleError(f"a string was expected, not {value!r}")


def _bottle(value: Value) -> Bottle:
    if isinstance(value, Bottle):
        return value
    raise BottleError(f"a list was expected, not {value!r}")


def _member(value: Value, of: type[E]) -> E:
    """Convert an element to an enumeration member; it is sent as a number, and a word is accepted, too."""
    if not isinstance(value, int | Vocab):
        raise BottleError(f"the number of a {of.__name__} was expected, not {value!r}")
    try:
        return of(int(value))
    except ValueError:
        raise RefusedError(f"{int(value)} is not a {of.__name__}") from None


# Kinds ----------------------------------------------------------------------------------------------------------------


def single(cpp: str, take: Callable[[Value], Any], put: Callable[[Any], object], default: object) -> Kind:
    """Return the kind of a value of one element."""
    return Kind(cpp, lambda elements: take(elements[0]), put, default)


def several(one: Kind) -> Kind:
    """Return the kind of a list of values."""
    return Kind(
        f"std::vector<{one.cpp}>",
        lambda elements: [one.take([item]) for item in _bottle(elements[0])],
        lambda values: [one.put(value) for value in values],
        (),
    )


def enumeration(cpp: str, of: type[E], default: E) -> Kind:
    """Return the kind of a member of an enumeration, which is sent as a number."""
    return single(cpp, lambda value: _member(value, of), int, default)


def _structure(cpp: str, of: Callable[..., tuple[Any, ...]], takes: Sequence[Callable[[Value], Any]]) -> Kind:
    """Return the kind of a structure, whose fields are consecutive elements."""

    def take(elements: Sequence[Value]) -> tuple[Any, ...]:
        return of(*(take(value) for take, value in zip(takes, elements, strict=True)))

    return Kind(cpp, take, tuple, of(), len(takes))


# The order of a PID's fields in the service; the class has the order of YARP 3.
_PID_ORDER = (
    *("kp", "kd", "ki", "max_integral", "scale", "max_output"),
    *("offset", "stiction_up", "stiction_down", "feedforward"),
)
#: The number of texts: three descriptions and the units of the ten numbers.
_INFO_TEXTS = 13


def _take_pid(value: Value) -> Pid:
    gains = [_number(item) for item in _bottle(value)]
    if len(gains) != len(_PID_ORDER):
        raise BottleError(f"a PID has {len(_PID_ORDER)} numbers, not {len(gains)}")
    return Pid(**dict(zip(_PID_ORDER, gains, strict=True)))


def _put_pid(pid: Pid) -> Record:
    return Record(*(float(getattr(pid, name)) for name in _PID_ORDER))


def _take_texts(value: Value) -> list[str]:
    texts = [_text(item) for item in _bottle(value)]
    if len(texts) != _INFO_TEXTS:
        raise BottleError(f"the information of a PID has {_INFO_TEXTS} strings, not {len(texts)}")
    return texts


def _take_map(value: Value) -> dict[str, bool]:
    found = {}
    for entry in _bottle(value):
        key, holds = read_all((TEXT, TRUTH), _bottle(entry))
        found[key] = holds
    return found


#: The number of a joint or a motor.
AXIS = single("std::int32_t", _whole, int, 0)
#: An axis as a 16-bit number, as in some functions; wider numbers are accepted.
AXIS16 = single("std::int16_t", _whole, Int16, 0)
WHOLE = AXIS
NUMBER = single("double", _number, float, 0.0)
TRUTH = single("bool", _truth, bool, default=False)
TEXT = single("std::string", _text, str, "")
AXES = several(AXIS)
WHOLES = AXES
NUMBERS = several(NUMBER)
BOTTLE = single("yarp::os::Bottle", _bottle, Bottle, Bottle())
BOTTLES = several(BOTTLE)
TRUTHS = single("std::map<std::string, bool>", _take_map, dict, {})
MODE = enumeration("yarp::dev::SelectableControlModeEnum", ControlMode, ControlMode.UNKNOWN)
MODES = several(MODE)
INTERACTION = enumeration("yarp::dev::InteractionModeEnum", InteractionMode, InteractionMode.UNKNOWN)
INTERACTIONS = several(INTERACTION)
JOINT_TYPE = enumeration("yarp::dev::JointTypeEnum", JointType, JointType.UNKNOWN)
PID_TYPE = enumeration("yarp::dev::PidControlTypeEnum", PidType, PidType.POSITION)
PID_TYPES = several(PID_TYPE)
PID = single("yarp::dev::Pid", _take_pid, _put_pid, Pid())
PIDS = several(PID)
PID_INFO = single("yarp::dev::PidExtraInfo", _take_texts, lambda texts: Record(*texts), ("",) * _INFO_TEXTS)
PID_INFOS = several(PID_INFO)
CALIBRATION = _structure("yCalibrationParameters", CalibrationParameters, (_whole, *[_number] * 6))
TORQUE_PARAMETERS = _structure("yMotorTorqueParameters", MotorTorqueParameters, (_number,) * 9)
