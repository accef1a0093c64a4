"""Faults of the encoders at joints and motors, and of torque sensing."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.simulator.faults.base import AxisFault, Layer, Parameter

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.interfaces import FloatArray

_BIAS = (Parameter("bias", 5.0, "deg", "what is added", -360.0, 360.0),)
_RATE = (Parameter("rate", 1.0, "deg/s", "how fast it grows", -100.0, 100.0),)
_FACTOR = (Parameter("factor", 1.2, "", "what it is multiplied by", -10.0, 10.0),)


class _EncoderFault(AxisFault):
    """Changes what a joint's encoder shows; the controller goes by it, too."""

    layer = Layer.ENCODER

    @property
    def among(self) -> list[Callable[[FloatArray, FloatArray, float], None]]:
        """The faults of all such encoders."""
        return self.boards.encoder_faults

    def begin(self) -> None:
        self.among.append(self.show)

    def end(self) -> None:
        self.among.remove(self.show)

    @abstractmethod
    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        """Change the measurements (deg, deg/s) in place."""


class _MotorEncoderFault(_EncoderFault):
    """Changes what the encoder on a motor's rotor shows."""

    @property
    def among(self) -> list[Callable[[FloatArray, FloatArray, float], None]]:
        return self.boards.motor_encoder_faults


class _Drift(_EncoderFault):
    parameters = _RATE
    rate: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        position[self.axis] += self.rate * (now - self.began)
        velocity[self.axis] += self.rate


class EncoderDrift(_Drift):
    """See ``meaning``."""

    kind = "encoder_drift"
    meaning = "The joint encoder drifts."
    shows = "The joint follows the drift while its error stays small: only a second sensor, or a limit, tells."


class MotorEncoderDrift(_MotorEncoderFault, _Drift):
    """See ``meaning``."""

    kind = "motor_encoder_drift"
    meaning = "The motor encoder drifts: it loses ticks."
    shows = "Joint and motor encoder differ more with every swing."


class _Bias(_EncoderFault):
    parameters = _BIAS
    bias: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del velocity, now
        position[self.axis] += self.bias


class EncoderBias(_Bias):
    """See ``meaning``."""

    kind = "encoder_bias"
    meaning = "The zero of the joint encoder is wrong."
    shows = "A jump when it happens; then the limits are met too early on one side, too late on the other."


class MotorEncoderBias(_MotorEncoderFault, _Bias):
    """See ``meaning``."""

    kind = "motor_encoder_jump"
    meaning = "The motor encoder has jumped: it has lost ticks once."
    shows = "The motor encoder does not come back to where it was."
    parameters = (Parameter("bias", 360.0, "deg", "of the rotor", -1e5, 1e5),)


class _Scale(_EncoderFault):
    parameters = _FACTOR
    factor: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        position[self.axis] *= self.factor
        velocity[self.axis] *= self.factor


class EncoderScale(_Scale):
    """See ``meaning``."""

    kind = "encoder_scale"
    meaning = "The resolution of the joint encoder is configured wrongly."
    shows = "The joint moves less or more than it says; it does not agree with its motor."


class MotorEncoderScale(_MotorEncoderFault, _Scale):
    """See ``meaning``."""

    kind = "motor_encoder_scale"
    meaning = "The resolution of the motor encoder is configured wrongly."
    shows = "The motor turns less or more than the joint and the gearbox say."


class _Sign(_EncoderFault):
    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        position[self.axis] = -position[self.axis]
        velocity[self.axis] = -velocity[self.axis]


class EncoderSign(_Sign):
    """See ``meaning``."""

    kind = "encoder_sign"
    meaning = "The joint encoder counts the wrong way."
    shows = "The joint jumps, saturates and runs into a limit."


class MotorEncoderSign(_MotorEncoderFault, _Sign):
    """See ``meaning``."""

    kind = "motor_encoder_sign"
    meaning = "The motor encoder counts the wrong way."
    shows = "A positive duty cycle makes it count down."


class _Frozen(_EncoderFault):
    _held: float | None = None

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        if self._held is None:
            self._held = float(position[self.axis])
        position[self.axis] = self._held
        velocity[self.axis] = 0.0


class EncoderFrozen(_Frozen):
    """See ``meaning``."""

    kind = "encoder_frozen"
    meaning = "The joint encoder shows the same value for ever."
    shows = "The joint does not move by its own account while it does in truth."


class MotorEncoderFrozen(_MotorEncoderFault, _Frozen):
    """See ``meaning``."""

    kind = "motor_encoder_frozen"
    meaning = "The motor encoder shows the same value for ever."
    shows = "The joint moves, its motor does not."


class EncoderNoise(_EncoderFault):
    """See ``meaning``."""

    kind = "encoder_noise"
    meaning = "The joint encoder is noisy."
    shows = "Positions jitter, the motor buzzes."
    parameters = (Parameter("deviation", 0.5, "deg", "standard deviation", 0.0, 90.0),)
    deviation: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del velocity, now
        position[self.axis] += self.simulation.random.normal(0.0, self.deviation)


class Backlash(_MotorEncoderFault):
    """See ``meaning``."""

    kind = "backlash"
    meaning = "The gearbox has play: the rotor turns a bit before the joint does."
    shows = "The motor encoder leads the joint by half the play, on the side to which it drives."
    parameters = (Parameter("play", 3.0, "deg", "of the joint, from side to side", 0.0, 90.0),)
    play: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del velocity, now
        towards = 1.0 if self.boards.output[self.axis] > 0 else -1.0
        column = self.boards.joint_to_motor[:, self.axis] * self.boards.gearbox
        position += column * towards * self.play / 2


class _TorqueFault(AxisFault):
    """Changes what the torque sensing of a joint shows."""

    layer = Layer.SENSOR

    def begin(self) -> None:
        self.boards.torque_faults.append(self.show)

    def end(self) -> None:
        self.boards.torque_faults.remove(self.show)

    @abstractmethod
    def show(self, torques: FloatArray, now: float) -> None:
        """Change the measurements (Nm) in place."""


class TorqueBias(_TorqueFault):
    """See ``meaning``."""

    kind = "torque_bias"
    meaning = "The joint's torque sensing has an offset."
    shows = "Torque without load; in torque mode the joint drifts away."
    parameters = (Parameter("bias", 3.0, "Nm", "what is added", -1e3, 1e3),)
    bias: float

    def show(self, torques: FloatArray, now: float) -> None:
        del now
        torques[self.axis] += self.bias


class TorqueScale(_TorqueFault):
    """See ``meaning``."""

    kind = "torque_scale"
    meaning = "The joint's torque sensing has a wrong factor, or a wrong sign."
    shows = "Torques do not agree with gravity."
    parameters = _FACTOR
    factor: float

    def show(self, torques: FloatArray, now: float) -> None:
        del now
        torques[self.axis] *= self.factor


KINDS = (
    EncoderDrift,
    EncoderBias,
    EncoderScale,
    EncoderSign,
    EncoderFrozen,
    EncoderNoise,
    MotorEncoderDrift,
    MotorEncoderBias,
    MotorEncoderScale,
    MotorEncoderSign,
    MotorEncoderFrozen,
    Backlash,
    TorqueBias,
    TorqueScale,
)
