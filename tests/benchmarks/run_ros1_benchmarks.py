"""Topics of ROS 1: ``python tests/benchmarks/run_ros1_benchmarks.py``.

A joint state of 53 joints goes to another process and back (1.0 ms wanted, median): to a program of rospy, and to one
of ours. Six parts at 100 Hz with two cameras of 320 x 240 at 30 Hz are published (20 % of a core wanted), which another
process reads. A real master is needed (``rosmaster``), and rospy for the system's Python.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time

import ros_topics
from ros_topics import JOINTS, OF_A_PART, print_figures, round_trips

from rtf.ros1.errors import MasterError
from rtf.ros1.master import Master
from rtf.ros1.messages import Header, Image, JointState, time_of
from rtf.ros1.node import Node

OURS = """
import threading
from rtf.ros1.messages import Image, JointState
from rtf.ros1.node import Node
with Node("echo") as node:
    back = node.publisher("back", JointState)
    node.subscribe("there", JointState, back.publish)
    node.subscribe("states", JointState, lambda _: None)
    for camera in ("left", "right"):
        node.subscribe(camera, Image, lambda _: None)
    print("ready", flush=True)
    threading.Event().wait(120)
"""
ROSPY = """
import rospy
from sensor_msgs.msg import Image, JointState
rospy.init_node("echo", disable_signals=True)
back = rospy.Publisher("back", JointState, queue_size=10, tcp_nodelay=True)
rospy.Subscriber("there", JointState, back.publish, tcp_nodelay=True)
rospy.Subscriber("states", JointState, lambda _: None)
for camera in ("left", "right"):
    rospy.Subscriber(camera, Image, lambda _: None)
print("ready", flush=True)
rospy.spin()
"""
#: rospy with rospy, for comparison.
PING = """
import sys, threading, time
import rospy
from sensor_msgs.msg import JointState
rospy.init_node("ping")
got = threading.Event()
rospy.Subscriber("back", JointState, lambda _: got.set(), tcp_nodelay=True)
there = rospy.Publisher("there", JointState, queue_size=10, tcp_nodelay=True)
numbers = [0.1 * number for number in range(53)]
names = ["joint_%d" % number for number in range(53)]
state = JointState(name=names, position=numbers, velocity=numbers, effort=numbers)
while not got.is_set():
    there.publish(state)
    got.wait(0.1)
for _ in range(int(sys.argv[1])):
    got.clear()
    begun = time.perf_counter()
    there.publish(state)
    if got.wait(1.0):
        print(1e3 * (time.perf_counter() - begun))
"""


def state(joints: int) -> object:
    """A joint state."""
    numbers = [0.1 * number for number in range(joints)]
    return JointState(Header(1, time_of(1.5), ""), [f"joint_{number}" for number in range(joints)], *[numbers] * 3)


def load(node: Node, seconds: float) -> float:
    """The share of a core that publishing takes."""
    cameras = [node.publisher(name, Image) for name in ("left", "right")]
    pixels = bytes(320 * 240 * 3)
    return ros_topics.load(
        node.publisher("states", JointState),
        cameras,
        state(OF_A_PART),
        lambda: Image(Header(), 240, 320, "rgb8", 0, 960, pixels),
        seconds,
    )


def wait_for_master(uri: str) -> None:
    """Return when the master answers."""
    while True:
        try:
            Master(uri, "/benchmark").pid()
        except MasterError:
            time.sleep(0.05)
        else:
            return


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    home = tempfile.mkdtemp()
    os.environ |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": home}
    system = {**os.environ, "PYTHONPATH": ""}
    with subprocess.Popen(["rosmaster", "--core", "-p", str(port)], env=system, stdout=-3, stderr=-3) as master:
        wait_for_master(os.environ["ROS_MASTER_URI"])
        print(f"load {os.getloadavg()[0]:.1f}")
        peers = [
            ("ours with ours", [sys.executable, "-c", OURS], None),
            ("ours with rospy", ["/usr/bin/python3", "-c", ROSPY], system),
        ]
        for what, command, environment in peers:
            with Node("here") as node, subprocess.Popen(command, env=environment, stdout=-1) as other:
                assert other.stdout is not None
                other.stdout.readline()
                print_figures(f", {what}", round_trips(node, JointState, state(JOINTS), options.count), options.count)
                share = 100 * load(node, options.seconds)
                print(f"6 parts at 100 Hz, 2 cameras at 30 Hz, {what}: {share:.0f} % of a core")
                other.kill()
        with subprocess.Popen(["/usr/bin/python3", "-c", ROSPY], env=system, stdout=-1) as other:
            assert other.stdout is not None
            other.stdout.readline()
            ping = ["/usr/bin/python3", "-c", PING, str(options.count)]
            done = subprocess.run(ping, env=system, capture_output=True, text=True, check=True)
            print_figures(", rospy with rospy", [float(line) for line in done.stdout.split()], options.count)
            other.kill()
        master.terminate()


if __name__ == "__main__":
    main()
