"""Random frames for the decoder and the driver, and many through a bus: ``python tests/torture/run_can_frames.py``.

Whatever is decoded has the same bytes again; the rest is refused with MessageError. The bus is python-can's
``virtual``, which copies each frame; its rate is for a second of processor, both ends together.
"""

from __future__ import annotations

import argparse
import random
import resource
import threading
from contextlib import closing, suppress

import numpy as np

from rtf import clock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.bus import CanBus, share, unshare
from rtf.robot.devices.can.bus_settings import SIMULATED, BusSettings
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.messages import Dialect, Frame
from rtf.robot.errors import MessageError, StaleStateError
from rtf.robot.extended_state import ExtendedState
from rtf.robot.model import load_robot
from rtf.simulator.robot import SimulatedRobot

PATIENCE = 300.0
#: Frames that arrive within a cycle of the driver, and its period (s).
TOGETHER, PERIOD = 100, 0.01
#: The greatest number in a message.
LARGEST = 2.0**31


def fuzz(frames: int, seed: int) -> int:
    """Decode random frames; return how many are messages. Raises AssertionError for one that is another one again."""
    chance, messages = random.Random(seed), 0
    for _ in range(frames):
        data = chance.randbytes(chance.randrange(9))
        identifier, dialect = chance.randrange(0x800), chance.choice((Dialect.JOINT, Dialect.FOC))
        try:
            got = decode(identifier, data, dialect)
        except MessageError:
            continue
        messages += 1
        if all(one.layout not in "xfe" for one in got.message.layout):  # padding is lost, and some NaN become others
            again = got.message.frame(1, *got.values, axis=got.axis).data
            if again != data:
                raise AssertionError(f"{identifier:03X}#{data.hex()} is {got.message.name}, and {again.hex()} again")
    return messages


def fuzz_driver(frames: int, seed: int) -> int:
    """Have the driver of a simulated arm receive random frames besides those of its board; return how many cycles.

    Most of them have identifiers of the board. Raises AssertionError for a state that is not finite, beyond what the
    numbers of messages can say, or has an unknown mode.
    """
    chance, cycles = random.Random(seed), 0
    with SimulatedRobot(load_robot("bench"), network=Network(LocalNames()), lockstep=True, can=True) as robot:
        arm, bus = robot.parts["arm"], share(BusSettings(SIMULATED, "arm0"), print)
        state = ExtendedState(arm.axes())
        most = LARGEST / float(robot.simulation.boards.resolution[:2].min())
        for first in range(0, frames, TOGETHER):
            with robot.simulation.lock:
                for _ in range(min(TOGETHER, frames - first)):
                    known = chance.random() < 0.75
                    identifier = (
                        chance.choice((0x010, 0x110)) | chance.randrange(16) if known else chance.randrange(0x800)
                    )
                    size = 8 if known and chance.random() < 0.75 else chance.randrange(9)
                    bus.take(Frame(identifier, chance.randbytes(size)), robot.simulation.now)
            clock.current().sleep(PERIOD)
            cycles += 1
            with suppress(StaleStateError):
                arm.fill_state(state)
            for field in (
                state.joint_positions,
                state.joint_velocities,
                state.currents,
                state.duty_cycles,
                state.torques,
            ):
                if not (np.isfinite(field).all() and (np.abs(field) <= most).all()):
                    raise AssertionError(f"a state is {field}")
            if not {int(mode) for mode in state.control_modes} <= {int(mode) for mode in ControlMode}:
                raise AssertionError(f"the modes are {state.control_modes}")
        unshare(bus)
    return cycles


def through_a_bus(frames: int) -> float:
    """Send frames from one end of a bus to the other, and decode them. Return how many a second of processor."""
    settings = BusSettings("virtual", "run_can_frames")
    done, left = threading.Event(), [frames]

    def receive(frame: Frame, stamp: float) -> None:
        del stamp
        decode(frame.identifier, frame.data)
        left[0] -= 1
        if not left[0]:
            done.set()

    with closing(CanBus(settings)) as here, closing(CanBus(settings)) as there:
        there.subscribe(receive)
        began = _processor()
        for number in range(frames):
            here.send(motor.BROADCAST_POSITION.frame(3, number, -number))
        if not done.wait(PATIENCE):
            raise AssertionError(f"{left[0]} of {frames} frames are lost")
        return frames / (_processor() - began)


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Print what became of the frames."""
    parser = argparse.ArgumentParser(description="Random frames, and many frames.")
    parser.add_argument("--frames", type=int, default=1_000_000, help="random frames (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (default: %(default)s)")
    options = parser.parse_args()
    cycles = fuzz_driver(options.frames, options.seed)
    print(f"{options.frames} random frames through the driver of an arm, in {cycles} cycles: no state out of its range")
    messages = fuzz(options.frames, options.seed)
    print(f"{options.frames} random frames: {messages} messages, the others refused")
    print(f"a bus: {through_a_bus(100_000):.0f} frames a second of processor, goal 40000 with driver and firmware")


if __name__ == "__main__":
    main()
