"""The kinds of values in the requests of a control board: their encoding in a bottle, and their decoding.

Decoding is strict, see :mod:`rtf.robot.network.elements`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.bottle import Bottle, Value, Vocab
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CalibrationParameters, JointType, MotorTorqueParameters, Pid, PidType
from rtf.robot.network.elements import inner, number, shown, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from enum import IntEnum


class Kind(NamedTuple):
    """A kind of argument or result of a device's method.

    ``write`` encodes a result as elements of a bottle. ``read`` decodes such elements to a tuple with one object for
    each parameter, and raises RefusedError for anything else. ``Any``: each kind has its own types.
    """

    write: Callable[[Any], list[Value]]
    read: Callable[[Sequence[Value]], tuple[Any, ...]]


def _truth(value: Value) -> bool:
    return value != 0 if type(value) is int else bool(whole(value))


def _exactly(values: Sequence[Value], count: int) -> Sequence[Value]:
    if len(values) != count:
        raise RefusedError(f"{count} values are needed, not {len(values)}")
    return values


def _enumerated(kind: type[IntEnum], value: Value) -> IntEnum:
    """Return an enumeration member, from its word or its number."""
    if isinstance(value, int | Vocab) and int(value) in kind.__members__.values():
        return kind(int(value))
    raise RefusedError(f"{shown(value)} is not a {kind.__name__}")


def _alone(write: Callable[[Any], Value], read: Callable[[Value], Any]) -> Kind:
    def read_alone(values: Sequence[Value]) -> tuple[Any, ...]:
        return (read(values[0] if len(values) == 1 else _exactly(values, 1)[0]),)

    return Kind(lambda value: [write(value)], read_alone)


def _word(kind: type[IntEnum]) -> Kind:
    return _alone(lambda value: Vocab(int(value)), lambda value: _enumerated(kind, value))


def _structure(make: Callable[..., Any], count: int) -> Kind:
    """Return the kind of a tuple of numbers that is encoded as a list, and is one parameter."""
    return _alone(_floats, lambda value: make(*map(number, inner(value, count))))


def _floats(values: Sequence[float]) -> Bottle:
    return Bottle.adopt([float(value) for value in values])


def _flat(count: int) -> Kind:
    """Return the kind of ``count`` consecutive numbers, each a parameter."""
    return Kind(
        lambda values: [float(value) for value in values],
        lambda values: tuple(map(number, _exactly(values, count))),
    )


def _listed(count: int) -> Kind:
    """Return the kind of ``count`` numbers in a list, each a parameter."""
    return Kind(
        lambda values: [_floats(values)],
        lambda values: tuple(map(number, inner(_exactly(values, 1)[0], count))),
    )


def _key(value: Value) -> str:
    if isinstance(value, str | Vocab):
        return str(value)
    raise RefusedError(f"a name is needed, not {shown(value)}")


def _calibration(values: Sequence[Value]) -> tuple[CalibrationParameters]:
    """Decode the type of the calibration procedure and its parameters, as many as are given."""
    kind, *parameters = values or [0]
    if len(parameters) >= len(CalibrationParameters._fields):
        raise RefusedError(f"a calibration has at most 6 parameters, not {len(parameters)}")
    return (CalibrationParameters(whole(kind), *map(number, parameters)),)


#: No value.
NOTHING = Kind(lambda _: [], lambda values: tuple(_exactly(values, 0)))
#: Values that are ignored.
ANYTHING = Kind(lambda _: [], lambda _: ())
FLOAT = _alone(float, number)
INT = _alone(int, whole)
#: 0 or 1.
FLAG = _alone(int, _truth)
TEXT = _alone(str, _key)
MODE = _word(ControlMode)
INTERACTION_MODE = _word(InteractionMode)
PID_TYPE = _word(PidType)
#: A word that is sent as its number.
JOINT_TYPE = _alone(int, lambda value: _enumerated(JointType, value))
#: A minimum and a maximum.
RANGE = _flat(2)
#: The ranges of all joints: the list of the minima, and that of the maxima. Decoding returns the two lists.
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
#: The value of a remote variable: in an answer a list, in a request all elements after the name.
VARIABLE = Kind(lambda bottle: [bottle], lambda values: (Bottle(values),))
NAMES = _alone(lambda names: Bottle.adopt(list(names)), lambda value: tuple(map(_key, inner(value))))
