"""The motors, amplifiers and controllers of a fake board: values that are stored without effect."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.robot.control_modes import Answer, ControlMode, answer
from rtf.robot.devices.fake_axes import FakeAxes
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import (
    IAmplifierControl,
    ICurrentControl,
    IMotor,
    IMotorEncoders,
    IPidControl,
    Pid,
    PidType,
    selected,
    values_for,
)

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, Values

#: The code of the only fault of a fake board.
OVER_CURRENT = 1
#: Initial values of the motors: gearbox ratio, counts, °C, A, per cent, V.
SETTINGS = {
    "gearbox_ratio": 100.0,
    "counts_per_revolution": 4096.0,
    "temperature_limit": 85.0,
    "max_current": 10.0,
    "nominal_current": 5.0,
    "peak_current": 15.0,
    "pwm_limit": 100.0,
    "supply_voltage": 24.0,
}
_TEMPERATURE = 25.0


class FakeParts:
    """The state shared by all interfaces of a fake board. The interface methods may be called from any thread."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._axes = FakeAxes(np.zeros(0), np.zeros(0), 0.0)
        self._settings: dict[str, FloatArray] = {}
        self._faults: dict[int, tuple[int, str]] = {}

    def _now(self) -> FakeAxes:
        """Return the joints at the present time. The caller holds the lock."""
        self._axes.advance(clock.current().now())
        return self._axes

    def _chosen(self, joints: AxisSelection) -> list[int]:
        return selected(self._axes.count, joints)

    def _given(self, values: Values, joints: AxisSelection) -> tuple[list[int], FloatArray]:
        chosen = self._chosen(joints)
        return chosen, values_for(len(chosen), values)

    def _one(self, joint: int) -> int:
        return self._chosen(joint)[0]

    def _setting(self, name: str, motor: int) -> float:
        return float(self._settings[name][self._one(motor)])

    def _change(self, name: str, motor: int, value: float) -> None:
        chosen, values = self._given(value, motor)
        self._settings[name][chosen] = values


class FakeMotors(FakeParts, IMotor, IMotorEncoders, IAmplifierControl, ICurrentControl):
    """One motor per joint, behind a gearbox."""

    def motor_count(self) -> int:
        return self._axes.count

    def temperatures(self, motors: AxisSelection = None) -> FloatArray:
        return np.full(len(self._chosen(motors)), _TEMPERATURE)

    def temperature_limit(self, motor: int) -> float:
        return self._setting("temperature_limit", motor)

    def set_temperature_limit(self, motor: int, limit: float) -> None:
        self._change("temperature_limit", motor, limit)

    def gearbox_ratio(self, motor: int) -> float:
        return self._setting("gearbox_ratio", motor)

    def set_gearbox_ratio(self, motor: int, ratio: float) -> None:
        if ratio == 0:
            raise RefusedError(f"motor {motor}: no gearbox has a ratio of 0")
        self._change("gearbox_ratio", motor, ratio)

    # Encoders ----------------------------------------------------------------------------------------------------

    def motor_encoder_count(self) -> int:
        return self._axes.count

    def motor_encoders(self, motors: AxisSelection = None) -> FloatArray:
        with self._lock:
            turned = self._now().positions * self._settings["gearbox_ratio"] + self._settings["motor_zero"]
        return turned[self._chosen(motors)]

    def motor_encoder_speeds(self, motors: AxisSelection = None) -> FloatArray:
        with self._lock:
            return (self._now().speeds * self._settings["gearbox_ratio"])[self._chosen(motors)]

    def motor_encoder_accelerations(self, motors: AxisSelection = None) -> FloatArray:
        with self._lock:
            return (self._now().accelerations * self._settings["gearbox_ratio"])[self._chosen(motors)]

    def set_motor_encoders(self, values: Values, motors: AxisSelection = None) -> None:
        chosen, wanted = self._given(values, motors)
        with self._lock:
            self._settings["motor_zero"][chosen] += wanted - self.motor_encoders(chosen)

    def reset_motor_encoders(self, motors: AxisSelection = None) -> None:
        chosen = self._chosen(motors)
        self.set_motor_encoders(np.zeros(len(chosen)), chosen)

    def counts_per_revolution(self, motor: int) -> float:
        return self._setting("counts_per_revolution", motor)

    def set_counts_per_revolution(self, motor: int, counts: float) -> None:
        self._change("counts_per_revolution", motor, counts)

    # Amplifiers --------------------------------------------------------------------------------------------------

    def _request(self, joint: int, mode: int) -> None:
        """Request a mode, by the rules of boards. The caller holds the lock."""
        taken, after = answer(self._axes.modes[joint], mode)
        if taken is Answer.REFUSED:
            raise RefusedError(f"joint {joint}: the control mode {mode} cannot be requested")
        if after is ControlMode.IDLE:
            self._faults.pop(joint, None)
        self._now().enter(joint, after)

    def _fail(self, joint: int, why: str) -> None:
        """Put a joint into hardware fault. The caller holds the lock."""
        self._faults[joint] = OVER_CURRENT, why
        self._now().enter(joint, ControlMode.HARDWARE_FAULT)

    def enable_amplifier(self, joint: int) -> None:
        """Enable the amplifier: an idle joint enters position mode."""
        (chosen,) = self._chosen(joint)
        with self._lock:
            if self._axes.modes[chosen] is ControlMode.IDLE:
                self._request(chosen, ControlMode.POSITION)

    def disable_amplifier(self, joint: int) -> None:
        (chosen,) = self._chosen(joint)
        with self._lock:
            self._request(chosen, ControlMode.IDLE)

    def amplifier_status(self, joints: AxisSelection = None) -> tuple[int, ...]:
        with self._lock:
            return tuple(self._faults.get(joint, (0, ""))[0] for joint in self._chosen(joints))

    def currents(self, motors: AxisSelection = None) -> FloatArray:
        """Return the currents, for both IAmplifierControl and ICurrentControl."""
        with self._lock:
            return self._axes.measured(ControlMode.CURRENT)[self._chosen(motors)]

    def max_current(self, joint: int) -> float:
        return self._setting("max_current", joint)

    def set_max_current(self, joint: int, current: float) -> None:
        self._change("max_current", joint, current)
        if current <= 0:
            with self._lock:
                self._fail(joint, f"over-current: more than the {current:g} A that are allowed")

    def nominal_current(self, motor: int) -> float:
        return self._setting("nominal_current", motor)

    def set_nominal_current(self, motor: int, current: float) -> None:
        self._change("nominal_current", motor, current)

    def peak_current(self, motor: int) -> float:
        return self._setting("peak_current", motor)

    def set_peak_current(self, motor: int, current: float) -> None:
        self._change("peak_current", motor, current)

    def pwm(self, motor: int) -> float:
        with self._lock:
            return float(self._axes.measured(ControlMode.PWM)[self._one(motor)])

    def pwm_limit(self, motor: int) -> float:
        return self._setting("pwm_limit", motor)

    def set_pwm_limit(self, motor: int, limit: float) -> None:
        self._change("pwm_limit", motor, limit)

    def supply_voltage(self, motor: int) -> float:
        return self._setting("supply_voltage", motor)

    # Currents ----------------------------------------------------------------------------------------------------

    def current_range(self, motor: int) -> tuple[float, float]:
        greatest = self.max_current(motor)
        return -greatest, greatest

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        chosen, values = self._given(currents, motors)
        with self._lock:
            greatest = self._settings["max_current"][chosen]
            self._now().refer(ControlMode.CURRENT, chosen, np.clip(values, -greatest, greatest))

    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        with self._lock:
            return self._axes.references[ControlMode.CURRENT][self._chosen(motors)]


class FakePids(FakeParts, IPidControl):
    """Controllers whose gains are stored; they follow perfectly, so errors and outputs are 0."""

    def __init__(self) -> None:
        super().__init__()
        self._pids: dict[PidType, list[Pid]] = {}
        self._enabled: dict[PidType, list[bool]] = {}
        self._pid_references: dict[PidType, FloatArray] = {}
        self._error_limits: dict[PidType, FloatArray] = {}

    def _set_up_pids(self, count: int) -> None:
        for kind in PidType:
            self._pids[kind] = [Pid()] * count
            self._enabled[kind] = [False] * count
            self._pid_references[kind] = np.zeros(count)
            self._error_limits[kind] = np.zeros(count)

    def pid_count(self) -> int:
        return self._axes.count

    def pid(self, kind: PidType, joint: int) -> Pid:
        return self._pids[kind][self._one(joint)]

    def set_pid(self, kind: PidType, joint: int, pid: Pid) -> None:
        values_for(len(pid), pid)
        self._pids[kind][self._one(joint)] = pid

    def pid_references(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        return self._pid_references[kind][self._chosen(joints)]

    def set_pid_references(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        """Store references; nothing moves."""
        chosen, references = self._given(values, joints)
        self._pid_references[kind][chosen] = references

    def pid_errors(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        return np.zeros_like(self.pid_references(kind, joints))

    def pid_outputs(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        return np.zeros_like(self.pid_references(kind, joints))

    def pid_error_limits(self, kind: PidType, joints: AxisSelection = None) -> FloatArray:
        return self._error_limits[kind][self._chosen(joints)]

    def set_pid_error_limits(self, kind: PidType, values: Values, joints: AxisSelection = None) -> None:
        chosen, limits = self._given(values, joints)
        self._error_limits[kind][chosen] = limits

    def set_pid_offset(self, kind: PidType, joint: int, offset: float) -> None:
        (value,) = values_for(1, offset)
        self.set_pid(kind, joint, self.pid(kind, joint)._replace(offset=float(value)))

    def reset_pid(self, kind: PidType, joint: int) -> None:
        self._pid_references[kind][self._one(joint)] = 0.0

    def enable_pid(self, kind: PidType, joint: int) -> None:
        self._enabled[kind][self._one(joint)] = True

    def disable_pid(self, kind: PidType, joint: int) -> None:
        self._enabled[kind][self._one(joint)] = False

    def pid_enabled(self, kind: PidType, joint: int) -> bool:
        return self._enabled[kind][self._one(joint)]
