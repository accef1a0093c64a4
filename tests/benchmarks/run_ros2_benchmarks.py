"""Topics of ROS 2: ``python tests/benchmarks/run_ros2_benchmarks.py``.

A joint state of 53 joints goes to another process and back (0.7 ms wanted, median), and six parts at 100 Hz with two
cameras of 320 x 240 at 30 Hz are published (20 % of a core wanted), which another process reads.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import threading
import time

from rtf.ros2.messages import Header, Image, JointState, String, Time
from rtf.ros2.node import Node, Publisher

DOMAIN = 201
ECHO = f"""
import sys, threading
from rtf.ros2.messages import Image, JointState, String
from rtf.ros2.node import Node
end = threading.Event()
with Node("echo", domain={DOMAIN}) as node:
    back = node.publisher("back", JointState)
    node.subscribe("there", JointState, back.publish)
    node.subscribe("states", JointState, lambda _: None)
    for camera in ("left", "right"):
        node.subscribe(camera, Image, lambda _: None)
    node.subscribe("end", String, lambda _: end.set())
    print("ready", flush=True)
    end.wait(120)
"""


def state(joints: int) -> JointState:
    """A joint state."""
    numbers = [0.1 * number for number in range(joints)]
    return JointState(
        Header(Time(1, 2), ""), [f"joint_{number}" for number in range(joints)], numbers, numbers, numbers
    )


def round_trips(node: Node, count: int) -> list[float]:
    """Milliseconds of round trips."""
    back = threading.Event()
    node.subscribe("back", JointState, lambda _: back.set())
    there, message = node.publisher("there", JointState), state(53)
    while not back.is_set():  # until both ends have found each other
        there.publish(message)
        back.wait(0.1)
    times = []
    for _ in range(count):
        back.clear()
        begun = time.perf_counter()
        there.publish(message)
        if back.wait(1.0):
            times.append(1e3 * (time.perf_counter() - begun))
    return times


def load(node: Node, seconds: float) -> float:
    """The share of a core that publishing takes."""
    states = node.publisher("states", JointState)
    cameras: list[Publisher[Image]] = [node.publisher(name, Image) for name in ("left", "right")]
    picture = bytes(320 * 240 * 3)
    parts = [state(9) for _ in range(6)]
    used, begun = time.process_time(), time.perf_counter()
    ticks = 0
    while time.perf_counter() - begun < seconds:
        for part in parts:
            states.publish(part)
        if ticks % 10 in (0, 3, 6):
            for camera in cameras:
                camera.publish(Image(Header(), 240, 320, "rgb8", 0, 960, picture))
        ticks += 1
        time.sleep(max(begun + 0.01 * ticks - time.perf_counter(), 0.0))
    return (time.process_time() - used) / (time.perf_counter() - begun)


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    with Node("here", domain=DOMAIN) as node, subprocess.Popen([sys.executable, "-c", ECHO], stdout=-1) as other:
        assert other.stdout is not None
        other.stdout.readline()
        times = sorted(round_trips(node, options.count))
        print(f"load {os.getloadavg()[0]:.1f}")
        print(
            f"JointState of 53 joints, round trip: median {statistics.median(times):.2f} ms, "
            f"p95 {times[int(0.95 * len(times))]:.2f} ms, {len(times)} of {options.count}"
        )
        print(f"6 parts at 100 Hz, 2 cameras at 30 Hz: {100 * load(node, options.seconds):.0f} % of a core")
        node.publisher("end", String).publish(String("over"))
        other.terminate()


if __name__ == "__main__":
    main()
