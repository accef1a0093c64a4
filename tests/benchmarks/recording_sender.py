"""A robot's streams, for the benchmark of recordings: ``recording_sender.py STREAMS RATE CAMERAS FRAMES SECONDS``.

Each stream is a port with sixteen numbers, each camera one with images of 320 x 240 colours, which are noise. It begins
when a line comes on its standard input, prints how often each stream has sent, and ends when another line comes.
"""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack

import numpy as np

from rtf.middleware.ports.port import Port
from rtf.middleware.types import Image, Stamp


def main(streams: int, rate: float, cameras: int, frames: float, seconds: float) -> None:
    """Open the ports, wait, send, and say how much."""
    noise = np.random.default_rng(1)
    pictures = [Image(noise.integers(0, 256, (240, 320, 3), np.uint8), "rgb") for _ in range(10)]
    states = noise.random((100, 16))
    with ExitStack() as opened:
        arms = [opened.enter_context(Port(f"/bench/stream{number}")) for number in range(streams)]
        eyes = [opened.enter_context(Port(f"/bench/camera{number}")) for number in range(cameras)]
        print("ready", flush=True)
        sys.stdin.readline()
        began = time.monotonic()
        sent, shown = 0, 0
        while (now := time.monotonic() - began) < seconds:
            if now * rate >= sent:
                for port in arms:
                    port.write(states[sent % 100], envelope=str(Stamp(sent, time.time())))
                sent += 1
            if now * frames >= shown:
                for port in eyes:
                    port.write(pictures[shown % 10], envelope=str(Stamp(shown, time.time())))
                shown += 1
            time.sleep(max(0.0, min(sent / rate, shown / frames) - (time.monotonic() - began)))
        print(sent, shown, flush=True)
        sys.stdin.readline()


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]), float(sys.argv[5]))
