"""Sensors of the simulated robot: each measures once a step, and all readers get the same values."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from icub import ICUB
from rtf.robot.errors import DeviceError, RefusedError
from rtf.robot.interfaces import SensorCategory, SensorStatus
from rtf.robot.model.file import Accuracy
from rtf.robot.sensors.measurements import DeviceMeasurements
from rtf.simulator.angle_sensors import SimulatedAngles

if TYPE_CHECKING:
    from rtf.robot.sensors.measurements import Measurements
    from rtf.simulator.simulated_sensors import SimulatedForceTorque

    from .rig import Rig

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

MANY = 600  # measurements; more than the noise that is drawn at once


@pytest.fixture
def rig() -> Rig:
    """A robot at home."""
    from .rig import Rig

    return Rig()


def sensors_of(rig: Rig) -> list[SimulatedForceTorque]:
    """Its force-torque sensors."""
    from rtf.simulator.simulated_sensors import SimulatedForceTorque

    return [SimulatedForceTorque(sensor, rig.simulation) for sensor in rig.simulation.plant.ft_sensors]


def numbers(measured: Measurements) -> list[list[tuple[bytes, float]]]:
    """The values as bytes, to be compared to the last bit."""
    return [[(reading.values.tobytes(), reading.time) for reading in category] for category in measured]


def test_all_at_once_and_one_by_one_are_the_same(rig: Rig):
    """The values of the common port are those of the single ports within a step; in the next step all differ."""
    from rtf.simulator.simulated_sensors import SimulatedForceTorques, SimulatedImu

    devices = (
        SimulatedForceTorques(sensors_of(rig), rig.simulation),
        SimulatedImu(rig.simulation.plant.imus[0], rig.simulation),
    )
    assert [len(devices[0].read_all()[SensorCategory.FORCE_TORQUE]), len(devices[1].read_all()[0])] == [6, 1]
    for device in devices:
        before = numbers(device.read_all())
        rig.run(0.01)
        one_by_one = numbers(DeviceMeasurements(device).read_all())
        assert numbers(device.read_all()) == one_by_one != before


def test_one_that_is_not_well_is_named(rig: Rig):
    """The common port raises the error of the one sensor that fails."""
    from rtf.simulator.simulated_sensors import SimulatedForceTorques, SimulatedImu

    sensors, imu = sensors_of(rig), SimulatedImu(rig.simulation.plant.imus[0], rig.simulation)
    sensors[2].status = imu.status = SensorStatus.ERROR
    for device, name in ((SimulatedForceTorques(sensors, rig.simulation), sensors[2].name), (imu, imu.name)):
        with pytest.raises(DeviceError, match=rf"{name} .* has status ERROR"):
            device.read_all()
        with pytest.raises(RefusedError):
            device.read_sensor(SensorCategory.SKIN_PATCH, 0)


def test_what_was_made_zero_is_taken_off_at_once(rig: Rig):
    """An offset counts within the same step, for one channel and for all; the noise is as before."""
    sensor = sensors_of(rig)[0]
    before = sensor.read().values
    sensor.calibrate(0, 5.0)
    assert sensor.read().values[0] == pytest.approx(5.0, abs=0.5)
    assert sensor.read().values[1:] == pytest.approx(before[1:], abs=0.5)
    sensor.calibrate()
    found = []
    for tick in range(MANY):
        rig.boards.tick = tick  # time does not pass, but measurements are taken
        found.append(sensor.read().values)
    assert np.mean(found, axis=0) == pytest.approx(np.zeros(6), abs=0.02)
    assert np.std(found, axis=0)[:3] == pytest.approx(
        np.full(3, ICUB.sensors.force_torque["l_arm_ft_sensor"].force.noise), rel=0.15
    )
    assert len({one.tobytes() for one in found}) > MANY // 2, "noise comes again"


def test_drift_and_whole_counts(rig: Rig):
    """The bias is a random walk that does not depend on how often it is read; every reading is a whole count."""
    from rtf.simulator.simulated_sensors import SimulatedForceTorque

    (sensor, *_) = rig.simulation.plant.ft_sensors
    settings = msgspec.structs.replace(
        sensor.settings, force=Accuracy(drift=2.0, count=0.5), torque=Accuracy(noise=0.002)
    )
    often, seldom = (SimulatedForceTorque(replace(sensor, settings=settings), rig.simulation) for _ in range(2))
    walk = []
    for second in range(241):
        rig.boards.tick = 1000 * second  # time passes for the sensors only
        walk.append(often.read().values)
    assert seldom.read().values[:3].tolist() == often.read().values[:3].tolist()
    forces, torques = np.array(walk)[:, :3], np.array(walk)[:, 3:]
    assert np.array_equal(forces, np.rint(forces / 0.5) * 0.5)
    assert np.std(np.diff(forces[::30], axis=0)) == pytest.approx(2.0 * np.sqrt(0.5), rel=0.5)
    assert np.ptp(torques, axis=0).max() < 0.02
    assert len(np.unique(torques)) > 600


#: Channels of a hand, and counts of an open joint and of one that is bent by 45 deg.
INDEX_FINGER, LAST_FINGERS, OPEN, HALF = slice(3, 6), slice(9, 15), 240.0, 130.0


def fingers_of(side: str, rig: Rig) -> SimulatedAngles:
    """The sensors of a hand."""
    return SimulatedAngles(f"{side}_hand", ICUB.sensors.angles[f"{side}_hand"], rig.simulation)


def test_the_sensors_of_the_fingers_follow_the_joints_of_the_model(rig: Rig):
    """By fifteen bytes: one axis bends two or six of the joints, each by its share; the other hand stays open."""
    left, right = (fingers_of(side, rig) for side in ("left", "right"))
    assert left.channels() == left.read().values.size == 15
    assert left.read().values == pytest.approx(np.full(15, OPEN), abs=5.0)
    arm = rig.part("left_arm")
    joints = [arm.axis_names().index(f"l_{name}") for name in ("index_proximal", "index_distal", "pinky")]
    arm.set_reference_speeds([100.0] * 3, joints)
    arm.position_move([45.0, 90.0, 135.0], joints)
    rig.run(3.0)
    values = left.read().values
    assert values[INDEX_FINGER] == pytest.approx(np.full(3, HALF), abs=8.0)
    assert values[LAST_FINGERS] == pytest.approx(np.full(6, HALF), abs=8.0)
    assert right.read().values == pytest.approx(np.full(15, OPEN), abs=5.0)
    assert values.tolist() == [round(value) for value in values]
    rig.run(0.001)
    assert left.read().values.tolist() != values.tolist(), "there is noise"


def test_a_finger_that_is_held_shows_where(rig: Rig):
    """The sensor measures the joint, and not its command."""
    fingers, arm = fingers_of("left", rig), rig.part("left_arm")
    joint = arm.axis_names().index("l_index_proximal")
    rig.push("l_index_proximal", -5.0)  # more than its motor has
    arm.position_move(80.0, joint)
    rig.run(2.0)
    assert fingers.read().values[INDEX_FINGER.start] > OPEN - 12.0
