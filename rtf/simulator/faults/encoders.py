"""Faults of the encoders at joints and motors, and of torque sensing."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from rtf.simulator.faults.base import AxisFault, Layer, Parameter

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.interfaces import FloatArray

_BIAS = (Parameter("bias", 5.0, "deg", "added to the reading", -360.0, 360.0),)
_RATE = (Parameter("rate", 1.0, "deg/s", "growth of the error", -100.0, 100.0),)
_FACTOR = (Parameter("factor", 1.2, "", "factor of the reading", -10.0, 10.0, healthy=1.0),)


class EncoderFault(AxisFault):
    """A fault of a joint encoder; it affects the controller, too."""

    layer = Layer.ENCODER

    @property
    def among(self) -> list[Callable[[FloatArray, FloatArray, float], None]]:
        """The active faults of encoders of this type."""
        return self.boards.encoder_faults

    def begin(self) -> None:
        self.among.append(self.show)

    def end(self) -> None:
        self.among.remove(self.show)

    @abstractmethod
    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        """Change the measurements (deg, deg/s) in place."""


class MotorEncoderFault(EncoderFault):
    """A fault of the encoder on a motor's rotor."""

    @property
    def among(self) -> list[Callable[[FloatArray, FloatArray, float], None]]:
        return self.boards.motor_encoder_faults


class _Drift(EncoderFault):
    parameters = _RATE
    rate: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        position[self.axis] += self.rate * (now - self.began)
        velocity[self.axis] += self.rate


class EncoderDrift(_Drift):
    """Drift of the joint encoder."""

    kind = "encoder_drift"
    description = "The joint encoder drifts."
    symptom = "The joint follows the drift while its error stays small: only a second sensor, or a limit, shows it."


class MotorEncoderDrift(MotorEncoderFault, _Drift):
    """Drift of the motor encoder."""

    kind = "motor_encoder_drift"
    description = "The motor encoder drifts: it loses ticks."
    symptom = "Joint and motor encoder differ more with every swing."


class _Bias(EncoderFault):
    parameters = _BIAS
    bias: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del velocity, now
        position[self.axis] += self.bias


class EncoderBias(_Bias):
    """Offset of the joint encoder."""

    kind = "encoder_bias"
    description = "The zero of the joint encoder is wrong."
    symptom = "The reading jumps at once; later one limit is met too early, the other too late."


class MotorEncoderBias(MotorEncoderFault, _Bias):
    """Offset of the motor encoder."""

    kind = "motor_encoder_jump"
    description = "The motor encoder has jumped: it has lost ticks once."
    symptom = "The motor encoder does not return to its earlier reading."
    parameters = (Parameter("bias", 360.0, "deg", "of the rotor", -1e5, 1e5),)


class _Scale(EncoderFault):
    parameters = _FACTOR
    factor: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        position[self.axis] *= self.factor
        velocity[self.axis] *= self.factor


class EncoderScale(_Scale):
    """Wrong resolution of the joint encoder."""

    kind = "encoder_scale"
    description = "The resolution of the joint encoder is configured wrongly."
    symptom = "The joint moves less or more than its encoder shows; it does not agree with its motor."


class MotorEncoderScale(MotorEncoderFault, _Scale):
    """Wrong resolution of the motor encoder."""

    kind = "motor_encoder_scale"
    description = "The resolution of the motor encoder is configured wrongly."
    symptom = "The motor turns less or more than joint and gearbox ratio imply."


class _Sign(EncoderFault):
    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        position[self.axis] = -position[self.axis]
        velocity[self.axis] = -velocity[self.axis]


class EncoderSign(_Sign):
    """Wrong counting direction of the joint encoder."""

    kind = "encoder_sign"
    description = "The joint encoder counts the wrong way."
    symptom = "The joint jumps, saturates and runs into a limit."


class MotorEncoderSign(MotorEncoderFault, _Sign):
    """Wrong counting direction of the motor encoder."""

    kind = "motor_encoder_sign"
    description = "The motor encoder counts the wrong way."
    symptom = "A positive duty cycle makes it count down."


class _Frozen(EncoderFault):
    _held: float | None = None

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del now
        if self._held is None:
            self._held = float(position[self.axis])
        position[self.axis] = self._held
        velocity[self.axis] = 0.0


class EncoderFrozen(_Frozen):
    """Constant reading of the joint encoder."""

    kind = "encoder_frozen"
    description = "The joint encoder shows the same value all the time."
    symptom = "The joint moves while its reading does not change."


class MotorEncoderFrozen(MotorEncoderFault, _Frozen):
    """Constant reading of the motor encoder."""

    kind = "motor_encoder_frozen"
    description = "The motor encoder shows the same value all the time."
    symptom = "The joint moves, the reading of its motor does not change."


class EncoderNoise(EncoderFault):
    """Noise of the joint encoder."""

    kind = "encoder_noise"
    description = "The joint encoder is noisy."
    symptom = "Positions jitter, the motor buzzes."
    parameters = (Parameter("deviation", 0.5, "deg", "standard deviation", 0.0, 90.0),)
    deviation: float

    def show(self, position: FloatArray, velocity: FloatArray, now: float) -> None:
        del velocity, now
        position[self.axis] += self.simulation.random.normal(0.0, self.deviation)


class _TorqueFault(AxisFault):
    """A fault of the torque sensing of a joint."""

    layer = Layer.SENSOR

    def begin(self) -> None:
        self.boards.torque_faults.append(self.show)

    def end(self) -> None:
        self.boards.torque_faults.remove(self.show)

    @abstractmethod
    def show(self, torques: FloatArray, now: float) -> None:
        """Change the measurements (Nm) in place."""


class TorqueBias(_TorqueFault):
    """Offset of the torque sensor of a joint."""

    kind = "torque_bias"
    description = "The joint's torque sensing has an offset."
    symptom = "A torque is shown without load; in torque mode the joint drifts away."
    parameters = (Parameter("bias", 3.0, "Nm", "added to the reading", -1e3, 1e3),)
    bias: float

    def show(self, torques: FloatArray, now: float) -> None:
        del now
        torques[self.axis] += self.bias


class TorqueScale(_TorqueFault):
    """Wrong factor of the torque sensor of a joint."""

    kind = "torque_scale"
    description = "The joint's torque sensing has a wrong factor, or a wrong sign."
    symptom = "The torques do not agree with gravity."
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
    TorqueBias,
    TorqueScale,
)
