"""What travels in the questions of a control board: how each kind of value stands in a bottle, and is read from one.

Reading is strict, as what is read moves robots: a word where a number belongs, or a number that is none, is refused
instead of being taken for 0. Whole numbers are taken for floats and the other way round, as people type them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.bottle import Bottle, Value, Vocab, as_int
from rtf.bottle.values import INT32_MAX, INT32_MIN
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CalibrationParameters, JointType, MotorTorqueParameters, Pid, PidType

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from enum import IntEnum


class Kind(NamedTuple):
    """One kind of argument or result of a device's method.

    ``write`` makes the elements of a bottle of a result, ``read`` makes of such elements what the method takes or
    gives, one object for each parameter; it raises RefusedError for anything else. ``Any``: each kind has its own.
    """

    write: Callable[[Any], list[Value]]
    read: Callable[[Sequence[Value]], tuple[Any, ...]]


def number(value: Value | None) -> float:
    """A finite number. Raises RefusedError."""
    if type(value) is float and math.isfinite(value):  # as nearly always
        return value
    if isinstance(value, int | float) and math.isfinite(value):
        return float(value)
    raise RefusedError(f"a finite number is needed, not {_shown(value)}")


def whole(value: Value | None) -> int:
    """A whole number of 32 bits, such as that of a joint. Raises RefusedError."""
    if type(value) is int and INT32_MIN <= value <= INT32_MAX:  # as nearly always
        return value
    if isinstance(value, int | float) and math.isfinite(value) and value == as_int(value, 32):
        return int(value)
    raise RefusedError(f"a whole number is needed, not {_shown(value)}")


def _truth(value: Value) -> bool:
    return value != 0 if type(value) is int else bool(whole(value))


def inner(value: Value | None, count: int | None = None) -> Bottle:
    """A list, of so many elements if that is said. Raises RefusedError."""
    if isinstance(value, Bottle) and count in (None, len(value)):
        return value
    raise RefusedError(f"a list of {'some' if count is None else count} values is needed, not {_shown(value)}")


def _shown(value: Value | None) -> str:
    return "nothing" if value is None else repr(str(value)[:60])


def _exactly(values: Sequence[Value], count: int) -> Sequence[Value]:
    if len(values) != count:
        raise RefusedError(f"{count} values are needed, {len(values)} came")
    return values


def _enumerated(kind: type[IntEnum], value: Value) -> IntEnum:
    """A member, from its word or its number."""
    if isinstance(value, int | Vocab) and int(value) in kind.__members__.values():
        return kind(int(value))
    raise RefusedError(f"{_shown(value)} is no {kind.__name__}")


def _alone(write: Callable[[Any], Value], read: Callable[[Value], Any]) -> Kind:
    def read_alone(values: Sequence[Value]) -> tuple[Any, ...]:
        return (read(values[0] if len(values) == 1 else _exactly(values, 1)[0]),)

    return Kind(lambda value: [write(value)], read_alone)


def _word(kind: type[IntEnum]) -> Kind:
    return _alone(lambda value: Vocab(int(value)), lambda value: _enumerated(kind, value))


def _structure(make: Callable[..., Any], count: int) -> Kind:
    """A tuple of numbers that travels as a list of its own, and is one parameter."""
    return _alone(_floats, lambda value: make(*map(number, inner(value, count))))


def _floats(values: Sequence[float]) -> Bottle:
    return Bottle.adopt([float(value) for value in values])


def _flat(count: int) -> Kind:
    """So many numbers side by side, each a parameter."""
    return Kind(
        lambda values: [float(value) for value in values],
        lambda values: tuple(map(number, _exactly(values, count))),
    )


def _listed(count: int) -> Kind:
    """So many numbers in a list of their own, each a parameter."""
    return Kind(
        lambda values: [_floats(values)],
        lambda values: tuple(map(number, inner(_exactly(values, 1)[0], count))),
    )


def _key(value: Value) -> str:
    if isinstance(value, str | Vocab):
        return str(value)
    raise RefusedError(f"a name is needed, not {_shown(value)}")


def _calibration(values: Sequence[Value]) -> tuple[CalibrationParameters]:
    """The type of the procedure and its parameters, as many as are given."""
    kind, *parameters = values or [0]
    if len(parameters) >= len(CalibrationParameters._fields):
        raise RefusedError(f"a calibration has at most 6 parameters, {len(parameters)} came")
    return (CalibrationParameters(whole(kind), *map(number, parameters)),)


#: Nothing at all.
NOTHING = Kind(lambda _: [], lambda values: tuple(_exactly(values, 0)))
#: What is passed over.
ANYTHING = Kind(lambda _: [], lambda _: ())
FLOAT = _alone(float, number)
INT = _alone(int, whole)
#: 0 or 1.
FLAG = _alone(int, _truth)
TEXT = _alone(str, _key)
MODE = _word(ControlMode)
INTERACTION_MODE = _word(InteractionMode)
PID_TYPE = _word(PidType)
#: A word that travels as its number.
JOINT_TYPE = _alone(int, lambda value: _enumerated(JointType, value))
#: Least and greatest.
RANGE = _flat(2)
#: The same for all joints: the list of the least, and that of the greatest. What is read are the two lists.
RANGES = Kind(
    lambda ranges: [_floats([low for low, _ in ranges]), _floats([high for _, high in ranges])],
    lambda values: tuple([number(one) for one in inner(value)] for value in _exactly(values, 2)),
)
IMPEDANCE = _listed(2)
IMPEDANCE_OFFSET = Kind(lambda value: [_floats([value])], _listed(1).read)
IMPEDANCE_LIMITS = _listed(4)
PID = _structure(Pid, 10)
PIDS = _alone(
    lambda pids: Bottle.adopt([_floats(pid) for pid in pids]),
    lambda value: tuple(Pid(*map(number, inner(one, 10))) for one in inner(value)),
)
MOTOR_TORQUE = _structure(MotorTorqueParameters, 9)
FAULT = Kind(
    lambda fault: [int(fault[0]), str(fault[1])],
    lambda values: (whole(_exactly(values, 2)[0]), str(values[1])),
)
CALIBRATION = Kind(lambda parameters: [int(parameters[0]), *map(float, parameters[1:])], _calibration)
#: What a remote variable holds: in an answer a list of its own, in a request all that follows the name.
VARIABLE = Kind(lambda bottle: [bottle], lambda values: (Bottle(values),))
NAMES = _alone(lambda names: Bottle.adopt(list(names)), lambda value: tuple(map(_key, inner(value))))
