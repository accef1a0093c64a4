"""The tracker on a simulated robot in lockstep, over ports."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from icub import ICUB
from pictures import needs_pictures
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.types import IMAGE, VECTOR
from rtf.middleware.wire.contact import Contact
from rtf.red_ball.eyes import cameras_of, in_root
from rtf.red_ball.program import TrackerSettings, start_tracker
from rtf.robot.network.latest_message import LatestMessage
from rtf.simulator.faults.injection import FaultInjector
from rtf.simulator.robot import SimulatedRobot

pytestmark = needs_pictures


class Bench:
    """A robot, a tracker of its ball, and a reader of what that sends."""

    def __init__(self, network: Network, said: list[str], opened: ExitStack) -> None:
        self.said = said
        self.robot = opened.enter_context(
            SimulatedRobot(ICUB, network=network, parts=("head",), lockstep=True, cameras=True, camera_rate=20.0)
        )
        self.injector = FaultInjector(self.robot)
        self.time = LockstepClock("/clock", "test", network=network)
        opened.callback(self.time.close)
        start_tracker(TrackerSettings(ICUB), network, opened)
        self._places = self._reader("/test/places", "/pf3dTracker/data:o", VECTOR, network, opened)
        self.shown = self._reader("/test/shown", "/pf3dTracker/video:o", IMAGE, network, opened)
        self.cameras = cameras_of(ICUB)

    @staticmethod
    def _reader(name, source, codec, network: Network, opened: ExitStack) -> LatestMessage:
        reader = LatestMessage(name, codec, timeout=1.0, network=network)
        opened.callback(reader.close)
        reader.connect(source, "tcp")
        return reader

    def numbers(self) -> np.ndarray:
        """What the tracker sent of the latest picture; the time of its stamp is that of the last pictures."""
        latest = self._places.latest
        assert latest is not None
        assert self.time.now() - latest.time <= 0.05 + 1e-9
        return latest.value

    def place(self) -> np.ndarray:
        """The ball in the frame of the root, for a head at home."""
        return in_root(self.numbers()[:3], self.cameras.eyes.poses(np.zeros(9))[0])


@pytest.fixture(scope="module")
def opened() -> Iterator[Bench]:
    """Shared, as it takes seconds to start."""
    said: list[str] = []
    network = Network(LocalNames(), report=said.append)
    with pytest.MonkeyPatch.context() as patch, ExitStack() as stack:
        patch.setenv(CLOCK_VARIABLE, "lockstep:/clock")
        yield Bench(network, said, stack)


@pytest.fixture
def bench(opened: Bench) -> Iterator[Bench]:
    """A healthy robot, with the ball at its place."""
    yield opened
    opened.injector.clear()
    opened.robot.ball.show(list(ICUB.scene.ball), 0.035)
    opened.time.sleep(0.2)
    opened.said.clear()


class TestTracker:
    """What it sends."""

    @pytest.mark.parametrize("place", [(-0.45, 0.0, 0.25), (-0.35, 0.04, 0.33), (-0.4, -0.05, 0.3)])
    def test_place_of_the_ball_before_the_time_goes_on(self, bench: Bench, place):
        """Within 5 mm, by the pictures of the same moment; seen, with its pixel in the left eye."""
        bench.robot.ball.move(place)
        bench.time.sleep(0.1)
        assert np.linalg.norm(bench.place() - place) < 0.005
        x, y, z, likelihood, u, v, seen = bench.numbers()
        assert (seen, likelihood > 0.9) == (1.0, True)
        assert (u, v) == pytest.approx((160 + 312.6 * x / z, 120 + 312.6 * y / z), abs=0.2)
        assert bench.said == []

    def test_no_ball_is_not_seen(self, bench: Bench):
        """Zeros, for each picture."""
        bench.robot.ball.hide()
        bench.time.sleep(0.1)
        assert bench.numbers().tolist() == [0.0] * 7

    def test_picture_shows_what_was_found(self, bench: Bench):
        """A green circle about the ball."""
        bench.time.sleep(0.1)
        latest = bench.shown.latest
        assert latest is not None
        rows, columns = np.nonzero((latest.value.pixels == (0, 255, 0)).all(axis=2))
        *_, u, v, _ = bench.numbers()
        assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((u, v), abs=1.0)

    def test_swapped_eyes_do_not_agree(self, bench: Bench):
        """The ball is not seen, and the reason is reported once."""
        bench.injector.inject("cameras_swapped", "left", {}, delay=0.0, duration=float("inf"))
        bench.time.sleep(0.3)
        assert bench.numbers()[-1] == 0.0
        assert len(bench.said) == 1
        assert "the eyes do not agree" in bench.said[0]

    def test_an_eye_that_shows_an_old_picture_does_not_agree(self, bench: Bench):
        """The ball has moved in the other one only."""
        bench.injector.inject("camera_frozen", "left", {}, delay=0.0, duration=float("inf"))
        bench.time.sleep(0.1)
        bench.robot.ball.move((-0.4, -0.05, 0.3))
        bench.time.sleep(0.1)
        assert bench.numbers()[-1] == 0.0
        assert any("the eyes do not agree" in one for one in bench.said)

    def test_one_eye_is_enough(self, bench: Bench):
        """Without pictures of the right one the distance is that by the size: within 1 cm."""
        network = bench.robot.network
        source, target = Contact("/icubSim/cam/right"), Contact("/pf3dTracker/right:i")
        remote.disconnect(network, source, target)
        try:
            bench.time.sleep(0.2)
            assert np.linalg.norm(bench.place() - ICUB.scene.ball) < 0.01
        finally:
            remote.connect(network, source, target, "tcp")

    def test_pictures_that_come_together_are_paired(self, bench: Bench):
        """Several of one eye come before those of the other; each is evaluated with its own, none with an old one."""
        for x in (-0.45, -0.44, -0.43, -0.42):
            bench.robot.ball.move((x, 0.0, 0.25))
            bench.time.sleep(0.25)
            assert np.linalg.norm(bench.place() - [x, 0.0, 0.25]) < 0.001  # by its size alone it is not so exact
        assert bench.said == []
