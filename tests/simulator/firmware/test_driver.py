"""The driver of motor boards on the emulated boards of the bench: both sides of the bus at once, in real time."""

from __future__ import annotations

import threading
from contextlib import closing
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import make_device
from rtf.robot.devices.can.axis_scale import AxisScale
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.control_board import ControlBoard
from rtf.robot.errors import StaleStateError
from rtf.robot.model import load_robot
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.bridge import Bridge
from rtf.simulator.firmware.parameters import FULL_OUTPUT
from rtf.simulator.plant import Options, build
from rtf.simulator.simulation import Simulation
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

CHANNEL = "driver-and-boards"
SHIFT, TICKS = 4, 65536 / 360


class Arm(NamedTuple):
    """The bench behind its board, as the driver has it, and the simulation."""

    device: ControlBoard
    simulation: Simulation


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    """The bench in real time, with its bus on a virtual one of python-can."""
    made = Simulation(build(load_robot("bench"), Options()), factor=1.0)
    firmware = Firmware(made)
    (wire,) = firmware.wires.values()
    ended = threading.Event()

    def run() -> None:
        while not ended.is_set():
            made.advance(made.now + 0.02)

    thread = threading.Thread(target=run, daemon=True)
    with closing(Bridge(wire, BusSettings("virtual", CHANNEL), made, print)):
        thread.start()
        yield made
        ended.set()
        thread.join()


@pytest.fixture
def arm(simulation: Simulation) -> Iterator[Arm]:
    """The driver, with the gains and limits of the simulated robot."""
    boards = simulation.boards
    pids = []
    for axis in (0, 1):
        raw = AxisScale(ticks=TICKS, full_duty=FULL_OUTPUT).raw_pid(boards.pids[axis]._replace(scale=SHIFT))
        pids.append(f"(Pid{axis} {raw.kp} {raw.kd} {raw.ki} {FULL_OUTPUT} {FULL_OUTPUT} {SHIFT} 0)")
    text = f"""(GENERAL (Joints 2) (Encoder {TICKS} {TICKS}) (fullscalePWM {FULL_OUTPUT}))
        (CAN (interface virtual) (channel {CHANNEL}) (CanAddresses 1) (CanTimeout 200))
        (LIMITS (jntPosMin {boards.minimum[0]} {boards.minimum[1]}) (jntPosMax {boards.maximum[0]} {boards.maximum[1]}))
        (PIDS {" ".join(pids)})"""
    device = make_device("canMotionControl", Property.parse(text))
    assert isinstance(device, ControlBoard)
    with closing(device):
        yield Arm(device, simulation)


def soon(condition: Callable[[], object]) -> None:
    """Wait until a condition holds; on a busy machine the state may be stale meanwhile."""

    def holds() -> bool:
        try:
            return bool(condition())
        except StaleStateError:
            return False

    eventually(holds, "it has not come about", 20.0)


def test_a_joint_goes_to_its_target(arm: Arm):
    """A position move arrives: gains, limits and units of both sides are the same."""
    device, _ = arm
    device.set_reference_speeds([40.0, 40.0])
    device.position_move([8.0, 20.0])
    soon(lambda: device.encoders() == pytest.approx([8.0, 20.0], abs=0.3))
    soon(lambda: device.motion_done() and np.abs(device.encoder_speeds()).max() < 1.0)
    assert not any(code for code, _ in map(device.last_joint_fault, range(2)))


def test_velocities_and_modes(arm: Arm):
    """A velocity moves the joint the right way; an idle joint has no power; the other modes are taken."""
    device, simulation = arm
    device.set_control_modes(ControlMode.VELOCITY, 0)
    device.velocity_move(-20.0, 0)
    soon(lambda: device.encoder_speeds(0)[0] < -10.0)
    for mode in (ControlMode.POSITION_DIRECT, ControlMode.PWM, ControlMode.MIXED, ControlMode.IDLE):
        device.set_control_modes(mode, 0)
        soon(lambda mode=mode: simulation.boards.mode[0] == mode)
    assert device.control_modes()[0] is ControlMode.IDLE
    assert device.last_joint_fault(0) == (0, "")
