"""Random frames for the decoder, and many frames through a bus: ``python tests/torture/run_can_frames.py``.

Whatever is decoded has the same bytes again; the rest is refused with MessageError. The bus is python-can's
``virtual``, which copies each frame; its rate is for a second of processor, both ends together.
"""

from __future__ import annotations

import argparse
import random
import resource
import threading
from contextlib import closing

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.messages import Dialect, Frame
from rtf.robot.errors import MessageError

PATIENCE = 300.0


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
    messages = fuzz(options.frames, options.seed)
    print(f"{options.frames} random frames: {messages} messages, the others refused")
    print(f"a bus: {through_a_bus(100_000):.0f} frames a second of processor, goal 40000 with driver and firmware")


if __name__ == "__main__":
    main()
