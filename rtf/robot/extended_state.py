"""The extended state of a control board: all measurements in one message, a hundred times a second.

It is a list of 22 fields (24 in YARP 4) with a fixed layout per board: numbers, each followed by a validity flag. The
bytes of a message are thus a template in which only numbers change. The arrays of a state are views of such bytes in
YARP 3's format, so encoding and decoding copy no values. For YARP 4, where some numbers have other types, all values
are converted in one step.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from enum import IntEnum
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from rtf.bottle import BottleError, Dialect, Vocab
from rtf.bottle.binary import LIST, TAGS, TruncatedBottleError
from rtf.middleware.types.codecs import TextCodec
from rtf.middleware.types.vector import CODES
from rtf.robot.errors import RobotError, StaleStateError
from rtf.robot.interfaces import (
    IControlMode,
    ICurrentControl,
    IEncoders,
    IInteractionMode,
    IMotor,
    IMotorEncoders,
    IPWMControl,
    ITorqueControl,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rtf.middleware.types.codecs import Buffer
    from rtf.robot.interfaces import FloatArray

#: A module-level name: enumeration members are slow to look up.
_YARP3 = Dialect.YARP3
#: The largest number of axes.
MAX_AXES = 4096
#: The largest difference in seconds between the times of the joints; beyond it they are not one state.
MAX_SPREAD = 1.0


class Field(IntEnum):
    """The fields of the state, in the order of the message."""

    JOINT_POSITIONS = 0
    JOINT_VELOCITIES = 1
    JOINT_ACCELERATIONS = 2
    MOTOR_POSITIONS = 3
    MOTOR_VELOCITIES = 4
    MOTOR_ACCELERATIONS = 5
    TORQUES = 6
    DUTY_CYCLES = 7
    CURRENTS = 8
    CONTROL_MODES = 9
    INTERACTION_MODES = 10
    TEMPERATURES = 11


_FLOATS = Field.CURRENTS + 1
_DOUBLE, _INTEGER = np.dtype("<f8"), np.dtype("<i4")
#: The bytes of a field besides its numbers: its header, and the validity word with its type code.
_AROUND = 16


def _row(field: Field) -> cached_property[FloatArray]:
    """Return a cached view of the numbers of a field."""

    def row(state: ExtendedState) -> FloatArray:
        numbers: FloatArray = state.floats[field]
        return numbers

    return cached_property(row)


class ExtendedState:
    """The state of a board with ``axes`` axes: arrays of shape (axes,), which are filled in place.

    Units are those of the interfaces; modes are packed words. ``valid`` says for each :class:`Field` whether its
    numbers are valid; initially none is.
    """

    def __init__(self, axes: int) -> None:
        self.axes: Final = axes
        self.valid: Final[NDArray[np.bool_]] = np.zeros(len(Field), dtype=bool)
        self.temperatures: Final[NDArray[np.float32]] = np.zeros(axes, dtype=np.float32)
        self._memory = bytearray(_layout(Dialect.YARP3, axes).template)
        # No helper functions: a state is created for each message. A field has a header, its numbers, and a validity
        # word.
        stride = _AROUND + 8 * axes
        at_modes = _LEAST + _FLOATS * stride
        self.floats: Final[FloatArray] = np.ndarray((_FLOATS, axes), _DOUBLE, self._memory, _LEAST, (stride, 8))
        self.modes: Final[NDArray[np.int32]] = np.ndarray(
            (2, axes), _INTEGER, self._memory, at_modes, (_AROUND + 4 * axes, 4)
        )
        self._written_valid = b""  # the validity words that the memory holds
        self._images: dict[Dialect, _Image] = {}

    joint_positions = _row(Field.JOINT_POSITIONS)
    joint_velocities = _row(Field.JOINT_VELOCITIES)
    joint_accelerations = _row(Field.JOINT_ACCELERATIONS)
    motor_positions = _row(Field.MOTOR_POSITIONS)
    motor_velocities = _row(Field.MOTOR_VELOCITIES)
    motor_accelerations = _row(Field.MOTOR_ACCELERATIONS)
    torques = _row(Field.TORQUES)
    duty_cycles = _row(Field.DUTY_CYCLES)
    currents = _row(Field.CURRENTS)

    @cached_property
    def control_modes(self) -> NDArray[np.int32]:
        """The control modes, as packed words."""
        modes: NDArray[np.int32] = self.modes[0]
        return modes

    @cached_property
    def interaction_modes(self) -> NDArray[np.int32]:
        """The interaction modes, as packed words."""
        modes: NDArray[np.int32] = self.modes[1]
        return modes

    def values(self, field: Field) -> NDArray[Any]:
        """Return the array of a field, with the field's type."""
        if field < _FLOATS:
            numbers: NDArray[Any] = self.floats[field]
            return numbers
        if field is Field.TEMPERATURES:
            return self.temperatures
        return self.control_modes if field is Field.CONTROL_MODES else self.interaction_modes

    def write(self, dialect: Dialect) -> bytes:
        """Encode the state. For one thread at a time."""
        if dialect != _YARP3:
            return self._write_converted(dialect)
        valid = self.valid.tobytes()
        if valid != self._written_valid:
            _write_valid(self._memory, _layout(dialect, self.axes), self.valid)
            self._written_valid = valid
        return bytes(self._memory)

    def _write_converted(self, dialect: Dialect) -> bytes:
        image = self._images.get(dialect) or self._image(dialect)
        with np.errstate(**_SILENT):
            for there, here in image.links:
                there[...] = here
        _write_valid(image.memory, image.layout, self.valid)
        return bytes(image.memory)

    def take(self, data: Buffer) -> int:
        """Replace the contents by those of a message; return its size. For one thread at a time.

        Raises BottleError for anything but a state with this number of axes, TruncatedBottleError for an incomplete
        one. After an error the state is unchanged.
        """
        dialect, axes, size = _measure(data)
        if axes != self.axes:
            raise BottleError(f"a state of {axes} axes arrived, but {self.axes} are expected")
        layout = _layout(dialect, axes)
        frame = np.frombuffer(data, np.uint8, size)[layout.frame].tobytes()
        if frame == layout.usual:
            self.valid[: layout.fields] = True
        elif frame.startswith(layout.fixed_bytes):
            self.valid[: layout.fields] = np.frombuffer(frame, _INTEGER, -1, len(layout.fixed_bytes)) == _OK
        else:
            raise BottleError(f"the fields of a state of {axes} axes are not all of this size and type")
        self._written_valid = b""
        if dialect == Dialect.YARP3:
            self._memory[:] = data[:size]
        else:
            self._take_converted(dialect, data[:size])
        return size

    def _take_converted(self, dialect: Dialect, data: Buffer) -> None:
        image = self._images.get(dialect) or self._image(dialect)
        image.memory[:] = data
        with np.errstate(**_SILENT):
            for there, here in image.links:
                here[...] = there

    def _image(self, dialect: Dialect) -> _Image:
        """Return the memory of messages in another dialect, created on first use."""
        layout = _layout(dialect, self.axes)
        memory = bytearray(layout.template)
        record = np.frombuffer(memory, layout.dtype)
        links: list[tuple[NDArray[Any], NDArray[Any]]] = []
        for number, (kind, first, count) in enumerate(_PARTS[dialect]):
            values: NDArray[Any] = self.floats[first : first + count]
            if kind == "i4":
                values = self.modes
            elif first is Field.TEMPERATURES:
                values = self.temperatures
            links.append((record[str(number)][0]["data"], values))
        image = self._images[dialect] = _Image(layout, memory, links)
        return image

    def copy(self) -> ExtendedState:
        """Return a copy of the state."""
        made = ExtendedState(self.axes)
        made.floats[:] = self.floats
        made.valid[:] = self.valid
        made.modes[:] = self.modes
        made.temperatures[:] = self.temperatures
        return made

    @property
    def codec(self) -> ExtendedStateCodec:
        """The codec of extended states."""
        return EXTENDED_STATE


class _Layout(NamedTuple):
    """The layout of the message of a board with a given number of axes.

    ``frame`` are the positions of all bytes but the numbers: first those that never change, ``fixed_bytes``, then the
    validity words of the first ``fields`` fields. In a ``usual`` frame all fields are valid.
    """

    dtype: np.dtype[Any]
    template: bytes
    frame: NDArray[np.intp]
    fixed_bytes: bytes
    usual: bytes
    fields: int


class _Image(NamedTuple):
    """The memory of one message, and pairs of arrays: in that memory, and in a state."""

    layout: _Layout
    memory: bytearray
    links: list[tuple[NDArray[Any], NDArray[Any]]]


def _write_valid(memory: bytearray, layout: _Layout, valid: NDArray[np.bool_]) -> None:
    """Write the validity words into a message."""
    words = _WORDS[valid[: layout.fields].view(np.uint8)]
    np.frombuffer(memory, np.uint8)[layout.frame[len(layout.fixed_bytes) :]] = words.view(np.uint8)


_OK, _FAIL = Vocab("ok").value, Vocab("fail").value
#: In a conversion of precision, values out of range become infinite and NaN stays NaN.
_SILENT: dict[str, Any] = {"over": "ignore", "invalid": "ignore"}
#: The validity words of False and True.
_WORDS = np.array([_FAIL, _OK], dtype="<i4")
#: The kinds of bytes of a message that change.
_NUMBER, _VALIDITY = 1, 2
_VOCAB = TAGS[Dialect.YARP3].classes[Vocab].code  # the same in both
_DUTY = Field.DUTY_CYCLES.value
#: For each dialect the fields of a message: the type of their numbers, the first one, and how many are alike.
_PARTS = {
    Dialect.YARP3: (
        ("f8", Field.JOINT_POSITIONS, _FLOATS),
        ("i4", Field.CONTROL_MODES, 2),
    ),
    Dialect.YARP4: (
        ("f8", Field.JOINT_POSITIONS, _DUTY),
        ("f4", Field.DUTY_CYCLES, 1),
        ("f8", Field.CURRENTS, 1),
        ("i4", Field.CONTROL_MODES, 2),
        ("f4", Field.TEMPERATURES, 1),
    ),
}
_COUNTS = {dialect: 2 * sum(count for _, _, count in parts) for dialect, parts in _PARTS.items()}
_OF_COUNT = {count: dialect for dialect, count in _COUNTS.items()}
#: The header of the message and that of its first field.
_begin = struct.Struct("<iiii")
_LEAST = _begin.size


@lru_cache(maxsize=64)
def _layout(dialect: Dialect, axes: int) -> _Layout:
    parts = []
    for number, (kind, _, count) in enumerate(_PARTS[dialect]):
        block = np.dtype([("head", "<i4", 2), ("data", f"<{kind}", (axes,)), ("code", "<i4"), ("valid", "<i4")])
        parts.append((str(number), block, (count,)))
    dtype = np.dtype([("head", "<i4", 2), *parts])
    record, changes = np.zeros(1, dtype), np.zeros(1, dtype)
    record["head"] = LIST, _COUNTS[dialect]
    for number, (kind, _, _) in enumerate(_PARTS[dialect]):
        part: NDArray[Any] = record[str(number)]
        part["head"] = CODES[dialect][kind], axes
        part["code"] = _VOCAB
        changes[str(number)]["data"].view("u1")[...] = _NUMBER
        changes[str(number)]["valid"] = int.from_bytes(bytes([_VALIDITY]) * 4)
    fixed, words = (np.flatnonzero(changes.view("u1") == what) for what in (0, _VALIDITY))
    fixed_bytes = record.view("u1")[fixed].tobytes()
    fields = _COUNTS[dialect] // 2
    usual = fixed_bytes + np.full(fields, _OK, _INTEGER).tobytes()
    return _Layout(dtype, record.tobytes(), np.concatenate([fixed, words]), fixed_bytes, usual, fields)


def _measure(data: Buffer) -> tuple[Dialect, int, int]:
    """Return the dialect, the number of axes and the size of a message, which is complete."""
    if len(data) < _LEAST:
        raise TruncatedBottleError(_LEAST)
    code, count, kind, axes = _begin.unpack_from(data)
    dialect = _OF_COUNT.get(count) if code == LIST else None
    if dialect is None:
        raise BottleError(f"an extended state is a list of 22 or 24 fields, not of {count} (code {code})")
    if kind != CODES[dialect]["f8"] or not 0 <= axes <= MAX_AXES:
        raise BottleError(f"an extended state begins with positions of joints, not with {axes} numbers of code {kind}")
    size = _layout(dialect, axes).dtype.itemsize
    if len(data) < size:
        raise TruncatedBottleError(size)
    return dialect, axes, size


class ExtendedStateCodec(TextCodec[ExtendedState]):
    """Codec of extended states. The number of fields identifies the dialect of a message."""

    promise = "yarp/controlBoardExtendedState"

    def encode(self, value: ExtendedState, dialect: Dialect) -> Sequence[Buffer]:
        """One block."""
        return (value.write(dialect),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[ExtendedState, int]:  # noqa: ARG002 - see above
        """Decode a new state. To read many messages, use one state's ``take``, which also lists the errors."""
        _, axes, _ = _measure(data)
        state = ExtendedState(axes)
        return state, state.take(data)


EXTENDED_STATE = ExtendedStateCodec()


class IStateSource(ABC):
    """A board that provides its whole state at once, which is faster than one call for each field."""

    @abstractmethod
    def fill_state(self, state: ExtendedState) -> float:
        """Fill in the values and validity flags. Return the mean time of the encoders (s, robot's clock).

        Raises StaleStateError if the joints were not measured at about the same time.
        """


class InterfaceState(IStateSource):
    """The state of a device, read through its interfaces. Fields that it lacks or refuses are zero and not valid."""

    def __init__(self, device: object) -> None:
        self._readers: list[tuple[Field, Callable[[], Any]]] = [
            (field, getattr(device, method))
            for field, (interface, method) in _SOURCES.items()
            if isinstance(device, interface)
        ]
        self._times = device.encoder_times if isinstance(device, IEncoders) else None

    def fill_state(self, state: ExtendedState) -> float:
        """Fill in the state; the time is NaN if there are no encoders."""
        state.valid.fill(False)
        for field, read in self._readers:
            values = state.values(field)
            try:
                read_now = np.asarray(read())
            except RobotError:
                read_now = _NOTHING
            if read_now.shape == values.shape:
                values[:] = read_now
                state.valid[field] = True
            else:
                values.fill(0)
        return mean_time(self._times()) if self._times is not None else float("nan")


_NOTHING = np.zeros(0)
#: The interface and method that provide each field.
_SOURCES: dict[Field, tuple[type[Any], str]] = {
    Field.JOINT_POSITIONS: (IEncoders, "encoders"),
    Field.JOINT_VELOCITIES: (IEncoders, "encoder_speeds"),
    Field.JOINT_ACCELERATIONS: (IEncoders, "encoder_accelerations"),
    Field.MOTOR_POSITIONS: (IMotorEncoders, "motor_encoders"),
    Field.MOTOR_VELOCITIES: (IMotorEncoders, "motor_encoder_speeds"),
    Field.MOTOR_ACCELERATIONS: (IMotorEncoders, "motor_encoder_accelerations"),
    Field.TORQUES: (ITorqueControl, "torques"),
    Field.DUTY_CYCLES: (IPWMControl, "duty_cycles"),
    Field.CURRENTS: (ICurrentControl, "currents"),
    Field.CONTROL_MODES: (IControlMode, "control_modes"),
    Field.INTERACTION_MODES: (IInteractionMode, "interaction_modes"),
    Field.TEMPERATURES: (IMotor, "temperatures"),
}


def mean_time(times: FloatArray) -> float:
    """Return the mean of the joints' times. Raises StaleStateError if they differ by more than MAX_SPREAD."""
    spread = float(np.ptp(times)) if times.size else 0.0
    if spread > MAX_SPREAD:
        raise StaleStateError(
            f"the encoders of joints {int(times.argmin())} and {int(times.argmax())} were read {spread:.3g} s apart"
        )
    return float(times.mean()) if times.size else float("nan")
