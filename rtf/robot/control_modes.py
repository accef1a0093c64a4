"""The state machine of an iCub joint's control modes.

Boards, tests and the diagram in the documentation use one table, :data:`TRANSITIONS`. Requests come from users; all
other transitions are made by the board itself. The rules are those of the iCub's boards: a fault is left only by
``FORCE_IDLE``, and a joint that is not calibrated ignores all requests.
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
    """A control mode. The value is the packed word that is sent over the network."""

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
    """Return the word of a mode given as a number; the number as text if there is no such mode."""
    try:
        return ControlMode(number).word
    except ValueError:
        return str(number)


class InteractionMode(IntEnum):
    """The interaction mode of a joint: stiff, or compliant to external forces."""

    STIFF = _packed("stif")
    COMPLIANT = _packed("comp")
    UNKNOWN = _packed("unkn")

    @property
    def word(self) -> str:
        """The word of four letters, such as ``stif``."""
        return Vocab(int(self)).text


class Answer(Enum):
    """The reaction of a board to a request for a mode."""

    TAKEN = "taken"
    IGNORED = "ignored"  # answered with ok, as boards do, but nothing changes
    REFUSED = "refused"  # answered with fail


#: The modes in which a joint follows its user's commands.
USER_MODES = (
    ControlMode.POSITION,
    ControlMode.POSITION_DIRECT,
    ControlMode.VELOCITY,
    ControlMode.MIXED,
    ControlMode.TORQUE,
    ControlMode.CURRENT,
    ControlMode.PWM,
)
#: The modes that a user may request. The two old impedance modes are treated as position and velocity mode of a
#: compliant joint.
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
#: The modes in which a joint has no power.
POWERLESS = frozenset(
    {ControlMode.IDLE, ControlMode.HARDWARE_FAULT, ControlMode.NOT_CONFIGURED, ControlMode.CONFIGURED}
)
#: The modes in which the joint follows the generated trajectory, so that position moves are accepted.
TRAJECTORY_MODES = frozenset({ControlMode.POSITION, ControlMode.MIXED})
#: The modes in which velocity commands are accepted.
VELOCITY_MODES = frozenset({ControlMode.VELOCITY, ControlMode.MIXED})
#: The modes in which the position is controlled, and only their own commands move the joint.
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


#: The mode after a request: ``TRANSITIONS[state, request]``; the same mode if the request is ignored.
TRANSITIONS: Mapping[tuple[ControlMode, ControlMode], ControlMode] = {
    (state, request): _after(state, request)
    for state in STATES
    for request in REQUESTS
    if request not in (ControlMode.IMPEDANCE_POSITION, ControlMode.IMPEDANCE_VELOCITY)
}

#: The transitions that the board makes by itself: (from, reason, to); from None: from any mode.
FORCED: tuple[tuple[ControlMode | None, str, ControlMode], ...] = (
    (ControlMode.NOT_CONFIGURED, "the board was configured", ControlMode.CONFIGURED),
    (ControlMode.CONFIGURED, "calibration began", ControlMode.CALIBRATING),
    (ControlMode.CALIBRATING, "calibration ended", ControlMode.CALIBRATION_DONE),
    (ControlMode.CALIBRATION_DONE, "the joint is ready", ControlMode.POSITION),
    (None, "a fault: over-current, over-temperature, a lost encoder, an emergency stop", ControlMode.HARDWARE_FAULT),
)


def answer(state: ControlMode, request: int) -> tuple[Answer, ControlMode]:
    """Return the reaction of a board in ``state`` to a request, which may be any number, and the mode afterwards.

    A mode that users may not request is refused. A request that the state forbids is ignored: the iCub's boards answer
    before they know the result.
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
