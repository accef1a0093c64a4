"""The contract of control boards: fake, simulated, or through the network.

Subclass :class:`ControlBoardContract`, give it a fixture ``board`` and a way to let the board's time pass::

    class TestFakeBoard(ControlBoardContract):
        @pytest.fixture
        def board(self, stepped): ...

        def advance(self, seconds): ...
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import pytest

from rtf.bottle import Bottle
from rtf.robot.control_modes import (
    REQUESTS,
    TRAJECTORY_MODES,
    USER_MODES,
    VELOCITY_MODES,
    Answer,
    ControlMode,
    InteractionMode,
    answer,
)
from rtf.robot.device import Device
from rtf.robot.errors import NotSupportedError, RefusedError, RobotError
from rtf.robot.interfaces import (
    CalibrationParameters,
    IAmplifierControl,
    IAxisInfo,
    IControlCalibration,
    IControlLimits,
    IControlMode,
    ICurrentControl,
    IEncoders,
    IImpedanceControl,
    IInteractionMode,
    IJointFault,
    IMotor,
    IMotorEncoders,
    IPidControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    IRemoteVariables,
    ITorqueControl,
    IVelocityControl,
    JointType,
    MotorTorqueParameters,
    Pid,
    PidType,
)

#: A mode that a joint can be in, as its user can bring it there.
_REACHABLE = (*USER_MODES, ControlMode.IDLE, ControlMode.HARDWARE_FAULT)
_NEVER_REQUESTED = tuple(mode for mode in ControlMode if mode not in REQUESTS)
#: Methods that select axes, with their values, for arguments that must be refused.
_READING = (
    (IEncoders, "encoders"),
    (IEncoders, "encoder_speeds"),
    (IEncoders, "encoder_accelerations"),
    (IMotorEncoders, "motor_encoders"),
    (IPositionControl, "target_positions"),
    (IPositionControl, "reference_speeds"),
    (IPositionControl, "reference_accelerations"),
    (IPositionControl, "motion_done"),
    (IVelocityControl, "target_velocities"),
    (IPositionDirect, "reference_positions"),
    (ITorqueControl, "torques"),
    (ITorqueControl, "reference_torques"),
    (ICurrentControl, "currents"),
    (ICurrentControl, "reference_currents"),
    (IPWMControl, "duty_cycles"),
    (IPWMControl, "reference_duty_cycles"),
    (IControlMode, "control_modes"),
    (IInteractionMode, "interaction_modes"),
    (IMotor, "temperatures"),
    (IAmplifierControl, "amplifier_status"),
)
_WRITING = (
    (IPositionControl, "position_move"),
    (IPositionControl, "relative_move"),
    (IPositionControl, "set_reference_speeds"),
    (IPositionControl, "set_reference_accelerations"),
    (IEncoders, "set_encoders"),
)
#: Streamed commands have no answer by which a remote board could refuse them; a stub itself does.
_STREAMED = (
    (IVelocityControl, "velocity_move"),
    (IPositionDirect, "set_positions"),
    (ITorqueControl, "set_reference_torques"),
    (ICurrentControl, "set_reference_currents"),
    (IPWMControl, "set_reference_duty_cycles"),
)
#: Numbers of a motor or joint that are kept: interface, how to get, how to set.
_KEPT = (
    (IMotor, "temperature_limit", "set_temperature_limit"),
    (IMotor, "gearbox_ratio", "set_gearbox_ratio"),
    (IMotorEncoders, "counts_per_revolution", "set_counts_per_revolution"),
    (IAmplifierControl, "max_current", "set_max_current"),
    (IAmplifierControl, "nominal_current", "set_nominal_current"),
    (IAmplifierControl, "peak_current", "set_peak_current"),
    (IAmplifierControl, "pwm_limit", "set_pwm_limit"),
    (IImpedanceControl, "impedance_offset", "set_impedance_offset"),
)
#: Modes whose setpoints can be read back, with the methods that set and read them.
_REFERENCES = (
    (ControlMode.TORQUE, ITorqueControl, "set_reference_torques", "reference_torques"),
    (ControlMode.CURRENT, ICurrentControl, "set_reference_currents", "reference_currents"),
    (ControlMode.PWM, IPWMControl, "set_reference_duty_cycles", "reference_duty_cycles"),
    (ControlMode.POSITION_DIRECT, IPositionDirect, "set_positions", "reference_positions"),
    (ControlMode.VELOCITY, IVelocityControl, "velocity_move", "target_velocities"),
)


class ControlBoardContract:
    """The tests. The joints 0 and 1 must be free to move ``WAY`` deg either way from the middle of their limits."""

    #: How exactly joints reach their targets (deg), and the speed of their moves (deg/s).
    TOLERANCE: ClassVar[float] = 0.5
    SPEED: ClassVar[float] = 20.0
    WAY: ClassVar[float] = 5.0
    #: A small reference for each mode, which moves nothing far.
    SMALL: ClassVar[float] = 0.25
    #: Interfaces that this kind of board lacks.
    LACKING: ClassVar[tuple[type[Any], ...]] = ()
    #: Methods of measurements that it does not have, though it has their interfaces.
    UNMEASURED: ClassVar[frozenset[str]] = frozenset()

    @pytest.fixture
    def board(self) -> Device:
        """An opened board of at least two joints, in position mode."""
        raise NotImplementedError

    def advance(self, seconds: float) -> None:
        """Let the board's time pass; what it publishes has arrived when this returns."""
        raise NotImplementedError

    # Help --------------------------------------------------------------------------------------------------------

    def of(self, board: Device, interface: type[Any]) -> Any:
        """Return the board as an interface; skip the test if it lacks it."""
        if interface in self.LACKING:
            pytest.skip(f"this board has no {interface.__name__}")
        return board.view(interface)

    def settle(self) -> None:
        """Let enough time pass for the commands to take effect."""
        self.advance(0.1)

    def mode(self, board: Device, joint: int = 0) -> ControlMode:
        """Return the mode of a joint after all commands have taken effect."""
        self.settle()
        return self.of(board, IControlMode).control_mode(joint)

    def enter(self, board: Device, mode: ControlMode, joints: Any = 0) -> None:
        """Bring joints into a mode; into a fault by allowing no current at all."""
        if mode is ControlMode.HARDWARE_FAULT:
            self.of(board, IAmplifierControl).set_max_current(joints, 0.0)
        else:
            self.of(board, IControlMode).set_control_modes(mode, joints)
        self.settle()

    def middle(self, board: Device, joint: int) -> float:
        """Return the middle of a joint's limits."""
        low, high = self.of(board, IControlLimits).limits(joint)
        return (low + high) / 2

    def go(self, board: Device, targets: Any, joints: Any) -> None:
        """Move joints in position mode and wait for the end."""
        moves = self.of(board, IPositionControl)
        moves.set_reference_speeds(np.full(np.size(targets), self.SPEED), joints)
        moves.position_move(targets, joints)
        self.until_done(board, joints)

    def until_done(self, board: Device, joints: Any = None, limit: float = 60.0) -> None:
        """Let time pass until the motion is done."""
        moves = self.of(board, IPositionControl)
        for _ in range(round(limit / 0.1)):
            self.advance(0.1)
            if moves.motion_done(joints):
                self.advance(0.5)
                return
        raise AssertionError(f"the motion of {joints} is not done after {limit} s")

    def centre(self, board: Device) -> list[float]:
        """Bring the first two joints to the middle of their limits."""
        places = [self.middle(board, joint) for joint in (0, 1)]
        self.go(board, places, [0, 1])
        return places

    def at(self, board: Device, joints: Any = None) -> Any:
        """Return the positions of joints."""
        return self.of(board, IEncoders).encoders(joints)

    # Axes --------------------------------------------------------------------------------------------------------

    def test_axes_have_names_and_types(self, board: Device):
        """Each axis has a unique name and a type."""
        info = self.of(board, IAxisInfo)
        names = [info.axis_name(joint) for joint in range(info.axes())]
        assert info.axes() >= 2
        assert info.axis_names() == tuple(names)
        assert len(set(names)) == len(names)
        assert all(isinstance(info.joint_type(joint), JointType) for joint in range(info.axes()))

    @pytest.mark.parametrize(("interface", "method"), _READING, ids=str)
    def test_reading_chooses_axes(self, board: Device, interface: type[Any], method: str):
        """All, one and several axes can be read, in the given order; others are refused."""
        self.settle()
        read = getattr(self.of(board, interface), method)
        axes = self.of(board, IAxisInfo).axes()
        if method in self.UNMEASURED:
            with pytest.raises(NotSupportedError):
                read()
        elif method != "motion_done":
            every = list(read())
            assert len(every) == axes
            assert list(read(1)) == every[1:2]
            assert list(read([1, 0])) == [every[1], every[0]]
        for wrong in (axes, -1, [0, axes], 10**6):
            with pytest.raises(RefusedError):
                read(wrong)

    @pytest.mark.parametrize(("interface", "method"), _WRITING + _STREAMED, ids=str)
    def test_values_are_checked(self, board: Device, interface: type[Any], method: str):
        """A joint that does not exist, a wrong number of values, infinity and NaN are refused."""
        write = getattr(self.of(board, interface), method)
        axes = self.of(board, IAxisInfo).axes()
        for values, joints in (
            (1.0, axes),
            (1.0, -1),
            ([1.0, 1.0], [0, axes]),
            ([1.0, 1.0], 0),
            ([1.0], [0, 1]),
            ([1.0] * (axes + 1), None),
            ([], None),
            (math.nan, 0),
            (math.inf, 0),
        ):
            with pytest.raises(RefusedError):
                write(values, joints)

    @pytest.mark.parametrize(("interface", "get", "put"), _KEPT, ids=str)
    def test_settings_are_kept(self, board: Device, interface: type[Any], get: str, put: str):
        """A setting of one joint reads back, and those of others stay."""
        device = self.of(board, interface)
        before, other = getattr(device, get)(0), getattr(device, get)(1)
        changed = before - 1.5 if before == 100.0 else before + 1.5  # a duty cycle of 100 per cent is the greatest
        getattr(device, put)(0, changed)
        assert getattr(device, get)(0) == pytest.approx(changed)
        assert getattr(device, get)(1) == other
        getattr(device, put)(0, before)
        for call in (getattr(device, get), lambda joint: getattr(device, put)(joint, 1.0)):
            with pytest.raises(RefusedError):
                call(10**6)

    # Control modes -----------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("state", _REACHABLE, ids=lambda mode: mode.word)
    def test_every_request_in_every_state(self, board: Device, state: ControlMode):
        """After any request in any mode the joint is in the mode of the table."""
        modes = self.of(board, IControlMode)
        for request in REQUESTS:
            self.bring_into(board, state)
            assert self.mode(board) is state
            _, after = answer(state, request)
            modes.set_control_modes(request, 0)
            assert self.mode(board) is after, f"{request.word} in {state.word}"

    def bring_into(self, board: Device, state: ControlMode) -> None:
        """Bring a joint into a state, through idle."""
        amplifiers = self.of(board, IAmplifierControl)
        if amplifiers.max_current(0) == 0:
            amplifiers.set_max_current(0, 5.0)
        self.enter(board, ControlMode.FORCE_IDLE)
        self.enter(board, state)

    @pytest.mark.parametrize("request_", _NEVER_REQUESTED, ids=lambda mode: mode.word)
    def test_modes_that_cannot_be_requested(self, board: Device, request_: ControlMode):
        """Requests for other modes are refused, and nothing changes."""
        before = self.mode(board)
        assert answer(before, request_)[0] is Answer.REFUSED
        with pytest.raises(RefusedError):
            self.of(board, IControlMode).set_control_modes(request_, 0)
        assert self.mode(board) is before

    def test_modes_of_several_joints(self, board: Device):
        """One mode can be set for all joints, or one for each of some; the others keep theirs."""
        modes = self.of(board, IControlMode)
        axes = self.of(board, IAxisInfo).axes()
        modes.set_control_modes(ControlMode.VELOCITY)
        self.settle()
        assert modes.control_modes() == (ControlMode.VELOCITY,) * axes
        modes.set_control_modes([ControlMode.POSITION, ControlMode.TORQUE], [1, 0])
        self.settle()
        assert modes.control_modes([0, 1]) == (ControlMode.TORQUE, ControlMode.POSITION)
        assert set(modes.control_modes()[2:]) <= {ControlMode.VELOCITY}
        modes.set_control_modes([ControlMode.POSITION] * axes)
        self.settle()
        assert modes.control_modes() == (ControlMode.POSITION,) * axes
        for wrong in ([ControlMode.POSITION] * (axes + 1), [ControlMode.POSITION]):
            with pytest.raises(RefusedError):
                modes.set_control_modes(wrong)

    def test_only_force_idle_leaves_a_fault(self, board: Device):
        """A joint whose current limit is 0 is in fault, with a reason, until it is forced to idle."""
        amplifiers = self.of(board, IAmplifierControl)
        allowed = amplifiers.max_current(0)
        self.enter(board, ControlMode.HARDWARE_FAULT)
        assert self.mode(board) is ControlMode.HARDWARE_FAULT
        assert self.mode(board, 1) is ControlMode.POSITION
        if IJointFault not in self.LACKING:
            code, sentence = self.of(board, IJointFault).last_joint_fault(0)
            assert code != 0
            assert sentence
            assert self.of(board, IJointFault).last_joint_fault(1) == (0, "")
        amplifiers.set_max_current(0, allowed)
        assert self.mode(board) is ControlMode.HARDWARE_FAULT
        self.enter(board, ControlMode.FORCE_IDLE)
        assert self.mode(board) is ControlMode.IDLE
        self.enter(board, ControlMode.POSITION)
        assert self.mode(board) is ControlMode.POSITION

    def test_amplifiers_switch_off(self, board: Device):
        """A joint whose amplifier is switched off is idle, and the others are not."""
        self.of(board, IAmplifierControl).disable_amplifier(0)
        assert self.mode(board) is ControlMode.IDLE
        assert self.mode(board, 1) is ControlMode.POSITION
        assert self.of(board, IAmplifierControl).amplifier_status(1) == (0,)

    def test_interaction_modes_outlast_control_modes(self, board: Device):
        """The interaction mode does not depend on the control mode. Some joints cannot be compliant."""
        modes = self.of(board, IInteractionMode)
        flags = self.can_be_compliant(board)
        for joint, can in enumerate(flags):
            if can:
                modes.set_interaction_modes(InteractionMode.COMPLIANT, joint)
            else:
                with pytest.raises(RefusedError):
                    modes.set_interaction_modes(InteractionMode.COMPLIANT, joint)
        expected = tuple(InteractionMode.COMPLIANT if can else InteractionMode.STIFF for can in flags)
        for mode in (ControlMode.VELOCITY, ControlMode.IDLE, ControlMode.POSITION):
            self.enter(board, mode, None)
            assert modes.interaction_modes() == expected
            assert modes.interaction_modes([1, 0]) == (expected[1], expected[0])
        modes.set_interaction_modes([InteractionMode.STIFF] * len(flags))
        self.settle()
        assert set(modes.interaction_modes()) == {InteractionMode.STIFF}
        modes.set_interaction_modes(InteractionMode.STIFF)
        self.settle()
        assert modes.interaction_mode(0) is InteractionMode.STIFF
        with pytest.raises(RefusedError):
            modes.set_interaction_modes(InteractionMode.STIFF, len(flags))

    def can_be_compliant(self, board: Device) -> list[bool]:
        """Return the joints that can be compliant."""
        return [True] * self.of(board, IAxisInfo).axes()

    # Moves -------------------------------------------------------------------------------------------------------

    def test_moves_of_one_several_and_all(self, board: Device):
        """Joints reach their targets, others stay, and then the motion is done."""
        places = self.centre(board)
        moves = self.of(board, IPositionControl)
        moves.position_move(places[0] + self.WAY, 0)
        assert not moves.motion_done(0)
        assert not moves.motion_done()
        assert moves.motion_done(1)
        self.until_done(board)
        assert self.at(board, [0, 1]) == pytest.approx([places[0] + self.WAY, places[1]], abs=self.TOLERANCE)
        self.go(board, [places[1] - self.WAY, places[0]], [1, 0])
        assert self.at(board, [0, 1]) == pytest.approx([places[0], places[1] - self.WAY], abs=self.TOLERANCE)
        everywhere = self.at(board)
        everywhere[:2] = places
        moves.set_reference_speeds(np.full(len(everywhere), self.SPEED))
        moves.position_move(everywhere)
        self.until_done(board)
        assert self.at(board, [0, 1]) == pytest.approx(places, abs=self.TOLERANCE)
        assert moves.target_positions([0, 1]) == pytest.approx(places)

    def test_moves_are_smooth(self, board: Device):
        """A joint moves only forward, and its speed agrees."""
        places = self.centre(board)
        moves = self.of(board, IPositionControl)
        moves.set_reference_speeds(self.SPEED, 0)
        moves.position_move(places[0] + self.WAY, 0)
        way, speeds = [], []
        while not moves.motion_done(0) and len(way) < 1000:
            self.advance(0.02)
            way.append(self.at(board, 0)[0])
            speeds.append(self.of(board, IEncoders).encoder_speeds(0)[0])
        assert len(way) >= 5
        assert all(later >= earlier - self.TOLERANCE / 10 for earlier, later in pairwise(way))
        assert max(speeds) > self.SPEED / 2

    def test_relative_moves(self, board: Device):
        """A relative move is from the present position."""
        places = self.centre(board)
        self.of(board, IPositionControl).relative_move(-self.WAY, 1)
        self.until_done(board)
        assert self.at(board, [0, 1]) == pytest.approx([places[0], places[1] - self.WAY], abs=self.TOLERANCE)

    def test_targets_are_cut_off_at_the_limits(self, board: Device):
        """A target beyond the limits is clipped to them."""
        self.centre(board)
        low, high = self.of(board, IControlLimits).limits(0)
        for beyond, limit in ((high + 20, high), (low - 20, low)):
            self.go(board, beyond, 0)
            assert self.at(board, 0) == pytest.approx([limit], abs=self.TOLERANCE)

    def test_motion_of_several_is_done_when_each_is(self, board: Device):
        """The motion of several joints is done when that of each is."""
        places = self.centre(board)
        moves = self.of(board, IPositionControl)
        moves.set_reference_speeds([self.SPEED, self.SPEED / 4], [0, 1])
        moves.position_move([places[0] + self.WAY, places[1] + self.WAY], [0, 1])
        self.until_done(board, 0)
        assert not moves.motion_done([0, 1])
        moves.stop([1, 0])
        self.until_done(board, [0, 1])
        assert self.at(board, 1)[0] < places[1] + self.WAY

    def test_stop(self, board: Device):
        """A joint that is stopped during a move stays there, and its motion is done."""
        places = self.centre(board)
        moves = self.of(board, IPositionControl)
        moves.set_reference_speeds(self.SPEED, 0)
        moves.position_move(places[0] + self.WAY, 0)
        self.advance(self.WAY / self.SPEED / 2)
        moves.stop(0)
        self.until_done(board, 0)
        where = self.at(board, 0)
        assert places[0] < where[0] < places[0] + self.WAY
        self.advance(1.0)
        assert self.at(board, 0) == pytest.approx(where, abs=self.TOLERANCE / 5)

    def test_speeds(self, board: Device):
        """A joint runs at the commanded speed, and rests when that is 0."""
        places = self.centre(board)
        speed = self.of(board, IVelocityControl)
        self.of(board, IPositionControl).set_reference_accelerations(500.0, 0)
        self.enter(board, ControlMode.VELOCITY)
        speed.velocity_move(self.WAY, 0)
        self.advance(0.5)
        assert speed.target_velocities(0) == pytest.approx([self.WAY])
        assert places[0] + self.WAY / 10 < self.at(board, 0)[0] < places[0] + self.WAY
        speed.velocity_move(0.0, 0)
        self.advance(0.5)
        where = self.at(board, 0)
        self.advance(0.5)
        assert self.at(board, 0) == pytest.approx(where, abs=self.TOLERANCE / 5)

    def test_mixed_mode_takes_positions_and_speeds(self, board: Device):
        """A joint in mixed mode moves to its target, and runs at the commanded speed, without another mode."""
        places = self.centre(board)
        self.enter(board, ControlMode.MIXED)
        self.go(board, places[0] + self.WAY, 0)
        assert self.at(board, 0) == pytest.approx([places[0] + self.WAY], abs=self.TOLERANCE)
        self.of(board, IPositionControl).set_reference_accelerations(500.0, 0)
        self.of(board, IVelocityControl).velocity_move(-self.WAY, 0)
        self.advance(0.5)
        self.of(board, IVelocityControl).velocity_move(0.0, 0)
        self.advance(0.5)
        assert self.at(board, 0)[0] < places[0] + self.WAY * 0.9
        assert self.mode(board) is ControlMode.MIXED

    def test_without_power_nothing_is_taken(self, board: Device):
        """Commands to a joint that is idle or in fault have no effect on its next mode."""
        places = self.centre(board)
        allowed = self.of(board, IAmplifierControl).max_current(0)
        for off in (ControlMode.IDLE, ControlMode.HARDWARE_FAULT):
            self.enter(board, off)
            self.of(board, IPositionControl).position_move(places[0] + self.WAY, 0)
            self.settle()
            self.of(board, IAmplifierControl).set_max_current(0, allowed)
            self.enter(board, ControlMode.FORCE_IDLE)
            before = self.at(board, 0)
            self.enter(board, ControlMode.POSITION)
            self.advance(0.5)
            assert self.at(board, 0) == pytest.approx(before, abs=self.TOLERANCE)

    def test_positions_are_followed_at_once(self, board: Device):
        """Small steps in position-direct mode are followed without a trajectory."""
        places = self.centre(board)
        self.enter(board, ControlMode.POSITION_DIRECT, [0, 1])
        for step in range(1, 21):
            self.of(board, IPositionDirect).set_positions([places[1] - step / 20, places[0] + step / 20], [1, 0])
            self.advance(0.02)
        self.advance(0.5)
        assert self.at(board, [0, 1]) == pytest.approx([places[0] + 1, places[1] - 1], abs=self.TOLERANCE)

    @pytest.mark.parametrize("mode", [*USER_MODES, ControlMode.IDLE], ids=lambda mode: mode.word)
    def test_commands_of_other_modes_are_ignored(self, board: Device, mode: ControlMode):
        """A command of another mode changes neither target nor setpoint."""
        self.centre(board)
        self.enter(board, mode)
        for other, interface, put, get in _REFERENCES:
            taken = mode is other or (mode in VELOCITY_MODES and other in VELOCITY_MODES)
            if interface in self.LACKING or taken:
                continue
            before = getattr(board.view(interface), get)(0)
            getattr(board.view(interface), put)(before + self.SMALL, 0)
            self.settle()
            assert getattr(board.view(interface), get)(0) == pytest.approx(before), put
        if mode not in TRAJECTORY_MODES:
            moves = self.of(board, IPositionControl)
            before = moves.target_positions(0)
            moves.position_move(before + self.WAY, 0)
            self.settle()
            assert moves.target_positions(0) == pytest.approx(before)

    @pytest.mark.parametrize(("mode", "interface", "put", "get"), _REFERENCES, ids=str)
    def test_references_read_back(self, board: Device, mode: ControlMode, interface: type[Any], put: str, get: str):
        """The last setpoint of one joint, several and all can be read in its mode."""
        axes = self.of(board, IAxisInfo).axes()
        self.centre(board)
        self.enter(board, mode, None)
        device = self.of(board, interface)
        start = getattr(device, get)()
        getattr(device, put)(start[0] + self.SMALL, 0)
        self.settle()
        assert getattr(device, get)(0) == pytest.approx([start[0] + self.SMALL])
        getattr(device, put)([start[1] - self.SMALL, start[0]], [1, 0])
        self.settle()
        assert getattr(device, get)([0, 1]) == pytest.approx([start[0], start[1] - self.SMALL])
        everything = np.clip(start, 0, None)[:axes] if mode is not ControlMode.POSITION_DIRECT else start
        getattr(device, put)(everything)
        self.settle()
        assert getattr(device, get)()[:2] == pytest.approx(everything[:2])

    def test_a_new_mode_begins_without_old_references(self, board: Device):
        """A duty cycle is 0 when its mode is entered again."""
        pwm = self.of(board, IPWMControl)
        self.enter(board, ControlMode.PWM)
        pwm.set_reference_duty_cycles(self.SMALL, 0)
        self.settle()
        self.enter(board, ControlMode.POSITION)
        self.enter(board, ControlMode.PWM)
        assert pwm.reference_duty_cycles(0) == pytest.approx([0.0])

    def test_reference_speeds_and_accelerations(self, board: Device):
        """Reference speeds and accelerations of one, several and all joints can be read."""
        moves = self.of(board, IPositionControl)
        axes = self.of(board, IAxisInfo).axes()
        for put, get in (
            (moves.set_reference_speeds, moves.reference_speeds),
            (moves.set_reference_accelerations, moves.reference_accelerations),
        ):
            put(np.arange(axes) + 10.0)
            put([12.5, 11.5], [1, 0])
            assert get()[:2] == pytest.approx([11.5, 12.5])
            put(13.5, 0)
            assert get(0) == pytest.approx([13.5])

    # Measurements ------------------------------------------------------------------------------------------------

    def test_joints_are_measured_at_one_moment(self, board: Device):
        """The times of all encoders are the same, and increase."""
        self.settle()
        encoders = self.of(board, IEncoders)
        first = encoders.encoder_times()
        self.advance(0.2)
        second = encoders.encoder_times()
        assert np.ptp(first) < 0.5
        assert (second > first).all()

    def test_motors_turn_with_their_joints(self, board: Device):
        """The motor of a joint turns by its motion times the gearbox ratio, unless joints are coupled."""
        places = self.centre(board)
        motors = self.of(board, IMotorEncoders)
        assert motors.motor_encoder_count() == self.of(board, IAxisInfo).axes()
        assert self.of(board, IMotor).motor_count() == motors.motor_encoder_count()
        before = motors.motor_encoders()
        self.go(board, places[0] + self.WAY, 0)
        assert np.abs(motors.motor_encoders() - before).max() > self.WAY

    # Settings ----------------------------------------------------------------------------------------------------

    def test_limits(self, board: Device):
        """Limits of positions and speeds can be set, and swapped ones are refused."""
        limits = self.of(board, IControlLimits)
        low, high = limits.limits(0)
        assert low < high
        limits.set_limits(0, low + 1, high - 1)
        assert limits.limits(0) == pytest.approx((low + 1, high - 1))
        limits.set_limits(0, low, high)
        least, greatest = limits.velocity_limits(0)
        limits.set_velocity_limits(0, least, greatest - 1)
        assert limits.velocity_limits(0) == pytest.approx((least, greatest - 1))
        for call in (
            lambda: limits.set_limits(0, high, low),
            lambda: limits.limits(10**6),
            lambda: limits.velocity_limits(-1),
        ):
            with pytest.raises(RefusedError):
                call()

    def test_values_that_make_no_sense_are_refused(self, board: Device):
        """A value out of its range, such as a gearbox of 0 or a duty cycle over 100 per cent, is refused, not set."""
        refusals = (
            (IMotor, "gearbox_ratio", "set_gearbox_ratio", (0, 0.0)),
            (IMotorEncoders, "counts_per_revolution", "set_counts_per_revolution", (0, 0.0)),
            (IAmplifierControl, "pwm_limit", "set_pwm_limit", (0, 100.5)),
            (IAmplifierControl, "pwm_limit", "set_pwm_limit", (0, -1.0)),
            (IControlLimits, "limits", "set_limits", (0, 5.0, 5.0)),
            (IControlLimits, "velocity_limits", "set_velocity_limits", (0, -1.0, 5.0)),
            (IPositionControl, "reference_speeds", "set_reference_speeds", (-1.0, 0)),
            (IPositionControl, "reference_accelerations", "set_reference_accelerations", (-1.0, 0)),
            (IEncoders, "encoders", "set_encoders", (1e9, 0)),
        )
        self.settle()
        for interface, get, put, arguments in refusals:
            if interface in self.LACKING:
                continue
            device = self.of(board, interface)
            before = getattr(device, get)(0)
            with pytest.raises(RefusedError):
                getattr(device, put)(*arguments)
            assert getattr(device, get)(0) == before, put

    def test_a_joint_in_fault_is_not_calibrated(self, board: Device):
        """The calibration of a joint in fault is refused until it is forced to idle."""
        self.enter(board, ControlMode.HARDWARE_FAULT)
        with pytest.raises(RefusedError):
            self.of(board, IControlCalibration).calibrate_axis(0, CalibrationParameters())
        assert self.mode(board) is ControlMode.HARDWARE_FAULT

    def test_impedance(self, board: Device):
        """Stiffness and damping within the limits are kept, others are refused."""
        springs = self.of(board, IImpedanceControl)
        least_stiffness, stiffness, least_damping, damping = springs.impedance_limits(0)
        assert least_stiffness <= stiffness
        assert least_damping <= damping
        springs.set_impedance(0, stiffness / 2, damping / 2)
        assert springs.impedance(0) == pytest.approx((stiffness / 2, damping / 2))
        with pytest.raises(RefusedError):
            springs.set_impedance(0, stiffness + 1, damping)

    def test_torque_models(self, board: Device):
        """Torque ranges are ordered, and the parameters of a motor can be set."""
        torques = self.of(board, ITorqueControl)
        low, high = torques.torque_range(0)
        assert low <= high
        model = MotorTorqueParameters(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
        torques.set_motor_torque_parameters(0, model)
        assert torques.motor_torque_parameters(0) == model
        low, high = self.of(board, ICurrentControl).current_range(0)
        assert low <= high

    @pytest.mark.parametrize("kind", PidType, ids=lambda kind: kind.name)
    def test_controllers(self, board: Device, kind: PidType):
        """Gains are kept, of one joint and of all; a controller is switched on and off."""
        pids = self.of(board, IPidControl)
        count = pids.pid_count()
        gains = Pid(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
        before = pids.pids(kind)
        assert len(before) == count
        pids.set_pid(kind, 1, gains)
        assert pids.pid(kind, 1) == gains
        assert pids.pid(kind, 0) == before[0]
        pids.set_pid_offset(kind, 1, 0.5)
        assert pids.pid(kind, 1) == gains._replace(offset=0.5)
        pids.set_pids(kind, before)
        with pytest.raises(RobotError):
            pids.set_pids(kind, [gains] * (count - 1))
        assert pids.pids(kind) == before
        pids.enable_pid(kind, 0)
        assert pids.pid_enabled(kind, 0)
        for read in (pids.pid_references, pids.pid_errors, pids.pid_outputs, pids.pid_error_limits):
            assert len(read(kind)) == count
            assert len(read(kind, 1)) == 1
        pids.set_pid_error_limits(kind, 3.5, 0)
        assert pids.pid_error_limits(kind, 0) == pytest.approx([3.5])
        pids.reset_pid(kind, 0)
        with pytest.raises(RefusedError):
            pids.pid(kind, count)

    def test_calibration(self, board: Device):
        """A calibrated joint reports it; a joint that does not exist is refused."""
        calibration = self.of(board, IControlCalibration)
        calibration.set_calibration_parameters(0, CalibrationParameters(3, 1.0, 2.0, 3.0))
        assert calibration.calibration_done(0)

    def test_variables(self, board: Device):
        """Variables are listed and read; an unknown one is refused."""
        variables = self.of(board, IRemoteVariables)
        for name in variables.variables():
            assert isinstance(variables.variable(name), Bottle)
        with pytest.raises(RobotError):
            variables.variable("no such thing")
