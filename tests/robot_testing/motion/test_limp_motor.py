"""A motor that is driven by its duty cycle, and whose joint the guard excludes."""

from __future__ import annotations

from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest

from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.guard.transmission import Transmission
from rtf.robot_testing.motion.duty_ramp import LimpMotor, limp
from rtf.robot_testing.motion.part import Part

from ..guard.test_motion_guard import Bench

COUPLED = Transmission(np.ones(3), np.array([[1.0, 0, 0], [0, 1, -1], [0, 1, 1]]), ((0,), (1, 2), (1, 2)))


def test_an_excluded_joint_gets_no_power():
    """Nor does the joint that shares its motors, as the board would power both."""
    with ExitStack() as stack:
        bench = Bench(stack)
        guard = bench.guard()
        part = Part("fake", bench.board, bench.time, guard)

        def fall() -> None:
            with limp(part, COUPLED, 1, held=True) as motor:
                bench.board.set_control_modes([ControlMode.PWM] * 2, [1, 2])
                motor.along = [2]
                guard.exclude(1, "it does again what it may not")
                bench.board.set_control_modes(ControlMode.IDLE, 2)
                raise GuardError("it was stopped", 1)

        with pytest.raises(GuardError):
            fall()
        assert bench.device.control_modes([1, 2]) == (ControlMode.IDLE,) * 2


class Jittery:
    """A joint that creeps by 0.5 deg/s for each % of wrong duty cycle; its encoder has a noise of ``sd``."""

    needed = 12.0  # %

    def __init__(self, sd: float, seed: int, creeps: float = 0.0, signs: tuple[float, float] = (1.0, 1.0)) -> None:
        self.sd, self.creeps, self.signs = sd, creeps, signs
        self.random = np.random.default_rng(seed)
        self.time, self.place, self.mode = 0.0, 30.0, ControlMode.PWM
        self.motor = LimpMotor(
            SimpleNamespace(board=self, clock=self, axes=1, names=["joint"], entering=self.entering),  # type: ignore[arg-type]
            Transmission(np.array([100.0]), np.eye(1), ((0,),)),
            0,
        )
        self.motor.holding = self.duty = self.needed

    def now(self) -> float:
        """See Clock."""
        return self.time

    def encoder(self, joint: int) -> float:
        """See IEncoders."""
        return self.signs[1] * self.place + float(self.random.normal(0.0, self.sd)) + joint

    def motor_encoders(self, motor: int) -> np.ndarray:
        """See IMotorEncoders."""
        return np.array([100.0 * self.signs[0] * self.place + motor])

    def encoder_speeds(self, joint: int) -> np.ndarray:
        """See IEncoders."""
        return np.array([self.creeps * (self.duty - self.needed) * (self.mode is ControlMode.PWM) + joint])

    def set_reference_duty_cycles(self, duties: list[float], motors: list[int]) -> None:
        """See IPWMControl."""
        assert motors == [0]
        (self.duty,) = duties

    def set_interaction_modes(self, mode: InteractionMode, joint: int) -> None:
        """See IInteractionMode."""
        assert (mode, joint) == (InteractionMode.STIFF, 0)

    def set_control_modes(self, mode: ControlMode, joint: int) -> None:
        """See IControlMode."""
        self.mode = mode if joint == 0 else self.mode

    def control_mode(self, joint: int) -> ControlMode:
        """See IControlMode."""
        assert joint == 0
        return self.mode

    def entering(self, mode: ControlMode, joints: list[int]):
        """See Part."""
        self.set_control_modes(mode, *joints)
        yield

    def whether(self, routine) -> bool:
        """Return the result of a routine, with a tick of 20 ms."""
        while True:
            try:
                next(routine)
            except StopIteration as end:
                return end.value
            self.time += 0.02
            if self.mode is ControlMode.PWM:
                self.place += 0.02 * self.creeps * (self.duty - self.needed)


@pytest.mark.parametrize("sd", [0.0, 0.03, 0.05])
def test_noise_of_an_encoder_is_no_creep(sd: float):
    """Healthy encoders have 0.2 deg of it; with a correction the joint would fall."""
    for seed in range(50):
        still = Jittery(sd, seed)
        assert still.whether(still.motor._correct_creep()), seed
        assert abs(still.motor.holding - still.needed) <= 1.0
        assert still.whether(still.motor._comes_to_rest())


@pytest.mark.parametrize("sd", [0.0, 0.03, 0.05])
@pytest.mark.parametrize("off", [-2.0, 1.0])
def test_creep_is_corrected_by_the_duty_cycle(sd: float, off: float):
    """It approaches the duty cycle that holds the joint, in both directions."""
    for seed in range(20):
        creeping = Jittery(sd, seed, creeps=0.5)
        creeping.motor.holding = creeping.needed + off
        assert creeping.whether(creeping.motor._correct_creep()), seed
        assert abs(creeping.motor.holding - creeping.needed) < 0.6


@pytest.mark.parametrize("signs", [(-1.0, 1.0), (1.0, -1.0)])
@pytest.mark.parametrize("off", [-2.0, 1.0])
def test_creep_is_corrected_although_an_encoder_counts_the_wrong_way(signs: tuple[float, float], off: float):
    """Whichever of the two it is: that is for the ramps to find."""
    for seed in range(20):
        creeping = Jittery(0.01, seed, creeps=0.3, signs=signs)
        creeping.motor.holding = creeping.needed + off
        assert creeping.whether(creeping.motor._correct_creep()), seed
        assert abs(creeping.motor.holding - creeping.needed) < 1.0, seed


@pytest.mark.parametrize(("sd", "least", "most"), [(0.0, 0.1, 0.1), (0.03, 0.13, 0.2), (0.05, 0.2, 0.2)])
def test_noise_while_a_joint_is_held_is_no_motion(sd: float, least: float, most: float):
    """For both encoders; without noise a tenth of a degree is motion, and corrected at once."""
    jitter = np.random.default_rng(1).normal(0.0, sd, (20, 1))
    for positions, turns in ((jitter, 0.0 * jitter), (0.0 * jitter, 100.0 * jitter)):
        trace = SimpleNamespace(positions=positions, motor_positions=turns)
        assert least <= Jittery(sd, 1).motor._jitter_of(trace) <= most


def test_a_joint_that_falls_is_not_caught():
    """Nor because of the noise of its encoder."""
    falling = Jittery(0.05, 1, creeps=10.0)
    falling.motor.holding = falling.needed + 8.0
    assert not falling.whether(falling.motor._correct_creep())


@pytest.mark.parametrize("off", [-9.0, 5.0, 1.5, -3.0])
def test_a_joint_that_gives_way_is_held_by_another_duty_cycle(off: float):
    """One of its two motors is weak, and so the duty cycle that held it is not what the other one needs."""
    falling = Jittery(0.01, 1, creeps=8.0)
    falling.motor.holding = falling.needed + off
    assert falling.whether(falling.motor._can_be_held())
    assert abs(falling.motor.holding - falling.needed) < 1.0
    assert falling.mode is ControlMode.PWM
    assert abs(falling.place - 30.0) < 12.0  # each time it was caught at once


def test_a_joint_without_its_motor_is_held_by_no_duty_cycle():
    """It gives way each time, and is given up before the duty cycles could throw it."""
    falling, driven = Jittery(0.0, 1, creeps=8.0), []
    falling.needed = 200.0
    sent = falling.set_reference_duty_cycles
    falling.set_reference_duty_cycles = lambda duties, motors: (driven.append(duties[0]), sent(duties, motors))
    assert not falling.whether(falling.motor._can_be_held())
    assert max(driven) - 12.0 <= 16.0  # 15 and a correction


@pytest.mark.parametrize(("creeps", "most"), [(20.0, 5.0), (0.004, 0.1)])
def test_a_joint_that_falls_is_not_let_down(creeps: float, most: float):
    """Without duty cycle it would fall with 240 deg/s, and is given up at once; a slow one comes to rest."""
    falling = Jittery(0.0, 1, creeps=creeps)
    falling.motor.holding = 0.0
    assert falling.whether(falling.motor._comes_to_rest()) is (creeps < 1.0)
    assert abs(falling.place - 30.0) < most
