"""The table of control modes: the answer to every request in every mode, and rules for all of them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.robot.control_modes import (
    FORCED,
    POWERLESS,
    REQUESTS,
    STATES,
    TRANSITIONS,
    USER_MODES,
    Answer,
    ControlMode,
    InteractionMode,
    answer,
    mode_word,
)

_STARTING = ("cfgn", "cfgy", "cal", "cald")
_USER = ("pos", "posd", "vel", "mix", "torq", "icur", "ipwm")
#: The meaning of the old impedance modes.
_OLD = {"impo": "pos", "imve": "vel"}


def expected(state: str, request: str) -> tuple[Answer, str]:
    """Compute answer and mode by rule: startup ignores all, a fault takes only forced idle, all else is taken."""
    request = _OLD.get(request, request)
    if state in _STARTING:
        return Answer.IGNORED, state
    if request == "fidl":
        return Answer.TAKEN, "idl"
    if state == "hwfa":
        return Answer.IGNORED, state
    return Answer.TAKEN, request


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda mode: mode.word)
@pytest.mark.parametrize("state", STATES, ids=lambda mode: mode.word)
def test_every_request_in_every_state(state: ControlMode, request_: ControlMode):
    """The table has the answer and the next mode of the rule."""
    taken, after = answer(state, request_)
    assert (taken, after.word) == expected(state.word, request_.word)


@given(state=st.sampled_from(STATES), number=st.integers())
def test_other_numbers_are_refused(state: ControlMode, number: int):
    """A number that is no request is refused, and the mode stays."""
    known = number in [*map(int, REQUESTS)]
    taken, after = answer(state, number)
    assert (taken is Answer.REFUSED) == (not known)
    if not known:
        assert after is state


@given(state=st.sampled_from(STATES), requests=st.lists(st.sampled_from(REQUESTS)))
def test_requests_lead_nowhere_but_to_modes_of_users(state: ControlMode, requests: list[ControlMode]):
    """After any requests a joint is in its first mode, in a mode of users, or idle."""
    mode = state
    for request in requests:
        _, mode = answer(mode, request)
    assert mode in {state, *USER_MODES, ControlMode.IDLE}


@given(requests=st.lists(st.sampled_from([one for one in REQUESTS if one is not ControlMode.FORCE_IDLE])))
def test_a_fault_stays_without_force(requests: list[ControlMode]):
    """A joint in fault stays so after any requests but forced idle."""
    mode = ControlMode.HARDWARE_FAULT
    for request in requests:
        _, mode = answer(mode, request)
    assert mode is ControlMode.HARDWARE_FAULT


def test_no_state_is_a_mere_request():
    """Force-idle and the old impedance modes can be requested, and are never reported."""
    assert not {ControlMode.FORCE_IDLE, ControlMode.IMPEDANCE_POSITION, ControlMode.IMPEDANCE_VELOCITY} & set(STATES)
    assert set(TRANSITIONS.values()) <= set(STATES)
    assert {state for state, _ in TRANSITIONS} == set(STATES)


def test_a_board_by_itself_only_starts_and_fails():
    """Without a request a mode changes only along the startup, or to the fault."""
    chain = [(begin.word, end.word) for begin, _, end in FORCED if begin is not None]
    assert chain == [("cfgn", "cfgy"), ("cfgy", "cal"), ("cal", "cald"), ("cald", "pos")]
    assert [end for begin, _, end in FORCED if begin is None] == [ControlMode.HARDWARE_FAULT]


def test_without_power_there_is_no_torque():
    """The modes of users have power; idle and fault have none."""
    assert not POWERLESS & set(USER_MODES)
    assert {ControlMode.IDLE, ControlMode.HARDWARE_FAULT} <= POWERLESS


@pytest.mark.parametrize(
    ("mode", "number"),
    [
        (ControlMode.POSITION, 7565168),
        (ControlMode.POSITION_DIRECT, 1685286768),
        (ControlMode.TORQUE, 1903325044),
        (ControlMode.HARDWARE_FAULT, 1634105192),
        (ControlMode.FORCE_IDLE, 1818519910),
        (InteractionMode.STIFF, 1718187123),
        (InteractionMode.COMPLIANT, 1886220131),
    ],
)
def test_numbers_that_travel(mode: ControlMode | InteractionMode, number: int):
    """A mode is the number by which the protocol transmits it."""
    assert mode == number


def test_words():
    """Each mode has the word of the protocol."""
    assert [mode.word for mode in USER_MODES] == [*_USER]
    assert [mode.word for mode in InteractionMode] == ["stif", "comp", "unkn"]


@given(st.integers(-(2**31), 2**31 - 1) | st.sampled_from(ControlMode).map(int))
def test_a_number_has_a_word(number: int):
    """The word of a number is that of its mode, and the number itself if it is no mode."""
    assert mode_word(number) == (ControlMode(number).word if number in list(ControlMode) else str(number))
