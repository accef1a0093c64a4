"""Every kind of fault, in a robot without a network: what it claims shows, and afterwards nothing of it is left."""

from __future__ import annotations

import copy
import dataclasses
import os
import re
import signal
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from icub import ICUB, INDEX, build_icub
from rtf.middleware.types import Stamp
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import SensorCategory
from rtf.robot.model.file import Battery
from rtf.simulator.faults import KINDS, FaultInjector, Layer, Target, catalogue, find_kind
from rtf.simulator.faults.injection import MOST_FAULTS
from rtf.simulator.simulated_outlets import SimulatedOutlet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.simulator.faults import Fault
    from rtf.simulator.plant import Plant

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

#: For the robot of these tests, which has none.
BATTERY = Battery(capacity=200.0, full=42.0, empty=30.0, max_current=30.0, idle_power=50.0)
PORT = "/icubSim/left_arm/state:o"
JOINT = "l_elbow"
ELBOW = INDEX[JOINT]
HERE = np.array([ELBOW])
#: What of the boards is not state: where it is kept, and what is computed anew at each step.
_NOT_STATE = {"plant", "axes", "data", "controllers", "setpoints", "_scratch", "_snapshot"}
#: The numbers of the controllers that follow from their configuration and the modes.
_CONTROLLERS = ("kp_kd", "ki", "limit", "_bias")


@cache
def model() -> Plant:
    """A model to be copied."""
    return build_icub()


class Outlet:
    """A port that keeps what is written, and when."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.outputs = ()
        self.closed = False
        self.written: list[tuple[float, object]] = []
        self.envelopes: list[str] = []

    def write(self, value: object, *, envelope: str) -> None:
        """Keep it."""
        self.written.append((self.bench.simulation.now, value))
        self.envelopes.append(envelope)


class Bench:
    """All of a simulated robot that faults strike, without ports; at 0.2 s everything has settled."""

    def __init__(self, seed: int = 0, age: float = 0.2) -> None:
        from rtf.simulator.battery import SimulatedBattery
        from rtf.simulator.part import SimulatedPart
        from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu
        from rtf.simulator.simulation import Simulation
        from rtf.simulator.skin import SimulatedSkin

        own = dataclasses.replace(model(), model=copy.copy(model().model))
        self.simulation = Simulation(own, seed=seed)
        self.boards = self.simulation.boards
        self.arm = SimulatedPart("left_arm", self.boards)
        self.force_torques = {"left_arm": SimulatedForceTorque(own.ft_sensors[0], self.simulation)}
        self.model = ICUB
        self.imus = {"inertial": SimulatedImu(own.imus[0], self.simulation)}
        self.battery = SimulatedBattery(BATTERY, self.simulation)
        self.simulation.publish_regularly(self.battery)
        self.skin = {"left_hand": SimulatedSkin("left_hand", ICUB.sensors.skin["left_hand"], self.simulation)}
        self.cameras = {
            name: SimpleNamespace(faults=[], picture=lambda shade=shade: (np.full((24, 32, 3), shade, np.uint8), 0.0))
            for name, shade in (("left", 100), ("right", 200))
        }
        self.depth_cameras = {"depth": SimpleNamespace(faults=[])}
        self.port = Outlet(self)
        self.outlet = SimulatedOutlet(self.port, self.simulation)  # type: ignore[arg-type]  # it writes, as that does
        self.outlets = SimpleNamespace(by_name={PORT: self.outlet})
        self.faults = FaultInjector(self)  # type: ignore[arg-type]  # it has what faults look for
        self.run(age)

    def inject(self, kind: str, **options: Any) -> int:
        """Break something with its own parameters, at what it strikes."""
        return self.faults.inject(kind, TARGETS[find_kind(kind).target_kind], **options)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.simulation.advance(self.simulation.now + seconds)

    def move(self, target: float, seconds: float = 0.6) -> None:
        """Move the elbow, quickly, and let time pass."""
        self.boards.speeds[ELBOW] = 100.0
        self.boards.move(HERE, np.array([target]))
        self.run(seconds)

    @property
    def true(self) -> float:
        """Where the elbow is (deg), whatever the encoder shows."""
        return float(np.degrees(self.simulation.data.actuator_length[ELBOW]))

    @property
    def shown(self) -> float:
        """Where the encoder shows it."""
        return self.arm.encoders(3).item()

    @property
    def mode(self) -> ControlMode:
        """The mode of the elbow."""
        (mode,) = self.arm.control_modes([3])
        return mode

    def pictures(self, count: int = 2) -> list[np.ndarray]:
        """Pictures of something that moves, as the camera sends them."""
        shown = []
        for number in range(count):
            pixels = np.full((24, 32, 3), 10 + number, np.uint8)
            for fault in self.cameras["left"].faults:
                pixels = fault(pixels, self.simulation.now)
            shown.append(pixels)
        return shown

    def publish(self, count: int = 200, period: float = 0.01) -> list[tuple[float, object]]:
        """Write numbers, one each period; returns what came out, and when."""
        del self.port.written[:], self.port.envelopes[:]
        for number in range(count):
            self.outlet.write(number, envelope=f"{number} {self.simulation.now:g}")
            self.run(period)
        self.run(0.1)
        return list(self.port.written)


TARGETS = {
    Target.AXIS: JOINT,
    Target.FORCE_TORQUE: "left_arm",
    Target.IMU: "imu",
    Target.CAMERA: "left",
    Target.PORT: PORT,
    Target.ROBOT: "",
    Target.BATTERY: "battery",
    Target.SKIN: "left_hand",
    Target.DEPTH_CAMERA: "depth",
}


@pytest.fixture
def bench() -> Bench:
    """A healthy robot."""
    return Bench()


def numbers_of(thing: object, names: Iterable[str]) -> dict[str, object]:
    """Parts of an object, such that they can be compared."""
    return {name: comparable(getattr(thing, name)) for name in names}


def comparable(value: object) -> object:
    """Bytes, or text without addresses."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, list) and value and isinstance(value[0], np.ndarray):
        return [one.tobytes() for one in value]
    return re.sub(r" at 0x\w+", "", repr(value))


def health(bench: Bench) -> dict[str, object]:
    """Everything that a fault may change and has to put back."""
    boards = bench.boards
    names = [name for name in vars(boards) if name.startswith("configured_") or name.endswith("_faults")]
    names += ["minimum", "maximum", "limit_slack", "speed_factors", "pids", "max_current"]
    found = numbers_of(boards, names) | numbers_of(boards.controllers, _CONTROLLERS)
    engine = bench.simulation.plant.model
    found["friction"] = [engine.dof_frictionloss.tobytes(), engine.dof_damping.tobytes()]
    found["motors"] = [list(boards.motors.faults), boards.motors.short_circuits.tobytes()]
    found["gears"] = [list(boards.motors.gears.faults), engine.dof_armature.tobytes()]
    found["pushed"] = bench.simulation.data.qfrc_applied.tobytes()
    found["limits"] = (boards.trajectories.minimum.tobytes(), boards.trajectories.maximum.tobytes())
    found["reported"] = [list(bench.imus["inertial"].faults), list(bench.force_torques["left_arm"].faults)]
    found["measured"] = list(bench.depth_cameras["depth"].faults)
    found["felt"] = list(bench.skin["left_hand"].faults)
    found["drained"] = [list(bench.battery.weaknesses), list(bench.battery.faults)]
    found["seen"] = [list(camera.faults) for camera in bench.cameras.values()]
    found["sent"] = [*bench.outlet.disturbances, *bench.outlet.restamps]
    return found


def state(bench: Bench) -> dict[str, object]:
    """All that the future of a robot depends on."""
    data = bench.simulation.data
    physics = {
        name: getattr(data, name).tobytes() for name in ("qpos", "qvel", "act", "ctrl", "qfrc_applied", "xfrc_applied")
    }
    return {
        **health(bench),
        **physics,
        **numbers_of(bench.boards, vars(bench.boards).keys() - _NOT_STATE),
        "windings": numbers_of(bench.boards.motors, vars(bench.boards.motors)),
        "friction": numbers_of(bench.simulation.friction, ("torque", "_stiffness", "_anchor", "_until")),
        "gathered": bench.boards.controllers._base.tobytes(),
        "references": numbers_of(bench.boards.trajectories, vars(bench.boards.trajectories)),
        "battery": (bench.battery.left, bench.battery.reading),
        "random": str(bench.simulation.random.bit_generator.state),
    }


# What each claims --------------------------------------------------------------------------------------------------


def held_jam(bench: Bench) -> None:
    """It does not move, however much it is driven."""
    before, output = bench.true, abs(bench.boards.output[ELBOW])
    bench.move(80.0)
    assert abs(bench.true - before) < 0.5
    assert abs(bench.boards.output[ELBOW]) > 5 * output


def rubs(bench: Bench) -> None:
    """It takes as much more output to move it."""
    healthy = Bench()
    for one in (healthy, bench):
        one.move(80.0, 0.2)
    more = (bench.boards.output - healthy.boards.output)[ELBOW] * bench.boards.newton_metres[ELBOW]
    assert 3.0 < more < 7.0


def rubs_with_its_speed(bench: Bench) -> None:
    """In the middle of a move it takes as much more as its peak speed explains, of 10 Nm at 100 deg/s."""
    healthy = Bench()
    for speed in (20.0, 60.0):
        for one in (healthy, bench):
            one.boards.speeds[ELBOW] = speed
            one.boards.move(HERE, np.array([80.0 if speed < 30.0 else 45.0]))
            one.run(0.5 * 35.0 / speed)
        more = (bench.boards.output - healthy.boards.output)[ELBOW] * bench.boards.newton_metres[ELBOW]
        assert more == pytest.approx(0.1 * bench.boards.velocity[ELBOW], rel=0.25)
        for one in (healthy, bench):
            one.run(35.0 / speed)


def sticks_in_a_place(bench: Bench) -> None:
    """It takes 5 Nm more in the middle of its range, and none beside it."""
    hinge = bench.simulation.plant.dofs[ELBOW][0]
    losses = bench.simulation.plant.model.dof_frictionloss
    assert losses[hinge] == 0.0
    bench.boards.speeds[ELBOW] = 40.0
    bench.boards.move(HERE, np.array([80.0]))
    seen = {}
    for _ in range(1200):
        bench.run(0.001)
        seen[round(bench.true, 1)] = float(losses[hinge])
    sticky = [place for place, torque in seen.items() if torque == 5.0]
    assert sticky
    assert min(sticky) == pytest.approx(57.5, abs=0.3)
    assert max(sticky) == pytest.approx(63.5, abs=0.3)


def jams_at_times(bench: Bench) -> None:
    """In a long move it stops for a while, and still arrives."""
    speeds = []
    for target in (100.0, 20.0):
        bench.boards.speeds[ELBOW] = 20.0
        bench.boards.move(HERE, np.array([target]))
        bench.run(0.5)
        speeds += errors_in(bench, lambda: abs(float(bench.boards.velocity[ELBOW])), 1.5).tolist()
        bench.run(3.0)
    assert 50 < sum(speed < 1.0 for speed in speeds) < 1500
    assert bench.true == pytest.approx(20.0, abs=1.0)


def is_pushed(bench: Bench) -> None:
    """A stiff joint needs torque to hold, a compliant one gives way."""
    weight = Bench().boards.measured_torques()[ELBOW]
    bench.run(0.5)
    # Dry friction takes a part, on one side or the other.
    assert bench.boards.measured_torques()[ELBOW] == pytest.approx(weight - 2.0, abs=0.8)
    before = bench.true
    bench.arm.set_interaction_modes(InteractionMode.COMPLIANT, [3])
    bench.run(0.5)
    assert bench.true > before + 2.0


def falls(bench: Bench) -> None:
    """It falls, and does not come back."""
    before = bench.true
    bench.run(0.5)
    assert abs(bench.true - before) > 5.0


def is_weak(bench: Bench) -> None:
    """It takes more output to hold the same weight."""
    before = Bench().boards.output[ELBOW]
    bench.run(1.0)
    assert bench.boards.output[ELBOW] > 2.5 * before


def runs_away(bench: Bench) -> None:
    """It goes away from its target, to a limit."""
    bench.run(1.0)
    low, high = bench.arm.limits(3)
    assert min(abs(bench.true - low), abs(bench.true - high)) < 3.0


def burns(bench: Bench) -> None:
    """The current reads higher, and the joint is switched off within a tenth of a second."""
    assert bench.arm.currents(3).item() > 15.0
    bench.run(0.1)
    assert bench.mode is ControlMode.HARDWARE_FAULT
    code, message = bench.arm.last_joint_fault(3)
    assert code
    assert "over-current" in message


def flowing(bench: Bench) -> tuple[float, float]:
    """The current that the elbow's motor shows, and the one that flows (A), each over a tenth of a second."""
    shown, true = [], []
    for _ in range(100):
        bench.run(0.001)
        shown.append(bench.arm.currents(3).item())
        true.append(float(bench.boards.motors.current[ELBOW]))
    assert abs(np.mean(true)) > 0.2
    return float(np.mean(shown)), float(np.mean(true))


def shows_no_current(bench: Bench) -> None:
    """Although the motor holds the arm."""
    assert flowing(bench)[0] == 0.0


def shows_half_the_current(bench: Bench) -> None:
    """The other half flows, too."""
    shown, true = flowing(bench)
    assert shown == pytest.approx(0.5 * true, abs=0.02)


def shows_the_opposite_current(bench: Bench) -> None:
    """As large as what flows."""
    shown, true = flowing(bench)
    assert shown == pytest.approx(-true, abs=0.02)


def shows_more_current(bench: Bench) -> None:
    """By half an ampere."""
    shown, true = flowing(bench)
    assert shown == pytest.approx(true + 0.5, abs=0.02)


def shows_a_noisy_current(bench: Bench) -> None:
    """By half an ampere, from reading to reading; the mean of hundred readings by a tenth of it."""
    shown, true = flowing(bench)
    assert shown == pytest.approx(true, abs=0.2)
    readings = []
    for _ in range(400):
        bench.run(0.001)
        readings.append(bench.arm.currents(3).item())
    assert np.std(readings) == pytest.approx(0.5, rel=0.2)


def resists(bench: Bench) -> None:
    """For the same current it needs three times the duty cycle."""
    drive = ICUB.axis(JOINT).drive
    healthy = flowing(bench)[1] * drive.resistance / drive.supply * 100.0
    assert bench.arm.duty_cycles(3).item() == pytest.approx(3.0 * healthy, rel=0.05)


def is_interrupted(bench: Bench) -> None:
    """For 0.05 s at a time no current flows, about twice a second; otherwise one does."""
    flows = []
    for _ in range(8000):
        bench.run(0.001)
        flows.append(bench.boards.motors.current[ELBOW] != 0.0)
    changes = np.flatnonzero(np.diff(flows)) + 1
    assert 5 <= len(changes) // 2 <= 30
    lengths = np.diff(changes)[0 if flows[0] else 1 :: 2]
    assert lengths.tolist() == pytest.approx([50] * len(lengths), abs=1)


def drives_weakly(bench: Bench) -> None:
    """For the same current it needs twice the duty cycle upwards; downwards it does not."""
    drive = ICUB.axis(JOINT).drive
    healthy = flowing(bench)[1] * drive.resistance / drive.supply * 100.0
    assert bench.arm.duty_cycles(3).item() == pytest.approx(2.0 * healthy, rel=0.05)
    bench.boards.request_mode(ELBOW, ControlMode.PWM)
    for duty, share in ((10.0, 0.5), (-10.0, 1.0)):
        bench.boards.drive(HERE, np.array([duty]))
        bench.run(0.001)
        induced = bench.boards.motors._to_voltages[ELBOW] @ bench.boards.motors._turning
        volts = bench.boards.motors.current[ELBOW] * drive.resistance + induced
        assert volts == pytest.approx(share * duty / 100.0 * drive.supply, rel=1e-6)


def drifts(bench: Bench) -> None:
    """The encoder is off by as much as has had time to grow, and the joint has followed."""
    before = bench.true
    bench.run(2.0)
    assert bench.shown - bench.true == pytest.approx(2.0, abs=0.02)
    assert bench.true == pytest.approx(before - 2.0, abs=0.2)


def is_biased(bench: Bench) -> None:
    """It is off at once, by 5 degrees."""
    bench.run(0.001)
    assert bench.shown - bench.true == pytest.approx(5.0, abs=0.02)


def is_scaled(bench: Bench) -> None:
    """It shows 1.2 times what is true."""
    bench.run(0.5)
    assert bench.shown == pytest.approx(1.2 * bench.true, abs=0.02)


def counts_down(bench: Bench) -> None:
    """What it shows has the other sign."""
    bench.run(0.05)
    assert bench.shown == pytest.approx(-bench.true, abs=0.5)  # a millisecond old, of a joint that runs away


def shows_the_same(bench: Bench) -> None:
    """It shows the same while the joint moves."""
    bench.run(0.001)
    shown, true = bench.shown, bench.true
    bench.move(60.0, 0.3)
    assert bench.shown == shown
    assert abs(bench.true - true) > 3.0
    assert bench.arm.encoder_speeds(3).item() == 0.0


def jitters(bench: Bench) -> None:
    """It deviates from what is true by half a degree."""
    errors = []
    for _ in range(300):
        bench.run(0.001)
        errors.append(bench.shown - bench.true)
    assert 0.4 < np.std(errors) < 0.6


def exchanges_its_encoder(bench: Bench) -> None:
    """It shows the position of the next joint, which shows that of the elbow; at first both are held as they are."""
    before = bench.true
    bench.run(0.02)
    assert bench.true == pytest.approx(before, abs=0.5)
    angles = np.degrees(bench.simulation.data.actuator_length)
    assert bench.arm.encoders([3, 4]) == pytest.approx(angles[[ELBOW + 1, ELBOW]], abs=0.02)


def exchanges_its_motor_encoder(bench: Bench) -> None:
    """Its motor's encoder stands still while it moves; that of the next motor turns."""
    before = bench.arm.motor_encoders([3, 4])
    bench.move(bench.true + 10.0)
    assert np.abs(bench.arm.motor_encoders([3, 4]) - before) == pytest.approx([0.0, 1000.0], abs=100.0)


def exchanges_its_motor(bench: Bench) -> None:
    """Moved, it drives the next joint, which drives it."""
    before = bench.true, bench.arm.encoders(4).item()
    bench.boards.speeds[ELBOW] = 100.0
    bench.boards.move(HERE, np.array([before[0] + 10.0]))
    bench.run(0.1)
    assert abs(bench.arm.encoders(4).item() - before[1]) > 5.0


def motor(bench: Bench) -> tuple[float, float]:
    """The angle that the elbow's motor shows, and the one at which it is (deg)."""
    true = bench.boards.gearbox * (bench.boards.joint_to_motor @ np.degrees(bench.simulation.data.actuator_length))
    return bench.arm.motor_encoders(3).item(), float(true[ELBOW])


def motor_drifts(bench: Bench) -> None:
    """The motor's encoder is off by as much as has had time to grow; the joint's is right."""
    bench.run(2.0)
    shown, true = motor(bench)
    assert shown - true == pytest.approx(2.0, abs=0.5)
    assert bench.shown == pytest.approx(bench.true, abs=0.02)


def motor_jumps(bench: Bench) -> None:
    """It is off by a turn."""
    shown, true = motor(bench)
    assert shown - true == pytest.approx(360.0, abs=0.5)


def motor_is_scaled(bench: Bench) -> None:
    """It has turned 1.2 times as much as the joint and the gearbox say."""
    bench.move(60.0)
    shown, true = motor(bench)
    assert shown == pytest.approx(1.2 * true, abs=0.5)


def motor_counts_down(bench: Bench) -> None:
    """It goes the other way."""
    before = motor(bench)
    bench.move(60.0)
    after = motor(bench)
    assert after[0] - before[0] == pytest.approx(before[1] - after[1], abs=0.5)


def motor_shows_the_same(bench: Bench) -> None:
    """The joint moves, its motor does not."""
    before = motor(bench)[0]
    bench.move(60.0)
    assert motor(bench)[0] == before
    assert bench.shown == pytest.approx(60.0, abs=0.5)


def errors_in(bench: Bench, look: Callable[[], float], seconds: float) -> np.ndarray:
    """What ``look`` returns in each millisecond."""
    found = []
    for _ in range(round(seconds * 1e3)):
        bench.run(0.001)
        found.append(look())
    return np.array(found)


def loses_counts(bench: Bench) -> None:
    """Slow moves are right; a fast one is longer than the encoder shows, by a twentieth of what was fast."""
    bench.boards.speeds[ELBOW] = 10.0
    bench.boards.move(HERE, np.array([50.0]))
    bench.run(1.0)
    assert bench.shown == pytest.approx(bench.true, abs=0.02)
    bench.move(85.0, 1.0)
    assert 1.0 < bench.true - bench.shown < 0.05 * 38.0


def has_spikes(bench: Bench) -> None:
    """Some readings are five degrees off, to either side; all others are right."""
    errors = errors_in(bench, lambda: bench.shown - bench.true, 3.0)
    wrong = np.abs(errors) > 0.5
    assert 10 <= wrong.sum() <= 120
    assert np.abs(errors[wrong]) == pytest.approx(5.0, abs=0.2)


def is_old(bench: Bench) -> None:
    """It shows where the joint was 20 ms ago, and a board is a millisecond late."""
    bench.boards.speeds[ELBOW] = 100.0
    bench.boards.move(HERE, np.array([80.0]))
    true = errors_in(bench, lambda: bench.true, 0.1)  # later its controller swings, and it may be at a turning point
    assert bench.shown == pytest.approx(true[-22], abs=0.02)
    assert abs(true[-22] - bench.true) > 0.5


def is_off_centre(bench: Bench) -> None:
    """The error is the sine of the angle."""
    for target in (60.0, 90.0):
        bench.move(target, 1.0)
        assert bench.shown - bench.true == pytest.approx(2.0 * np.sin(np.radians(bench.true)), abs=0.02)


def motor_loses_counts(bench: Bench) -> None:
    """After a fast move the motor shows less than it has turned, by a twentieth of what was fast."""
    bench.boards.speeds[ELBOW] = 100.0
    bench.boards.move(HERE, np.array([80.0]))
    errors_in(bench, lambda: motor(bench)[0], 1.0)
    shown, true = motor(bench)
    assert 1.0 < (true - shown) / bench.boards.gearbox[ELBOW] < 0.05 * 35.0


def motor_has_spikes(bench: Bench) -> None:
    """Some readings are 500 degrees off."""

    def error() -> float:
        shown, true = motor(bench)
        return shown - true

    errors = errors_in(bench, error, 3.0)
    wrong = np.abs(errors) > 100.0
    assert 10 <= wrong.sum() <= 120
    assert np.abs(errors[wrong]) == pytest.approx(500.0, abs=1.0)


def motor_is_old(bench: Bench) -> None:
    """It shows what it had turned 20 ms ago, although nobody may have looked then."""
    bench.boards.speeds[ELBOW] = 100.0
    bench.boards.move(HERE, np.array([80.0]))
    true = []
    for _ in range(20):
        bench.run(0.01)
        shown, now = motor(bench)
        true.append(now)
    assert shown == pytest.approx(true[-3], abs=1.0)
    assert abs(true[-3] - true[-1]) > 50.0


def has_play(bench: Bench) -> None:
    """The motor is ahead of the joint by half the play, or behind it."""
    assert lead(bench) == pytest.approx(1.5, abs=0.6)


def lead(bench: Bench) -> float:
    """How far the elbow's motor is from the joint, degrees of the joint, at most."""
    leads = []
    for _ in range(50):
        bench.run(0.01)
        shown, true = motor(bench)
        leads.append(abs(shown - true) / bench.boards.gearbox[ELBOW])
    return max(leads)


def gear_bends(bench: Bench) -> None:
    """The motor is ahead of the joint by a tenth of a degree for each newton metre."""
    bench.run(0.5)
    torque = abs(float(bench.simulation.data.actuator_force[ELBOW]))
    assert lead(bench) == pytest.approx(0.1 * torque, rel=0.1)


def torque_is_biased(bench: Bench) -> None:
    """It shows 3 Nm more than there are."""
    assert bench.arm.torques(3).item() == pytest.approx(bench.boards.torque_sensors.torques()[ELBOW] + 3.0)


def torque_is_scaled(bench: Bench) -> None:
    """It shows 1.2 times what there is."""
    assert bench.arm.torques(3).item() == pytest.approx(1.2 * bench.boards.torque_sensors.torques()[ELBOW])


def misses(bench: Bench) -> None:
    """Every other move does not begin."""
    begun = []
    for target in (50.0, 60.0, 55.0, 65.0):
        before = bench.shown
        bench.arm.set_reference_speeds(100.0, 3)
        bench.arm.position_move(target, 3)
        bench.run(0.3)
        begun.append(abs(bench.shown - before) > 1.0)
    assert begun == [True, False, True, False]


def goes_on(bench: Bench) -> None:
    """It arrives, although it was told to stop on its way."""
    bench.arm.set_reference_speeds(50.0, 3)
    bench.arm.position_move(70.0, 3)
    bench.run(0.2)
    bench.arm.stop([3])
    bench.run(1.0)
    assert bench.shown == pytest.approx(70.0, abs=1.0)


def is_twice_as_fast(bench: Bench) -> None:
    """It is there after half of the time, by the speed that it reports."""
    bench.arm.set_reference_speeds(20.0, 3)
    assert bench.arm.reference_speeds(3).item() == 20.0
    bench.arm.position_move(bench.shown + 20.0, 3)
    begin = bench.shown
    bench.run(0.6)
    assert bench.shown == pytest.approx(begin + 20.0, abs=1.0)


def leaves_its_fault(bench: Bench) -> None:
    """A joint in fault takes any mode."""
    bench.boards.fault(ELBOW, 1, "broken")
    bench.arm.set_control_modes([ControlMode.VELOCITY], [3])
    assert bench.mode is ControlMode.VELOCITY


def ignores_modes(bench: Bench) -> None:
    """It says yes and stays."""
    bench.arm.set_control_modes([ControlMode.TORQUE], [3])
    assert bench.mode is ControlMode.POSITION


def obeys_in_any_mode(bench: Bench) -> None:
    """A position move moves it in velocity mode, which takes none; in torque mode it does not."""
    healthy = Bench()
    for mode, obeyed in (("VELOCITY", True), ("TORQUE", False)):
        for one, moves in ((healthy, False), (bench, obeyed)):
            one.arm.set_control_modes([ControlMode[mode]], [3])
            before = float(one.boards.targets[ELBOW])
            one.arm.position_move(before + 5.0, 3)
            assert float(one.boards.targets[ELBOW]) == before + 5.0 * moves


def takes_another_mode(bench: Bench) -> None:
    """Torque becomes position; everything else is as it should be."""
    for asked, there in (("VELOCITY", "VELOCITY"), ("TORQUE", "POSITION")):
        bench.arm.set_control_modes([ControlMode[asked]], [3])
        assert bench.mode is ControlMode[there]


def shows_old_modes(bench: Bench) -> None:
    """The joint is in velocity mode at once, and shown to be in position mode for a second more."""
    bench.arm.set_control_modes([ControlMode.VELOCITY], [3])
    bench.run(0.1)
    assert bench.boards.mode[ELBOW] == ControlMode.VELOCITY
    assert bench.arm.control_modes([3]) == (ControlMode.POSITION,)
    bench.run(1.0)
    assert bench.arm.control_modes([3]) == (ControlMode.VELOCITY,)


def shows_idle_for_moments(bench: Bench) -> None:
    """One state of about forty, while the board controls the position."""
    shown = []
    for _ in range(2000):
        bench.run(0.01)
        shown.append(bench.arm.control_modes([3])[0])
        assert bench.boards.mode[ELBOW] == ControlMode.POSITION
    assert {*shown} == {ControlMode.POSITION, ControlMode.IDLE}
    assert 10 <= shown.count(ControlMode.IDLE) <= 120


def goes_beyond(bench: Bench) -> None:
    """It carries a command out that ends beyond the limit that it reports."""
    healthy = Bench()
    for one in (healthy, bench):
        one.arm.set_reference_speeds(100.0, 3)
        one.arm.position_move(200.0, 3)
    limit = bench.arm.limits(3)[1]
    assert float(healthy.boards.targets[ELBOW]) == limit
    assert float(bench.boards.targets[ELBOW]) == limit + 5.0


def reports_another_gearbox(bench: Bench) -> None:
    """It reports 1.5 times what is built in; the motor turns as ever."""
    assert bench.arm.gearbox_ratio(3) == pytest.approx(1.5 * bench.boards.gearbox[ELBOW])
    shown, true = motor(bench)
    assert shown == pytest.approx(true, abs=0.5)


def upper_limit_is_wrong(bench: Bench) -> None:
    """The limit that is reported is 10 degrees too high, and kept; the lower one is right."""
    low, high = Bench().arm.limits(3)
    assert bench.arm.limits(3) == (low, high + 10.0)
    bench.arm.position_move(500.0, 3)
    assert bench.boards.targets[ELBOW] == high + 10.0


def lower_limit_is_wrong(bench: Bench) -> None:
    """Likewise at the other end, 10 degrees too low."""
    low, high = Bench().arm.limits(3)
    assert bench.arm.limits(3) == (low - 10.0, high)


def reports_another_coupling(bench: Bench) -> None:
    """The row of the joint is half of what it should be; the mechanics are as ever."""
    wrong = bench.boards.configured_couplings[ELBOW]
    assert np.array_equal(wrong, 0.5 * bench.boards.joint_to_motor[ELBOW])


def is_slack(bench: Bench) -> None:
    """The joint lags behind far more than it should, and the gains that are reported are small."""
    healthy = Bench()
    for one in (healthy, bench):
        one.move(80.0, 0.15)
    assert abs(bench.boards.error[ELBOW]) > 3 * abs(healthy.boards.error[ELBOW])
    assert bench.boards.pids[ELBOW].kp == pytest.approx(0.05 * healthy.boards.pids[ELBOW].kp)


def wrenches(bench: Bench, count: int = 50) -> np.ndarray:
    """Measurements of the force-torque sensor, less what is true."""
    sensor, found = bench.force_torques["left_arm"], []
    for _ in range(count):
        bench.run(0.001)
        found.append(sensor.read().values - sensor.sensor.read(bench.simulation.data.sensordata))
    return np.array(found)


def force_is_biased(bench: Bench) -> None:
    """Each force is 10 N off, each torque right."""
    assert wrenches(bench).mean(axis=0) == pytest.approx([10.0] * 3 + [0.0] * 3, abs=0.1)


def force_freezes(bench: Bench) -> None:
    """The same numbers for ever, while the arm moves."""
    sensor = bench.force_torques["left_arm"]
    before = sensor.read().values
    bench.move(80.0)
    assert np.array_equal(sensor.read().values, before)


def force_is_noisy(bench: Bench) -> None:
    """Forces deviate by 2 N, torques as ever."""
    deviations = wrenches(bench, 300).std(axis=0)
    assert deviations[:3] == pytest.approx([2.0] * 3, rel=0.2)
    assert max(deviations[3:]) < 0.01


def read_as(bench: Bench, values: list[float], category: SensorCategory = SensorCategory.FORCE_TORQUE) -> list[float]:
    """Return what a sensor shows of these values: the force-torque sensor, or the inertial unit."""
    of_forces = category is SensorCategory.FORCE_TORQUE
    sensor = bench.force_torques["left_arm"] if of_forces else bench.imus["inertial"]
    shown = np.array(values)
    for fault in sensor.faults:
        fault(sensor.name, category, shown, bench.simulation.now)
    return shown.tolist()


def force_is_scaled(bench: Bench) -> None:
    """All six are seven tenths."""
    assert read_as(bench, [10.0, -20.0, 30.0, 1.0, 2.0, -3.0]) == pytest.approx([7.0, -14.0, 21.0, 0.7, 1.4, -2.1])


def force_axes_are_exchanged(bench: Bench) -> None:
    """X and y, of forces and of torques."""
    assert read_as(bench, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) == [2.0, 1.0, 3.0, 5.0, 4.0, 6.0]


def force_shows_along_another_axis(bench: Bench) -> None:
    """Three tenths of z are added to x."""
    assert read_as(bench, [1.0, 2.0, 30.0, 4.0, 5.0, 6.0]) == pytest.approx([10.0, 2.0, 30.0, 4.0, 5.0, 6.0])


def scatter(bench: Bench, category: SensorCategory) -> float:
    """The standard deviation of what the unit shows at rest."""
    return float(np.std([read_as(bench, [0.0, 0.0, 0.0], category) for _ in range(300)]))


def turns_noisily(bench: Bench) -> None:
    """By 5 deg/s; the acceleration is as before."""
    assert scatter(bench, SensorCategory.GYROSCOPE) == pytest.approx(5.0, rel=0.1)
    assert scatter(bench, SensorCategory.ACCELEROMETER) == 0.0


def falls_noisily(bench: Bench) -> None:
    """By 1 m/s2; the angular velocity is as before."""
    assert scatter(bench, SensorCategory.ACCELEROMETER) == pytest.approx(1.0, rel=0.1)
    assert scatter(bench, SensorCategory.GYROSCOPE) == 0.0


def turns_half(bench: Bench) -> None:
    """Half of the angular velocity, and all of the acceleration."""
    assert read_as(bench, [2.0, 4.0, 6.0], SensorCategory.GYROSCOPE) == [1.0, 2.0, 3.0]
    assert read_as(bench, [2.0, 4.0, 6.0], SensorCategory.ACCELEROMETER) == [2.0, 4.0, 6.0]


def falls_half(bench: Bench) -> None:
    """Half of the acceleration, and all of the angular velocity."""
    assert read_as(bench, [2.0, 4.0, 6.0], SensorCategory.ACCELEROMETER) == [1.0, 2.0, 3.0]
    assert read_as(bench, [2.0, 4.0, 6.0], SensorCategory.GYROSCOPE) == [2.0, 4.0, 6.0]


def turns_about_another_axis(bench: Bench) -> None:
    """X and y of the angular velocity, nothing else."""
    assert read_as(bench, [2.0, 4.0, 6.0], SensorCategory.GYROSCOPE) == [4.0, 2.0, 6.0]
    assert read_as(bench, [2.0, 4.0, 6.0], SensorCategory.ACCELEROMETER) == [2.0, 4.0, 6.0]


def inertial(bench: Bench, category: SensorCategory) -> np.ndarray:
    """What the inertial unit measures, mean of many."""
    found = []
    for _ in range(50):
        bench.run(0.001)
        found.append(bench.imus["inertial"].read_sensor(category, 0).values)
    return np.mean(found, axis=0)


def imu_is_turned(bench: Bench) -> None:
    """Gravity comes from another side, and the yaw is a quarter of a turn off."""
    healthy = Bench()
    right = inertial(healthy, SensorCategory.ACCELEROMETER)
    wrong = inertial(bench, SensorCategory.ACCELEROMETER)
    assert wrong == pytest.approx([right[1], -right[0], right[2]], abs=0.05)
    reported = healthy.imus["inertial"].read_sensor(SensorCategory.ORIENTATION, 0).values
    turned = bench.imus["inertial"].read_sensor(SensorCategory.ORIENTATION, 0).values
    assert np.abs(turned - reported).max() > 45.0


def imu_freezes(bench: Bench) -> None:
    """The same numbers for ever."""
    before = [
        bench.imus["inertial"].read_sensor(kind, 0).values
        for kind in (SensorCategory.GYROSCOPE, SensorCategory.ORIENTATION)
    ]
    bench.run(0.1)
    after = [
        bench.imus["inertial"].read_sensor(kind, 0).values
        for kind in (SensorCategory.GYROSCOPE, SensorCategory.ORIENTATION)
    ]
    assert all(map(np.array_equal, before, after))


def camera_freezes(bench: Bench) -> None:
    """All pictures are the first one."""
    first, second = bench.pictures()
    assert np.array_equal(first, second)
    assert first.max() == 10


def camera_is_black(bench: Bench) -> None:
    """All pixels are zero, in a picture of the right size."""
    for picture in bench.pictures():
        assert picture.shape == (24, 32, 3)
        assert not picture.any()


def camera_is_small(bench: Bench) -> None:
    """Half as wide and half as high."""
    assert [picture.shape for picture in bench.pictures()] == [(12, 16, 3)] * 2


def camera_shows_another(bench: Bench) -> None:
    """The left one shows what the right one sees, and the right one what the left one does."""
    assert bench.pictures()[0].max() == 200
    show = bench.cameras["right"].faults[0]
    assert show(np.zeros((24, 32, 3), np.uint8), 0.0).max() == 100


def shown_by_the_left_camera(bench: Bench) -> Callable[[np.ndarray, float], np.ndarray]:
    """What its fault makes of a picture."""
    assert bench.cameras["left"].faults
    return bench.cameras["left"].faults[0]


def camera_is_noisy(bench: Bench) -> None:
    """By 15 per cent of white, from pixel to pixel and from picture to picture."""
    show, pixels = shown_by_the_left_camera(bench), np.full((60, 100, 3), 128, np.uint8)
    first, second = show(pixels, 0.0), show(pixels, 0.0)
    assert first.std() == pytest.approx(0.15 * 255, rel=0.05)
    assert not np.array_equal(first, second)


def camera_is_dark(bench: Bench) -> None:
    """Three tenths as bright."""
    show = shown_by_the_left_camera(bench)
    assert show(np.full((2, 2, 3), 200, np.uint8), 0.0).tolist() == np.full((2, 2, 3), 60).tolist()


def camera_has_exchanged_colours(bench: Bench) -> None:
    """Red is blue."""
    show = shown_by_the_left_camera(bench)
    assert show(np.array([[[1, 2, 3]]], np.uint8), 0.0).tolist() == [[[3, 2, 1]]]


def camera_is_blurred(bench: Bench) -> None:
    """A white line is as wide as the blur, and as bright in all; a picture of one colour stays as it is."""
    show = shown_by_the_left_camera(bench)
    pixels = np.zeros((40, 60, 3), np.uint8)
    pixels[:, 30] = 255
    row = show(pixels, 0.0)[20, :, 0].astype(float)
    assert row.sum() == pytest.approx(255, abs=5)
    assert np.sqrt(row @ (np.arange(60) - 30.0) ** 2 / row.sum()) == pytest.approx(3.0, abs=0.2)
    assert (show(np.full((40, 60, 3), 77, np.uint8), 0.0) == 77).all()


def camera_is_grey(bench: Bench) -> None:
    """Each pixel has the mean of its colours."""
    show = shown_by_the_left_camera(bench)
    assert (show(np.tile(np.array([10, 20, 60], np.uint8), (4, 6, 1)), 0.0) == 30).all()


def camera_has_a_dead_column(bench: Bench) -> None:
    """One is black, at four tenths of the width, and the picture that was given stays."""
    show = shown_by_the_left_camera(bench)
    pixels = np.full((4, 11, 3), 99, np.uint8)
    assert np.flatnonzero((show(pixels, 0.0) == 0).all(axis=(0, 2))).tolist() == [4]
    assert (pixels == 99).all()


def camera_has_displaced_lines(bench: Bench) -> None:
    """A column that was straight is in two places, five pixels apart."""
    show = shown_by_the_left_camera(bench)
    pixels = np.zeros((6, 20, 3), np.uint8)
    pixels[:, 3] = 255
    assert show(pixels, 0.0)[:, :, 0].argmax(axis=1).tolist() == [3, 8, 3, 8, 3, 8]


def camera_is_zoomed(bench: Bench) -> None:
    """A picture as large as before, in which things are 1.3 times as far from the middle."""
    show = shown_by_the_left_camera(bench)
    pixels = np.zeros((60, 100, 3), np.uint8)
    pixels[30, 60] = 255
    rows, columns, _ = np.nonzero(show(pixels, 0.0))
    assert show(pixels, 0.0).shape == pixels.shape
    assert columns.mean() - 49.5 == pytest.approx(1.3 * 10.5, abs=0.7)
    assert rows.mean() - 29.5 == pytest.approx(1.3 * 0.5, abs=0.7)


def battery_is_weak(bench: Bench) -> None:
    """Its charge falls twice as fast as its current explains."""
    left, current = bench.battery.left, bench.battery.reading.current
    bench.run(1.0)
    expected = current / bench.battery.capacity
    assert left - bench.battery.left == pytest.approx(2.0 * expected, rel=0.1)


def battery_freezes(bench: Bench) -> None:
    """The same reading for ever, while it is discharged."""
    bench.run(0.05)
    reading, left = bench.battery.reading, bench.battery.left
    bench.run(0.1)
    assert bench.battery.reading is reading
    assert bench.battery.left < left


def taxel_dies(bench: Bench) -> None:
    """It repeats its reading; its neighbours do not."""
    readings = []
    for _ in range(50):
        bench.run(0.02)
        readings.append(bench.skin["left_hand"].read().values)
    changes = np.ptp(readings, axis=0)
    assert changes[96] == 0.0
    assert np.delete(changes, 96).min() > 0.0


def skin_readings(bench: Bench) -> np.ndarray:
    """The readings of the skin of the left hand for a second."""
    readings = []
    for _ in range(50):
        bench.run(0.02)
        readings.append(bench.skin["left_hand"].read().values.copy())
    return np.array(readings)


def skin_is_noisy(bench: Bench) -> None:
    """Whole numbers that deviate by ten counts."""
    readings = skin_readings(bench)
    assert (readings == np.rint(readings)).all()
    assert readings.std(axis=0).mean() == pytest.approx(10.0, abs=3.0)


def skin_repeats_a_triangle(bench: Bench) -> None:
    """One in the middle of the patch shows what the one before it does; the others do not."""
    triangles = np.moveaxis(skin_readings(bench).reshape(50, -1, 12), 1, 0)
    alike = [number for number in range(1, 16) if (triangles[number] == triangles[number - 1]).all()]
    assert alike == [8]


def depths(bench: Bench, depth: np.ndarray) -> np.ndarray:
    """What a depth camera publishes instead of these depths."""
    for fault in bench.depth_cameras["depth"].faults:
        depth = fault(depth, bench.simulation.now)
    return depth


def depth_freezes(bench: Bench) -> None:
    """The first depths stay."""
    first = depths(bench, np.full((2, 3), 1.0, np.float32))
    assert depths(bench, np.full((2, 3), 2.0, np.float32)).tolist() == first.tolist() == [[1.0] * 3] * 2


def depth_is_scaled(bench: Bench) -> None:
    """All depths are a tenth too short, and still numbers of 32 bits; what is not measured stays so."""
    shown = depths(bench, np.array([[2.0, 0.0]], np.float32))
    assert shown.dtype == np.float32
    assert shown[0].tolist() == pytest.approx([1.8, 0.0])


def is_late(bench: Bench) -> None:
    """Each comes 0.05 s after it was written, in order."""
    came = bench.publish(20)
    assert [value for _, value in came] == [*range(20)]
    assert [now for now, _ in came] == pytest.approx([0.2 + 0.01 * number + 0.05 for number in range(20)])


def comes_irregularly(bench: Bench) -> None:
    """Each comes, between 0 and 0.02 s late."""
    came = {value: now - 0.2 - 0.01 * value for now, value in bench.publish()}
    assert len(came) == 200
    assert -1e-9 < min(came.values()) < 0.003
    assert 0.017 < max(came.values()) < 0.0205


def gets_lost(bench: Bench) -> None:
    """A fifth is missing."""
    came = bench.publish(400, 0.001)
    assert 280 < len(came) < 360
    assert len({value for _, value in came}) == len(came)


def comes_twice(bench: Bench) -> None:
    """A fifth comes twice, one after the other."""
    values = [value for _, value in bench.publish(400, 0.001)]
    assert sorted(set(values)) == [*range(400)]
    assert values == sorted(values)
    assert 440 < len(values) < 520


def is_slow(bench: Bench) -> None:
    """Every other one is sent."""
    assert [value for _, value in bench.publish(10)] == [1, 3, 5, 7, 9]


def has_old_stamps(bench: Bench) -> None:
    """A tenth has the time of the message before; with ``behind`` a tenth is too early by that."""
    bench.publish(400, 0.001)
    stamps = [Stamp.parse(envelope) for envelope in bench.port.envelopes]
    assert [stamp.count for stamp in stamps] == [*range(400)]
    steps = np.diff([stamp.time for stamp in stamps])
    assert 20 < (steps == 0.0).sum() < 60
    assert (steps >= 0.0).all()


SHOWS: dict[str, Callable[[Bench], None]] = {
    "jam": held_jam,
    "friction": rubs,
    "viscous_friction": rubs_with_its_speed,
    "push": is_pushed,
    "sticky_place": sticks_in_a_place,
    "jam_at_times": jams_at_times,
    "motor_dead": falls,
    "motor_weak": is_weak,
    "motor_sign": runs_away,
    "motor_overcurrent": burns,
    "current_sensor_dead": shows_no_current,
    "current_sensor_gain": shows_half_the_current,
    "current_sensor_sign": shows_the_opposite_current,
    "current_sensor_offset": shows_more_current,
    "current_sensor_noise": shows_a_noisy_current,
    "motor_resistance": resists,
    "motor_interrupted": is_interrupted,
    "amplifier_weak": drives_weakly,
    "encoder_drift": drifts,
    "encoder_bias": is_biased,
    "encoder_scale": is_scaled,
    "encoder_sign": counts_down,
    "encoder_frozen": shows_the_same,
    "encoder_noise": jitters,
    "encoders_swapped": exchanges_its_encoder,
    "motor_encoders_swapped": exchanges_its_motor_encoder,
    "motors_swapped": exchanges_its_motor,
    "motor_encoder_drift": motor_drifts,
    "motor_encoder_jump": motor_jumps,
    "motor_encoder_scale": motor_is_scaled,
    "motor_encoder_sign": motor_counts_down,
    "motor_encoder_frozen": motor_shows_the_same,
    "encoder_lost_counts": loses_counts,
    "encoder_spikes": has_spikes,
    "encoder_late": is_old,
    "encoder_eccentric": is_off_centre,
    "motor_encoder_lost_counts": motor_loses_counts,
    "motor_encoder_spikes": motor_has_spikes,
    "motor_encoder_late": motor_is_old,
    "backlash": has_play,
    "elastic_gear": gear_bends,
    "torque_bias": torque_is_biased,
    "torque_scale": torque_is_scaled,
    "missed_command": misses,
    "stop_ignored": goes_on,
    "command_of_any_mode": obeys_in_any_mode,
    "fault_left": leaves_its_fault,
    "mode_ignored": ignores_modes,
    "wrong_mode": takes_another_mode,
    "mode_stale": shows_old_modes,
    "mode_flickers": shows_idle_for_moments,
    "limits_ignored": goes_beyond,
    "wrong_speed": is_twice_as_fast,
    "wrong_gear_ratio": reports_another_gearbox,
    "wrong_upper_limit": upper_limit_is_wrong,
    "wrong_lower_limit": lower_limit_is_wrong,
    "wrong_coupling": reports_another_coupling,
    "wrong_gains": is_slack,
    "ft_bias": force_is_biased,
    "ft_frozen": force_freezes,
    "ft_noise": force_is_noisy,
    "imu_rotated": imu_is_turned,
    "imu_frozen": imu_freezes,
    "ft_gain": force_is_scaled,
    "ft_axes": force_axes_are_exchanged,
    "ft_cross_talk": force_shows_along_another_axis,
    "gyroscope_noise": turns_noisily,
    "accelerometer_noise": falls_noisily,
    "gyroscope_gain": turns_half,
    "accelerometer_gain": falls_half,
    "gyroscope_axes": turns_about_another_axis,
    "camera_frozen": camera_freezes,
    "camera_black": camera_is_black,
    "camera_size": camera_is_small,
    "cameras_swapped": camera_shows_another,
    "camera_zoom": camera_is_zoomed,
    "camera_noise": camera_is_noisy,
    "camera_exposure": camera_is_dark,
    "camera_colours": camera_has_exchanged_colours,
    "camera_grey": camera_is_grey,
    "camera_blur": camera_is_blurred,
    "camera_dead_columns": camera_has_a_dead_column,
    "camera_lines": camera_has_displaced_lines,
    "battery_weak": battery_is_weak,
    "battery_frozen": battery_freezes,
    "taxel_dead": taxel_dies,
    "skin_noise": skin_is_noisy,
    "skin_repeated": skin_repeats_a_triangle,
    "depth_frozen": depth_freezes,
    "depth_scale": depth_is_scaled,
    "latency": is_late,
    "jitter": comes_irregularly,
    "loss": gets_lost,
    "duplicate": comes_twice,
    "wrong_rate": is_slow,
    "old_stamps": has_old_stamps,
}
#: Those of buses are in firmware/test_can_faults.py, those of controllers in ../icub_tests/test_cartesian_control.py.
ELSEWHERE = (Layer.PROCESS, Layer.BUS, Layer.CONTROLLER)
IN_PROCESS = [kind for kind in KINDS.values() if kind.layer not in ELSEWHERE]


def test_every_kind_has_its_proof():
    """No kind is there whose claim nobody looks at."""
    assert set(SHOWS) == {kind.kind for kind in IN_PROCESS}


@pytest.mark.parametrize("kind", SHOWS)
def test_a_fault_shows_what_it_claims(bench: Bench, kind: str):
    """It can be seen, and is not there in a healthy robot; taken out, the robot is as healthy as before."""
    with pytest.raises(AssertionError):
        SHOWS[kind](Bench())
    before = health(bench)
    number = bench.inject(kind)
    assert health(bench) != before
    SHOWS[kind](bench)
    assert bench.faults.clear(number) == 1
    bench.arm.set_interaction_modes(InteractionMode.STIFF, [3])
    bench.arm.set_control_modes([ControlMode.FORCE_IDLE], [3])
    bench.arm.set_control_modes([ControlMode.POSITION], [3])
    bench.run(0.01)
    assert health(bench) == before


LAYERS = [layer for layer in Layer if layer not in ELSEWHERE]


def kinds_of(layer: Layer) -> list[str]:
    """The kinds of a layer."""
    return [kind.kind for kind in IN_PROCESS if kind.layer is layer]


@pytest.mark.parametrize("layer", LAYERS)
def test_a_reset_leaves_nothing_of_faults(layer: Layer):
    """A robot that was broken and reset is, to the last bit, the one that was only reset, then and later."""
    robots = [Bench(), Bench()]
    for kind in kinds_of(layer):
        robots[1].inject(kind)
    for robot in robots:
        robot.run(0.1)
    assert state(robots[0]) != state(robots[1])
    for robot in robots:
        robot.simulation.reset()
    assert state(robots[0]) == state(robots[1])
    assert robots[1].faults.active == ()
    for robot in robots:
        robot.move(60.0, 0.1)
    assert state(robots[0]) == state(robots[1])


@pytest.mark.parametrize("layer", LAYERS)
def test_broken_robots_are_the_same_with_the_same_seed(layer: Layer):
    """A fault is no excuse: given the same at the same moments, two robots end in the same state, to the last bit."""
    robots = [Bench(seed=7), Bench(seed=7)]
    for robot in robots:
        for kind in kinds_of(layer):
            robot.inject(kind, delay=0.02, duration=0.05)
        robot.publish(10)
        robot.force_torques["left_arm"].read()
        robot.imus["inertial"].read_sensor(SensorCategory.GYROSCOPE, 0)
    assert state(robots[0]) == state(robots[1])
    assert robots[0].port.written == robots[1].port.written


def test_chance_is_another_one_with_another_seed():
    """What is random is not the same for ever."""
    robots = [Bench(seed=7), Bench(seed=8)]
    for robot in robots:
        robot.inject("encoder_noise")
        robot.run(0.05)
    assert robots[0].shown != robots[1].shown


@pytest.mark.parametrize("kind", IN_PROCESS, ids=lambda kind: kind.kind)
def test_no_value_that_is_allowed_ends_the_time(bench: Bench, kind: type[Fault]):
    """However bad a fault is, the simulation goes on, with numbers."""
    for end in ("minimum", "maximum") if kind.parameters else ("",):
        number = bench.inject(kind.kind, values={one.name: getattr(one, end) for one in kind.parameters})
        bench.move(60.0, 0.05)
        bench.publish(2)
        bench.pictures()
        data = bench.simulation.data
        assert np.isfinite(data.qpos).all()
        assert np.isfinite(bench.boards.position).all()
        assert not any(warning.number for warning in data.warning)
        bench.faults.clear(number)


# Time -------------------------------------------------------------------------------------------------------------


def test_a_fault_comes_and_goes_at_its_time(bench: Bench):
    """It begins after the delay and ends after the duration, to the millisecond."""
    number = bench.faults.inject("encoder_bias", JOINT, delay=0.05, duration=0.02)
    (active,) = bench.faults.active
    assert (active.number, active.running) == (number, False)
    assert (active.begins, active.ends) == pytest.approx((0.25, 0.27))
    wrong = []
    for step in range(100):
        bench.run(0.001)
        if abs(bench.shown - bench.true) > 4.0:
            wrong.append(step)
    # An encoder is read before what happens at a moment: the fault is seen from the next step on.
    assert wrong == [*range(50, 70)]
    assert bench.faults.active == ()


def test_a_fault_that_is_cleared_before_its_time_never_begins(bench: Bench):
    """Neither then nor later."""
    before = health(bench)
    number = bench.faults.inject("jam", JOINT, delay=0.05)
    bench.faults.clear(number)
    bench.run(0.1)
    assert health(bench) == before


def test_a_fault_that_is_cleared_before_its_end_does_not_end_twice(bench: Bench):
    """Nor does its end take out the next one of the same kind."""
    number = bench.faults.inject("jam", JOINT, duration=0.05)
    bench.faults.clear(number)
    again = bench.faults.inject("jam", JOINT)
    bench.run(0.1)
    assert [one.number for one in bench.faults.active] == [again]


# Several ----------------------------------------------------------------------------------------------------------

KEEPERS = [kind.kind for kind in IN_PROCESS if kind.restores]


@pytest.mark.parametrize("kind", KEEPERS)
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0)])
def test_faults_on_the_same_joint_end_in_any_order(kind: str, order: tuple[int, ...]):
    """What is left is what the others make of a healthy robot; in the end it is healthy."""
    bench = Bench(age=0.0)
    (parameter,) = find_kind(kind).parameters
    values = [{parameter.name: value} for value in (0.1, 0.7, 0.3)]
    numbers = [bench.inject(kind, values=one) for one in values]
    left = [0, 1, 2]
    for place in order:
        bench.faults.clear(numbers[place])
        left.remove(place)
        other = Bench(age=0.0)
        for one in left:
            other.inject(kind, values=values[one])
        assert health(bench) == health(other)


def test_the_order_in_which_they_begin_counts_and_not_their_numbers(bench: Bench):
    """A fault that was put in first and begins last ends as well as any other."""
    before = health(bench)
    late = bench.inject("wrong_gear_ratio", delay=0.01)
    early = bench.inject("wrong_gear_ratio", values={"factor": 3.0})
    bench.run(0.05)
    bench.faults.clear(early)
    assert bench.arm.gearbox_ratio(3) == 1.5 * bench.boards.gearbox[ELBOW]
    bench.faults.clear(late)
    assert health(bench) == before


def test_all_kinds_at_once(bench: Bench):
    """Everything can be broken at the same time, and fixed with one word."""
    before = health(bench)
    for kind in SHOWS:
        bench.inject(kind)
    bench.run(0.1)
    assert len(bench.faults.active) == len(SHOWS)
    assert bench.faults.clear() == len(SHOWS)
    bench.arm.set_control_modes([ControlMode.FORCE_IDLE], [3])
    bench.arm.set_control_modes([ControlMode.POSITION], [3])
    assert health(bench) == before


def test_a_fault_strikes_its_joint_and_no_other(bench: Bench):
    """The same fault of the wrist leaves the elbow alone."""
    bench.faults.inject("encoder_bias", "l_wrist_prosup")
    bench.run(0.01)
    assert bench.shown == pytest.approx(bench.true, abs=0.02)
    assert bench.arm.encoders(4).item() == pytest.approx(5.0, abs=1.0)


# What is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "target", "values", "hint"),
    [
        ("earthquake", "", {}, "there are jam, friction"),
        ("jam", "", {}, "its joints are neck_pitch"),
        ("jam", "elbow", {}, "its joints are neck_pitch"),
        ("ft_bias", "left_hand", {}, "there are left_arm"),
        ("imu_frozen", "imu2", {}, "no inertial unit 'imu2'; there are head_imu_0"),
        ("camera_black", "middle", {}, "there are left"),
        ("loss", "/icubSim/nothing:o", {}, f"there are {PORT}"),
        ("crash", "head", {}, "takes no target"),
        ("jam", JOINT, {"force": 1.0}, "its parameters: torque"),
        ("motor_dead", JOINT, {"share": 1.0}, "its parameters: none"),
        ("jam", JOINT, {"torque": -1.0}, "from 0 to 100000 Nm"),
        ("jam", JOINT, {"torque": float("nan")}, "from 0 to 100000 Nm"),
        ("loss", PORT, {"share": 1.5}, "from 0 to 1"),
    ],
)
def test_what_cannot_be_is_refused_with_the_hint(
    bench: Bench, kind: str, target: str, values: dict[str, float], hint: str
):
    """The message on a wrong name or value has the right ones, and the robot stays healthy."""
    before = health(bench)
    with pytest.raises(RefusedError) as refused:
        bench.faults.inject(kind, target, values)
    assert hint in str(refused.value)
    assert health(bench) == before
    assert bench.faults.active == ()


@pytest.mark.parametrize(
    "times", [{"delay": -1.0}, {"duration": 0.0}, {"delay": float("nan")}, {"delay": float("inf")}, {"duration": -1.0}]
)
def test_times_that_cannot_be_are_refused(bench: Bench, times: dict[str, float]):
    """A fault begins now or later, and lasts."""
    with pytest.raises(RefusedError, match="the delay must be 0 s or more"):
        bench.inject("jam", **times)


def test_a_number_that_is_not_there_is_refused(bench: Bench):
    """With those that are."""
    number = bench.inject("jam")
    with pytest.raises(RefusedError, match=rf"no fault number 99; there are \[{number}\]"):
        bench.faults.clear(99)


def test_there_is_a_bound(bench: Bench):
    """Nobody fills the memory with faults."""
    for _ in range(MOST_FAULTS):
        bench.inject("motor_dead", delay=1000.0)
    with pytest.raises(RefusedError, match="clear one first"):
        bench.inject("motor_dead")


# The process ------------------------------------------------------------------------------------------------------

PROGRAM = """
import sys
from types import SimpleNamespace
from rtf.simulator.faults.network import Crash, Hang
robot = SimpleNamespace(simulation=SimpleNamespace(boards=None, now=0.0))
print("begins", flush=True)
{"crash": Crash, "hang": Hang}[sys.argv[1]](robot).start()
print("goes on", flush=True)
"""


def start_program(kind: str) -> subprocess.Popen[bytes]:
    """A process in which a fault begins at once."""
    return subprocess.Popen([sys.executable, "-c", PROGRAM, kind], stdout=subprocess.PIPE)


def test_a_crash():
    """The process is killed at once, without a last word."""
    process = start_program("crash")
    assert process.communicate(timeout=20)[0] == b"begins\n"
    assert process.returncode == -signal.SIGKILL


def test_a_hang():
    """The process is there and does nothing; told to go on, it does."""
    process = start_program("hang")
    assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
    process.send_signal(signal.SIGCONT)
    assert process.communicate(timeout=20)[0] == b"begins\ngoes on\n"


# The catalogue ----------------------------------------------------------------------------------------------------


def test_the_catalogue_leaves_nothing_out():
    """All kinds and parameters are in all its forms."""
    text, table = catalogue.as_text(KINDS.values()), catalogue.as_markdown(KINDS.values())
    for kind in KINDS.values():
        assert f"  {kind.kind}  (" in text
        assert f"| `{kind.kind}` |" in table
        described = catalogue.facts(kind)
        assert described["layer"] == kind.layer.value
        for parameter, facts in zip(kind.parameters, described["parameters"], strict=True):
            assert f"{parameter.name}={parameter.default:g}" in text
            assert (facts["name"], facts["default"]) == (parameter.name, parameter.default)
            assert parameter.minimum <= parameter.default <= parameter.maximum


def test_the_page_has_the_catalogue():
    """The tables of the page on faults are those of the kinds, to the letter."""
    page = (Path(__file__).parents[2] / "docs" / "faults.md").read_text(encoding="utf-8")
    found = re.search(r"<!-- the kinds: [^\n]* -->\n(.*)<!-- the kinds end -->", page, re.DOTALL)
    assert found is not None
    assert found[1].strip() == catalogue.as_markdown(KINDS.values()).strip()


# Wiring -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by", [-3.0, 0.0, 3.0])
def test_only_two_joints_of_a_part_are_exchanged(bench: Bench, by: float):
    """There is none before the first of the arm, and none is exchanged with itself."""
    target = "l_shoulder_pitch" if by < 0 else "l_pinky" if by > 0 else JOINT
    with pytest.raises(RefusedError, match=f"encoders_swapped: {by:g} joints farther than {target} is no other one"):
        bench.faults.inject("encoders_swapped", target, {"by": by})


def test_a_dead_motor_of_two_that_share_joints_changes_the_torques_of_both(bench: Bench):
    """Faults of motors are of motors: what the board commands to roll and pitch of the torso is what both give."""
    torso = np.array([INDEX["torso_roll"], INDEX["torso_pitch"]])
    bench.boards.speeds[torso] = 20.0
    bench.boards.move(torso, np.array([20.0, 0.0]))
    bench.run(0.5)
    held = bench.simulation.data.actuator_force[torso]
    bench.faults.inject("motor_dead", "torso_roll")
    bench.run(0.002)
    assert (np.abs(bench.simulation.data.actuator_force[torso] - held) > 0.3).all()
