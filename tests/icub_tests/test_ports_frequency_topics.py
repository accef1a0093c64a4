"""PortsFrequency on topics of ROS 2, published by another process in real time."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from harness import Outcome

#: A topic at 50 Hz, one that skips every fourth message, one that repeats its stamps, one of another type.
ROBOT = """
import sys
from rtf import clock
from rtf.ros2.messages import *
from rtf.ros2.node import Node
class Odd(Message, typename="lab_msgs.msg.dds_.Odd_"): pass
with Node("robot", domain=int(sys.argv[1])) as node:
    good, skips, repeats = (node.publisher(name, JointState) for name in ("good", "skips", "repeats"))
    number, begin = 0, clock.now()
    print("ready", flush=True)
    while True:
        number += 1
        clock.sleep(max(begin + 0.02 * number - clock.now(), 0.0))
        header = Header(Time.of(begin + 0.02 * number))
        good.publish(JointState(header, ["a"], [number]))
        if number % 4: skips.publish(JointState(header, ["a"], [number]))
        repeats.publish(JointState(Header(Time.of(begin + 0.04 * (number // 2))), ["a"], [number]))
"""
CHOSEN = {
    "good": (Verdict.PASSED, ""),
    "skips": (Verdict.FAILED, "rate = 37"),
    "repeats": (Verdict.FAILED, "stamps of the same time"),
    "absent": (Verdict.FAILED, "cannot connect to /absent: nobody publishes /absent in the domain"),
}
TESTS = "".join(
    f'<test name="{name}"><parameter name="TOPICS">((/{name} 50 5))</parameter>'
    '<parameter name="time">1</parameter> PortsFrequency </test>'
    for name in CHOSEN
)
WRONG = '<test name="wrong"><parameter name="TOPICS">((/good 50))</parameter> PortsFrequency </test>'


@pytest.fixture(scope="module")
def outcome(run_on_robot) -> Iterator[Outcome]:
    """One run of all of them."""
    domain = str(1 + os.getpid() % 200)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", domain)
        with subprocess.Popen([sys.executable, "-c", ROBOT, domain], stdout=subprocess.PIPE) as robot:
            assert robot.stdout is not None
            try:
                assert robot.stdout.readline() == b"ready\n"
                yield run_on_robot(f"{TESTS}{WRONG}", robot=False)
            finally:
                robot.kill()


@pytest.mark.parametrize("name", CHOSEN)
def test_each_topic_is_judged(outcome, name: str):
    """The right one passes; others do not, and what is wrong with them is reported. Losses need a machine with time."""
    verdict, complaint = CHOSEN[name]
    found = outcome.verdict(name)
    assert found in ((verdict, Verdict.INCONCLUSIVE) if name == "skips" else (verdict,)), outcome.detail(name)
    assert complaint in outcome.detail(name) or found is Verdict.INCONCLUSIVE


def test_a_wrong_line_is_reported(outcome):
    """With its section."""
    assert outcome.verdict("wrong") is Verdict.ERROR
    assert '[TOPICS] "/good" 50: a line has a port' in outcome.detail("wrong")
