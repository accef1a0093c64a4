"""The battery of a simulated robot: its electricity, its charge, and what its ports show."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.util import find_spec

import msgspec
import pytest

from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.interfaces import BatteryStatus, IBattery
from rtf.robot.model import load_robot
from rtf.robot.model.file import Battery

pytestmark = pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")

#: One without noise, whose charge is shown as it is.
EXACT = Battery(
    capacity=36.0, full=40.0, empty=32.0, max_current=20.0, resistance=0.5, idle_power=72.0,
    charge_step=1e-9, voltage_noise=0.0, current_noise=0.0,
)  # fmt: skip


def discharged(settings: Battery, *, seed: int = 0, limp: bool = False):
    """A bench with a battery, as it starts."""
    from rtf.simulator.battery import SimulatedBattery
    from rtf.simulator.plant import build
    from rtf.simulator.simulation import Simulation

    simulation = Simulation(build(load_robot("bench")), seed=seed)
    battery = SimulatedBattery(settings, simulation)
    simulation.publish_regularly(battery)
    if limp:
        for axis in range(2):
            simulation.boards.request_mode(axis, ControlMode.IDLE)
    return battery


def test_the_electronics_discharge_it():
    """Their power is constant: 72 W of 36 Wh is a share of 1/1800 a second, less the loss in the resistance."""
    battery = discharged(EXACT, limp=True)
    battery.simulation.advance(0.1)
    first = battery.reading
    assert first.voltage * first.current == pytest.approx(72.0)
    assert first.voltage == pytest.approx(40.0 - 0.5 * first.current, abs=1e-3)
    assert battery.capacity == pytest.approx(3600.0)  # 36 Wh at 36 V are 1 Ah
    battery.simulation.advance(10.1)
    assert first.charge - battery.reading.charge == pytest.approx(100.0 * first.current * 10.0 / 3600.0, rel=1e-3)
    assert battery.reading.status is BatteryStatus.IN_USE


def test_motors_draw_more_while_they_work():
    """A joint that is held against gravity takes less than one that is accelerated, and one without power nothing."""
    from rtf.simulator.part import SimulatedPart

    held, limp = discharged(EXACT), discharged(EXACT, limp=True)
    for battery in (held, limp):
        battery.simulation.advance(0.5)
    assert held.reading.current > limp.reading.current
    before = held.reading.current
    arm = SimulatedPart("arm", held.simulation.boards)
    arm.set_reference_speeds([100.0, 100.0])
    arm.position_move([60.0, 90.0])
    held.simulation.advance(0.7)
    assert held.reading.current > 1.05 * before


def test_an_empty_battery_stays_empty():
    """Its charge is not negative, and its status says so."""
    battery = discharged(msgspec.structs.replace(EXACT, capacity=0.01))
    battery.simulation.advance(2.0)
    assert battery.left == 0.0
    assert battery.reading.charge == 0.0
    assert battery.reading.status is BatteryStatus.CRITICAL
    assert battery.reading.voltage < 32.0


def test_too_great_a_load_is_no_error():
    """The voltage breaks down, and all numbers stay finite."""
    battery = discharged(
        Battery(capacity=1.0, full=40.0, empty=32.0, max_current=20.0, resistance=50.0, idle_power=72.0)
    )
    battery.simulation.advance(0.1)
    assert battery.reading.voltage == pytest.approx(40.0 / 2, abs=1.0)
    assert battery.reading.current > 0.0


def test_the_charge_is_shown_in_steps():
    """The shown charge is a multiple of the gauge's step."""
    coarse = discharged(
        Battery(capacity=36.0, full=40.0, empty=32.0, max_current=20.0, idle_power=72.0, charge_step=0.5)
    )
    shown = set()
    for _ in range(200):
        coarse.simulation.advance(coarse.simulation.now + 0.1)
        shown.add(coarse.reading.charge)
    assert shown == {100.0, 99.5, 99.0}


def test_it_is_the_same_with_the_same_seed():
    """To the last bit; with another one only the noise differs. A reset replaces it by a charged one."""
    settings = msgspec.structs.replace(EXACT, voltage_noise=0.01, current_noise=0.01)
    one, same, other = discharged(settings), discharged(settings), discharged(settings, seed=1)
    for battery in (one, same, other):
        battery.simulation.advance(1.0)
    assert one.reading == same.reading != other.reading
    assert one.left == same.left == other.left < 1.0
    one.simulation.reset()
    assert one.left == 1.0


def test_a_robot_serves_its_battery(tmp_path, monkeypatch):
    """The client reads it in lockstep with the simulation; a robot without one has no such ports."""
    from rtf.simulator.robot import SimulatedRobot

    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    network = Network(LocalNames(), patience=30)
    with ExitStack() as opened:
        robot = opened.enter_context(SimulatedRobot(load_robot("bench"), network=network, lockstep=True))
        assert robot.battery is not None
        client = make_device(
            "battery_nwc_yarp", Property({"remote": "/benchSim/battery", "carrier": "tcp"}), network=network
        )
        opened.callback(client.close)
        robot.simulation.advance(0.3)
        robot.outlets.settle()
        battery = client.view(IBattery)  # type: ignore[type-abstract]
        read = battery.charge(), battery.voltage(), battery.current(), battery.battery_status()
        assert read == (*robot.battery.reading[:3], BatteryStatus.IN_USE)
        assert battery.battery_info() == "a simulated battery of 90 Wh, 30 to 42 V"
