"""Topics of ROS 2: ``python tests/benchmarks/run_ros2_benchmarks.py``.

A joint state of 53 joints goes to another process and back (0.7 ms wanted, median), and six parts at 100 Hz with two
cameras of 320 x 240 at 30 Hz are published (20 % of a core wanted), which another process reads.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

import ros_topics
from ros_topics import JOINTS, OF_A_PART, print_figures, round_trips

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


def load(node: Node, seconds: float) -> float:
    """The share of a core that publishing takes."""
    cameras: list[Publisher[Image]] = [node.publisher(name, Image) for name in ("left", "right")]
    pixels = bytes(320 * 240 * 3)
    return ros_topics.load(
        node.publisher("states", JointState),
        cameras,
        state(OF_A_PART),
        lambda: Image(Header(), 240, 320, "rgb8", 0, 960, pixels),
        seconds,
    )


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    with Node("here", domain=DOMAIN) as node, subprocess.Popen([sys.executable, "-c", ECHO], stdout=-1) as other:
        assert other.stdout is not None
        other.stdout.readline()
        print(f"load {os.getloadavg()[0]:.1f}")
        print_figures("", round_trips(node, JointState, state(JOINTS), options.count), options.count)
        print(f"6 parts at 100 Hz, 2 cameras at 30 Hz: {100 * load(node, options.seconds):.0f} % of a core")
        node.publisher("end", String).publish(String("over"))
        other.terminate()


if __name__ == "__main__":
    main()
