"""The demonstration on the simulated robot with its controllers, in lockstep: programs, requests, and lost balls."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

from pictures import needs_pictures
from rtf.bottle import Bottle, Property, as_float
from rtf.cli.demo_network import await_port, demo_network
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, LockstepClock
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types.codecs import BOTTLE
from rtf.red_ball.child_programs import NotStartedError, child_program
from rtf.red_ball.scene import SceneBall
from rtf.robot.device import make_device
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import ICartesianControl
from rtf.robot.network.latest_message import LatestMessage

CONFIG = Path(__file__).parents[2] / "suites" / "robots" / "icubSim" / "redBall.xml"


pytestmark = needs_pictures


class Bench:
    """The robot, the tracker and the demonstration as programs, and clients of them."""

    def __init__(self, opened: ExitStack, patch: pytest.MonkeyPatch) -> None:
        self.network, environment, folder = opened.enter_context(demo_network())
        for name, value in environment.items():
            patch.setenv(name, value)
        words = ["robotinterface", "--config", str(CONFIG), "--lockstep", "yes", "--camera_period", "0.1"]
        self.folder = folder
        log = opened.enter_context((folder / "robot.log").open("w"))
        robot = subprocess.Popen([sys.executable, "-m", "rtf", *words], stderr=log)
        opened.callback(robot.wait)
        opened.callback(robot.terminate)
        await_port(self.network, "/iKinGazeCtrl/rpc", robot)
        patch.setenv(CLOCK_VARIABLE, "lockstep:/clock")
        self.time = opened.enter_context(closing(LockstepClock("/clock", "test", network=self.network)))
        self.start(opened, ["red-ball", "track"], "/pf3dTracker/data:o")
        self.start(opened, ["red-ball", "demo"], "/demoRedBall/rpc")
        self.rpc = opened.enter_context(RpcClient("", "/demoRedBall/rpc", network=self.network))
        ball = SceneBall.find("icubSim", self.network, opened)
        assert ball is not None
        self.ball = ball
        self.pool = opened.enter_context(ThreadPoolExecutor(1))
        where = {"remote": "/icubSim/cartesianController/left_arm", "carrier": "tcp", "timeout": 1.0}
        hand = make_device("cartesiancontrollerclient", Property(where), network=self.network)
        self.hand = opened.enter_context(closing(hand)).view(ICartesianControl)
        self.objects = opened.enter_context(
            closing(LatestMessage("/test/objects", BOTTLE, timeout=1.0, network=self.network))
        )
        self.objects.connect("/demoRedBall/gui:o", "tcp")

    def start(self, opened: ExitStack, words: list[str], port: str) -> None:
        """Start a program of the demonstration."""
        log = self.folder / f"{words[-1]}.log"
        wait = lambda: self.time.sleep(0.02)  # noqa: E731
        opened.enter_context(child_program(words, port, log, network=self.network, wait=wait))

    def ask(self, *words: str | float) -> str:
        """Send a request, and let time pass until it is answered."""
        asked = self.pool.submit(self.rpc.call, Bottle(list(words)))
        while not asked.done():
            self.time.sleep(0.02)
        reply = asked.result()
        assert reply is not None
        return reply.to_text()

    def state(self) -> tuple[str, str]:
        """What it does, and why."""
        reply = self.rpc.call(Bottle(["status"]))
        assert reply is not None
        return str(reply.get(1)), str(reply.get(2))

    def until(self, state: str, seconds: float) -> None:
        """Let time pass until it is in a state."""
        for _ in range(round(seconds / 0.05)):
            if self.state()[0] == state:
                return
            self.time.sleep(0.05)
        raise AssertionError(f"it is {self.state()}, not {state}")

    def from_ball(self) -> float:
        """How far the left hand is from the ball (m)."""
        return float(np.linalg.norm(self.hand.pose().vector[:3] - self.ball.place()))

    def go_home(self) -> None:
        """Stop, and wait until it is idle."""
        assert self.ask("stop") == "[ok]"
        self.until("idle", 8.0)


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """Shared, as it takes seconds to start."""
    with pytest.MonkeyPatch.context() as patch, ExitStack() as opened:
        yield Bench(opened, patch)


def test_it_looks_reaches_and_stands_still_when_the_ball_is_gone(bench: Bench):
    """The hand comes to the ball, follows it, and does not move while it is not seen; then all go home."""
    assert bench.ask("update_pose", 0.0, -0.06, -0.3) == "[ok]"
    np.testing.assert_allclose(bench.ball.place(), [-0.35, -0.06, 0.005])
    assert bench.ask("start", 0.0, -50.0, 10.0) == "[ok]"
    bench.until("following", 2.0)
    bench.time.sleep(3.0)
    assert bench.from_ball() < 0.04
    shown = bench.objects.latest.value
    assert (shown.get(0), shown.get(1), len(shown)) == ("object", "ball", 15)
    np.testing.assert_allclose([as_float(shown.get(place)) for place in (5, 6, 7)], [-350, -60, 5], atol=5.0)
    bench.ball._ask("world", "del", "all")
    bench.until("lost", 1.0)
    assert bench.state() == ("lost", "the ball was not seen for 0.5 s")
    bench.time.sleep(0.3)
    stopped = bench.hand.pose().vector
    bench.time.sleep(0.5)
    np.testing.assert_allclose(bench.hand.pose().vector, stopped, atol=1e-3)
    bench.ball._ask("world", "mk", "ssph", 0.035, 0.08, 0.6026, 0.324)
    bench.until("following", 1.0)
    bench.time.sleep(2.0)
    assert bench.from_ball() < 0.04
    bench.go_home()
    assert bench.objects.latest.value.to_text() == "delete ball"
    bench.time.sleep(3.0)
    assert bench.from_ball() > 0.1


def test_a_ball_out_of_reach_is_only_looked_at(bench: Bench):
    """The reason says so, and the hand stays at home."""
    home = bench.hand.pose().vector
    bench.ask("update_pose", -0.3, -0.06, 0.0)
    assert bench.ask("start") == "[ok]"
    bench.until("following", 2.0)
    bench.time.sleep(1.0)
    assert bench.state() == ("following", "the ball is out of reach of the left hand")
    np.testing.assert_allclose(bench.hand.pose().vector[:3], home[:3], atol=0.005)
    bench.go_home()


@pytest.mark.parametrize(
    ("words", "reply"),
    [
        (["hello"], ""),
        ([], ""),
        (["update_pose", 0.0, float("nan"), 0.0], '[fail] "write update_pose DX DY DZ, with 3 numbers"'),
        (["update_pose", "left"], '[fail] "write update_pose DX DY DZ, with 3 numbers"'),
        (["start", 1.0], '[fail] "write start [AZI ELE VER], with 3 numbers"'),
    ],
)
def test_wrong_requests_do_nothing(bench: Bench, words, reply):
    """Unknown words have the empty reply of the original; it stays idle."""
    assert bench.ask(*words) == reply
    assert bench.state()[0] == "idle"


def test_a_place_that_is_none_is_refused_by_the_simulator(bench: Bench):
    """Its message is passed on."""
    assert "the place of a ball is three numbers" in bench.ask("update_pose", 100.0, 0.0, 0.0)
    with pytest.raises(RefusedError, match="three numbers"):
        bench.ball.move([100.0, 0.0, 0.0])


def test_a_program_that_cannot_start_is_reported(bench: Bench):
    """With its last lines."""
    words = ["red-ball", "demo", "--robot", "nobody", "--name", "/other", "--patience", "0.2"]
    with (
        pytest.raises(NotStartedError, match="there is no /nobody/cartesianController/left_arm/state:o"),
        ExitStack() as opened,
    ):
        bench.start(opened, words, "/other/rpc")
