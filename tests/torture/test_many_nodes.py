"""Nodes of ROS 2 that are opened and closed thousands of times, in a process of its own, for it may crash."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec

import pytest

pytestmark = [
    pytest.mark.torture,
    pytest.mark.skipif(not find_spec("cyclonedds"), reason="needs pip install 'rtf[dds]'"),
]

#: Opens two nodes, sends a message from one to the other, and closes both, again and again.
PROGRAM = """
import os, sys, threading
from rtf.ros2.messages import Header, Image, Imu
from rtf.ros2.node import Node

domain = 1 + os.getpid() % 200
for number in range(int(sys.argv[1])):
    come = threading.Event()
    with Node("robot", domain=domain) as robot, Node("reader", domain=domain) as reader:
        robot.publisher("pictures", Image)
        states = robot.publisher("states", Imu)
        reader.subscribe("states", Imu, lambda message: come.set())
        assert states.await_reader(10.0)
        states.publish(Imu())
        assert come.wait(10.0), number
print("done")
"""


@pytest.mark.timeout(900)
def test_a_process_that_opens_nodes_again_and_again_lives():
    """The library frees a type that the next node needs, if nothing holds it: three of three runs crashed before."""
    ran = subprocess.run([sys.executable, "-c", PROGRAM, "6000"], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (0, "done\n"), ran.stderr
