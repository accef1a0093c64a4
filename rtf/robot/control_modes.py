"""The control-mode machine of an iCub joint: which modes there are, and what may follow what.

One table, :data:`TRANSITIONS`, is what boards obey, tests try and the picture in the documentation shows. Requests are
what a user may ask for; the other arrows are made by the board itself. The facts are those of the iCub's boards: a
fault is left only by ``FORCE_IDLE``, and a joint that is not calibrated takes no request but to stay off.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import TYPE_CHECKING

from rtf.bottle import Vocab

if TYPE_CHECKING:
    from collections.abc import Mapping


def _packed(word: str) -> int:
    return Vocab(word).value


class ControlMode(IntEnum):
    """A control mode; the value is the packed word that travels over the network."""

    IDLE = _packed("idl")
    POSITION = _packed("pos")
    POSITION_DIRECT = _packed("posd")
    VELOCITY = _packed("vel")
    TORQUE = _packed("torq")
    CURRENT = _packed("icur")
    PWM = _packed("ipwm")
    MIXED = _packed("mix")
    IMPEDANCE_POSITION = _packed("impo")
    IMPEDANCE_VELOCITY = _packed("imve")
    FORCE_IDLE = _packed("fidl")
    HARDWARE_FAULT = _packed("hwfa")
    CALIBRATING = _packed("cal")
    CALIBRATION_DONE = _packed("cald")
    NOT_CONFIGURED = _packed("cfgn")
    CONFIGURED = _packed("cfgy")
    UNKNOWN = _packed("unkw")

    @property
    def word(self) -> str:
        """The word of up to four letters, such as ``pos``."""
        return Vocab(int(self)).text


def mode_word(number: int) -> str:
    """The word of a mode that is told as a number; the number itself where there is no such mode."""
    try:
        return ControlMode(number).word
    except ValueError:
        return str(number)


class InteractionMode(IntEnum):
    """Whether a joint holds its place stiffly or gives way to who pushes it."""

    STIFF = _packed("stif")
    COMPLIANT = _packed("comp")
    UNKNOWN = _packed("unkn")

    @property
    def word(self) -> str:
        """The word of four letters, such as ``stif``."""
        return Vocab(int(self)).text


class Answer(Enum):
    """What a board does with a request for a mode."""

    TAKEN = "taken"
    IGNORED = "ignored"  # answered with ok, as boards do, but nothing changes
    REFUSED = "refused"  # answered with fail


#: The modes in which a joint does what its user says.
USER_MODES = (
    ControlMode.POSITION,
    ControlMode.POSITION_DIRECT,
    ControlMode.VELOCITY,
    ControlMode.MIXED,
    ControlMode.TORQUE,
    ControlMode.CURRENT,
    ControlMode.PWM,
)
#: What a user may ask for. The two old impedance modes are asked for as position and velocity of a compliant joint.
REQUESTS = (
    *USER_MODES,
    ControlMode.IMPEDANCE_POSITION,
    ControlMode.IMPEDANCE_VELOCITY,
    ControlMode.IDLE,
    ControlMode.FORCE_IDLE,
)
#: The modes that a board may report.
STATES = (
    *USER_MODES,
    ControlMode.IDLE,
    ControlMode.HARDWARE_FAULT,
    ControlMode.NOT_CONFIGURED,
    ControlMode.CONFIGURED,
    ControlMode.CALIBRATING,
    ControlMode.CALIBRATION_DONE,
)
#: In these a joint has no power.
POWERLESS = frozenset(
    {ControlMode.IDLE, ControlMode.HARDWARE_FAULT, ControlMode.NOT_CONFIGURED, ControlMode.CONFIGURED}
)
#: In these the joint follows the generated trajectory, so that position moves are taken.
TRAJECTORY_MODES = frozenset({ControlMode.POSITION, ControlMode.MIXED})
#: In these velocity commands are taken.
VELOCITY_MODES = frozenset({ControlMode.VELOCITY, ControlMode.MIXED})
#: In these the position of a joint is controlled, and nothing but their own commands moves it.
HOLDING_MODES = TRAJECTORY_MODES | VELOCITY_MODES | {ControlMode.POSITION_DIRECT}

_STARTING = (
    ControlMode.NOT_CONFIGURED,
    ControlMode.CONFIGURED,
    ControlMode.CALIBRATING,
    ControlMode.CALIBRATION_DONE,
)


def _after(state: ControlMode, request: ControlMode) -> ControlMode:
    if request is ControlMode.FORCE_IDLE:
        return state if state in _STARTING else ControlMode.IDLE
    if state is ControlMode.HARDWARE_FAULT or state in _STARTING:
        return state
    return request


#: What a request leads to: ``TRANSITIONS[state, request]`` is the mode afterwards, the same one if it is ignored.
TRANSITIONS: Mapping[tuple[ControlMode, ControlMode], ControlMode] = {
    (state, request): _after(state, request)
    for state in STATES
    for request in REQUESTS
    if request not in (ControlMode.IMPEDANCE_POSITION, ControlMode.IMPEDANCE_VELOCITY)
}

#: What the board does by itself: (from, why, to).
FORCED: tuple[tuple[ControlMode | None, str, ControlMode], ...] = (
    (ControlMode.NOT_CONFIGURED, "the board was configured", ControlMode.CONFIGURED),
    (ControlMode.CONFIGURED, "calibration began", ControlMode.CALIBRATING),
    (ControlMode.CALIBRATING, "calibration ended", ControlMode.CALIBRATION_DONE),
    (ControlMode.CALIBRATION_DONE, "the joint is ready", ControlMode.POSITION),
    (None, "a fault: over-current, over-temperature, a lost encoder, an emergency stop", ControlMode.HARDWARE_FAULT),
)


def answer(state: ControlMode, request: int) -> tuple[Answer, ControlMode]:
    """What a board in ``state`` does with a request, which may be any number, and the mode afterwards.

    A mode that nobody may ask for is refused; a request that the state forbids is ignored, as the iCub's boards do,
    which answer before they know.
    """
    try:
        wanted = ControlMode(request)
    except ValueError:
        return Answer.REFUSED, state
    if wanted is ControlMode.IMPEDANCE_POSITION:
        wanted = ControlMode.POSITION
    elif wanted is ControlMode.IMPEDANCE_VELOCITY:
        wanted = ControlMode.VELOCITY
    if wanted not in REQUESTS:
        return Answer.REFUSED, state
    after = TRANSITIONS[state, wanted]
    allowed = after is wanted or (wanted is ControlMode.FORCE_IDLE and after is ControlMode.IDLE)
    return (Answer.TAKEN if allowed else Answer.IGNORED), after
