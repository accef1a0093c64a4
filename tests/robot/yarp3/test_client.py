"""The requests and commands of a client, its reading of answers, and its refusals of invalid arguments."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Vocab
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import (
    RefusedError,
    RobotError,
)
from rtf.robot.interfaces import CalibrationParameters, MotorTorqueParameters, Pid, PidType
from rtf.robot.yarp3.client import RemoteControlBoard

from ..scripted_board import ScriptedBoard, client_of

if TYPE_CHECKING:
    from collections.abc import Callable


PID = Pid(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
GAINS = "1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0 10.0"
POSITION, TORQUE = PidType.POSITION, PidType.TORQUE


COMMANDS: list[tuple[str, Callable[[RemoteControlBoard], object]]] = [
    ("[set] [pos] 1 2.5", lambda board: board.position_move(2.5, 1)),
    ("[set] [poss] (1.0 2.0 3.0)", lambda board: board.position_move([1, 2, 3])),
    ("[set] [posg] 2 (2 0) (1.0 2.0)", lambda board: board.position_move([1, 2], [2, 0])),
    ("[set] [relg] 1 (2) (1.0)", lambda board: board.relative_move([1], [2])),
    ("[set] [vel] 0 10.0", lambda board: board.set_reference_speeds(10, 0)),
    ("[set] [accs] (1.0 2.0 3.0)", lambda board: board.set_reference_accelerations((1, 2, 3))),
    ("[set] [sto] 1", lambda board: board.stop(1)),
    ("[set] [stos]", lambda board: board.stop()),
    ("[set] [stog] 2 (0 1)", lambda board: board.stop((0, 1))),
    ("[set] [enc] 1 5.0", lambda board: board.set_encoders(5.0, 1)),
    ("[set] [eres]", lambda board: board.reset_encoders()),
    ("[set] [mncs] (1.0 2.0 3.0)", lambda board: board.set_motor_encoders([1, 2, 3])),
    ("[set] [mcpr] 0 4096.0", lambda board: board.set_counts_per_revolution(0, 4096)),
    ("[set] [aen] 2", lambda board: board.enable_amplifier(2)),
    ("[set] [maxc] 2 0.0", lambda board: board.set_max_current(2, 0)),
    ("[set] [llim] 2 -1.0 1.0", lambda board: board.set_limits(2, -1, 1)),
    ("[set] [icmd] [cmod] 0 [torq]", lambda board: board.set_control_modes(ControlMode.TORQUE, 0)),
    ("[set] [icmd] [cmds] ([pos] [pos] [pos])", lambda board: board.set_control_modes(ControlMode.POSITION)),
    (
        "[set] [icmd] [cmog] 2 (0 2) ([vel] [idl])",
        lambda board: board.set_control_modes([ControlMode.VELOCITY, ControlMode.IDLE], [0, 2]),
    ),
    ("[set] [intm] [mode] 1 [comp]", lambda board: board.set_interaction_modes(InteractionMode.COMPLIANT, 1)),
    (
        "[set] [torq] [mtps] 0 (1.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 2.0)",
        lambda board: board.set_motor_torque_parameters(0, MotorTorqueParameters(bemf=1, velocity_threshold=2)),
    ),
    ("[set] [iimp] [ipr] 0 (0.5 0.25)", lambda board: board.set_impedance(0, 0.5, 0.25)),
    ("[set] [iimp] [iof] 0 (0.5)", lambda board: board.set_impedance_offset(0, 0.5)),
    (f"[set] [pid] [pid] [pos] 1 ({GAINS})", lambda board: board.set_pid(POSITION, 1, PID)),
    (f"[set] [pid] [pids] [trq] (({GAINS}) ({GAINS}) ({GAINS}))", lambda board: board.set_pids(TORQUE, [PID] * 3)),
    ("[set] [pid] [ref] [trq] 1 2.0", lambda board: board.set_pid_references(TORQUE, 2.0, 1)),
    ("[set] [pid] [lims] [pos] (1.0 1.0 1.0)", lambda board: board.set_pid_error_limits(POSITION, [1, 1, 1])),
    ("[set] [pid] [off] [pos] 1 2.0", lambda board: board.set_pid_offset(POSITION, 1, 2.0)),
    ("[set] [pid] [res] [pos] 1", lambda board: board.reset_pid(POSITION, 1)),
    ("[set] [pid] [ena] [pos] 1", lambda board: board.enable_pid(POSITION, 1)),
    ("[set] [pid] [dis] [pos] 1", lambda board: board.disable_pid(POSITION, 1)),
    ("[calj] 1 3 1.0 2.0 3.0", lambda board: board.calibrate_axis(1, CalibrationParameters(3, 1, 2, 3, 4, 5))),
    (
        "[cljp] 1 3 1.0 2.0 3.0 4.0",
        lambda board: board.set_calibration_parameters(1, CalibrationParameters(3, 1, 2, 3, 4, 5)),
    ),
    ("[cald] 1", lambda board: board.calibration_done(1)),
    ("[set] [reca] [cal] 1", lambda board: board.calibrate_joint(1)),
    ("[set] [reca] [pars]", lambda board: board.park_part()),
    ("[set] [reca] [quca]", lambda board: board.quit_calibrate()),
    ("[set] [ivar] [mvar] gain 1 (2 3)", lambda board: board.set_variable("gain", Bottle.parse("1 (2 3)"))),
]
STAMP = "[tsta] 1 2.0 [ok]"
ASKED: list[tuple[str, str, Callable[[RemoteControlBoard], object], object]] = [
    ("[get] [name] 1", f"[is] [name] j1 {STAMP}", lambda board: board.axis_name(1), "j1"),
    ("[get] [pos] 1", f"[is] [pos] 2.5 {STAMP}", lambda board: [*board.target_positions(1)], [2.5]),
    ("[get] [poss]", f"[is] [poss] (1.0 2.0 3.0) {STAMP}", lambda board: [*board.target_positions()], [1, 2, 3]),
    ("[get] [velg] 2 (2 0)", f"[is] [velg] (1 2) {STAMP}", lambda board: [*board.reference_speeds([2, 0])], [1, 2]),
    ("[get] [dong] 2 (0 1)", f"[is] [dong] 1 {STAMP}", lambda board: board.motion_done([0, 1]), True),
    ("[get] [don] 1", f"[is] [don] 0 {STAMP}", lambda board: board.motion_done(1), False),
    ("[get] [vmos]", f"[is] [vmos] (1.0 2.0 3.0) {STAMP}", lambda board: [*board.target_velocities()], [1, 2, 3]),
    ("[get] [tmps]", f"[is] [tmps] (1.0 2.0 3.0) {STAMP}", lambda board: [*board.temperatures([2, 0])], [3, 1]),
    ("[get] [asta]", f"[is] [asta] (0 0 7) {STAMP}", lambda board: board.amplifier_status(), (0, 0, 7)),
    ("[get] [llim] 0", f"[is] [llim] -40.0 30.0 {STAMP}", lambda board: board.limits(0), (-40.0, 30.0)),
    ("[get] [torq] [rng] 0", f"[is] [torq] -1.0 1.0 {STAMP}", lambda board: board.torque_range(0), (-1.0, 1.0)),
    (
        "[get] [torq] [refs]",
        f"[is] [torq] (1.0 2.0 3.0) {STAMP}",
        lambda board: [*board.reference_torques()],
        [1, 2, 3],
    ),
    ("[get] [iimp] [iof] 0", f"[is] [iimp] (0.5) {STAMP}", lambda board: board.impedance_offset(0), 0.5),
    ("[get] [pid] [pid] [pos] 0", f"[is] [pid] ({GAINS}) [ok]", lambda board: board.pid(POSITION, 0), PID),
    (
        "[get] [pid] [errs] [trq]",
        "[is] [pid] (1.0 2.0 3.0) [ok]",
        lambda board: [*board.pid_errors(TORQUE, [1])],
        [2.0],
    ),
    ("[get] [pid] [ena] [pos] 0", "[is] [pid] 1 [ok]", lambda board: board.pid_enabled(POSITION, 0), True),
    ("[get] [icur] [rng] 0", "[is] [icur] -5.0 5.0 [ok]", lambda board: board.current_range(0), (-5.0, 5.0)),
    ("[get] [ipwm] [ref] 0", "[is] [ipwm] 12.0 [ok]", lambda board: [*board.reference_duty_cycles(0)], [12.0]),
    ("[get] [ijfl] [jhfl] 1", '[is] 3 "too hot" [ok]', lambda board: board.last_joint_fault(1), (3, "too hot")),
    ("[get] [ivar] [lvar]", "[is] [ivar] (a b) [ok]", lambda board: board.variables(), ("a", "b")),
    ("[get] [ivar] [mvar] a", "[is] [ivar] (1 2) [ok]", lambda board: board.variable("a"), Bottle([1, 2])),
    ("[get] [reca] [isca]", "[is] [reca] 1 [ok]", lambda board: board.has_calibrator(), True),
    ("[cald] 1", "[fail]", lambda board: board.calibration_done(1), False),
]
STREAMED: list[tuple[str, list[float], Callable[[RemoteControlBoard], object]]] = [
    ("[vmo] 1", [2.0], lambda board: board.velocity_move(2, 1)),
    ("[vmos]", [1.0, 2.0, 3.0], lambda board: board.velocity_move([1, 2, 3])),
    ("[vmog] 2 (2 0)", [1.0, 2.0], lambda board: board.velocity_move([1, 2], [2, 0])),
    ("[dpo] 0", [7.5], lambda board: board.set_positions(7.5, 0)),
    ("[dpos]", [1.0, 2.0, 3.0], lambda board: board.set_positions([1, 2, 3])),
    ("[dtqg] 2 (1 2)", [0.5, -0.5], lambda board: board.set_reference_torques([0.5, -0.5], (1, 2))),
    ("[ipwm] [ref] 1", [50.0], lambda board: board.set_reference_duty_cycles(50.0, 1)),
    ("[ipwm] [ref] 2", [10.0], lambda board: board.set_reference_duty_cycles([10.0], [2])),
    ("[ipwm] [refs]", [1.0, 2.0, 3.0], lambda board: board.set_reference_duty_cycles([1, 2, 3])),
    ("[icur] [ref] 1", [0.5], lambda board: board.set_reference_currents(0.5, 1)),
    ("[icur] [refg] 2 (0 1)", [0.5, 0.25], lambda board: board.set_reference_currents([0.5, 0.25], [0, 1])),
]


@pytest.mark.parametrize(("words", "call"), COMMANDS, ids=[words for words, _ in COMMANDS])
def test_commands_are_put_in_the_words_of_the_protocol(network: Network, words: str, call: Callable[..., object]):
    """One joint, a group and all joints have different words."""
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        call(client)
        assert board.asked == [words]


@pytest.mark.parametrize(("words", "answer", "call", "value"), ASKED, ids=[one[0] for one in ASKED])
def test_answers_are_read(network: Network, words: str, answer: str, call: Callable[..., object], value: object):
    """The data are between the echo and the stamp, for every family of requests."""
    with (
        ScriptedBoard("/board", network, answer=lambda _: Bottle.parse(answer)) as board,
        client_of(board, network) as client,
    ):
        assert call(client) == value
        assert board.asked == [words]


@pytest.mark.parametrize(("head", "values", "call"), STREAMED, ids=[one[0] for one in STREAMED])
def test_references_are_streamed(network: Network, head: str, values: list[float], call: Callable[..., object]):
    """Streamed commands use their own port, with the values as a vector; no request is sent."""
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        call(client)
        command = board.commands.read(timeout=10)
        assert (command.first.to_text(), command.second.tolist()) == (head, values)
        assert board.asked == []


@pytest.mark.parametrize("strict", ["on", None])
def test_single_commands_are_never_left_out(network: Network, strict: str | None):
    """A command of one joint waits for the previous one; one of several does with writeStrict."""
    joints: int | list[int] = [0, 1] if strict else 1
    with ScriptedBoard("/board", network) as board, client_of(board, network, writeStrict=strict) as client:
        for number in range(200):
            client.set_positions([number, number] if strict else number, joints)
        got = [board.commands.read(timeout=10).second[0] for _ in range(200)]
    assert got == [*range(200)]


@pytest.mark.parametrize("joints", [3, -1, [0, 3], 2**40])
def test_joints_that_do_not_exist_are_refused_here(network: Network, joints: Any):
    """Readings, requests and commands of an unknown joint are refused; the error names board and joint."""
    values = 0.0 if isinstance(joints, int) else [0.0, 0.0]
    wrong = joints if isinstance(joints, int) else 3
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        for call in (
            client.encoders,
            client.target_positions,
            client.stop,
            lambda one: client.set_positions(values, one),
        ):
            with pytest.raises(RefusedError, match=rf"^/board: there is no joint {wrong}; "):
                call(joints)
        assert board.asked == []
        assert board.commands.pending == 0


@pytest.mark.parametrize("values", [math.nan, math.inf, [1.0, 2.0]])
def test_values_that_make_no_sense_are_not_sent(network: Network, values: Any):
    """NaN, infinity and a wrong number of values are refused before anything is sent."""
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:
        for call in (client.position_move, client.set_positions, client.set_reference_torques):
            with pytest.raises(RefusedError, match=r"^/board: "):
                call(values, 1)
        assert board.asked == []
        assert board.commands.pending == 0


SCALARS = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.text(max_size=8),
    st.binary(max_size=8),
    st.sampled_from(["ok", "fail", "nak", "is", "tsta", "pos", ""]).map(Vocab),
)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4), max_leaves=12)
ANSWERS = st.one_of(
    st.lists(VALUES, max_size=6),
    st.lists(VALUES, max_size=3).map(lambda data: [Vocab("is"), Vocab("x"), *data, Vocab("tsta"), 1, 2.0, Vocab("ok")]),
    st.lists(VALUES, max_size=3).map(lambda data: [Vocab("is"), Vocab("x"), *data, Vocab("ok")]),
)


def test_whatever_a_board_answers_is_an_answer_or_an_error_of_robots(network: Network):
    """Any answer gives a value or a RobotError, and the next request is possible."""
    calls = [*(call for _, call in COMMANDS), *(call for _, _, call, _ in ASKED)]
    complaints: list[str] = []
    with ScriptedBoard("/board", network) as board, client_of(board, network) as client:

        @settings(max_examples=120, deadline=None)
        @given(st.sampled_from(calls), ANSWERS)
        def survive(call: Callable[[RemoteControlBoard], object], answer: list[Any]) -> None:
            board.answer = lambda _: Bottle(answer)
            try:
                call(client)
            except RobotError as error:
                complaints.append(str(error))

        survive()
        assert complaints
        assert all(complaint.startswith("/board ") for complaint in complaints)
        board.answer = lambda _: Bottle.parse(f"[is] [pos] 1.0 {STAMP}")
        assert client.target_positions(0).tolist() == [1.0]
