"""The red ball of a simulated scene, and the port by which it is moved."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from icub import ICUB, build_icub
from pictures import needs_pictures
from rtf.bottle import Bottle, Vocab
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot.errors import RefusedError
from rtf.simulator.ball import Ball, find_ball, place_of_ball
from rtf.simulator.cameras import Camera
from rtf.simulator.plant import Options
from rtf.simulator.robot import SimulatedRobot
from rtf.simulator.simulation import Simulation
from rtf.simulator.world import World, from_world, to_world

pytestmark = needs_pictures


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """A simulation of the iCub with its visible scene."""
    return Simulation(build_icub(Options(cameras=True)))


@pytest.fixture
def ball(simulation: Simulation) -> Iterator[Ball]:
    """Its ball, which is reset afterwards."""
    found = find_ball(simulation)
    assert found is not None
    yield found
    simulation.reset()


def centre(simulation: Simulation) -> tuple[float, float, int]:
    """The row and the column of the red pixels of the left eye, and how many they are."""
    with Camera(simulation.plant.model, "eyes_left", 320, 240) as camera:
        picture = camera.render(simulation.data).astype(int)
    red, green, blue = (picture[..., channel] for channel in range(3))
    found = np.argwhere((red > 60) & (red > 3 * green) & (red > 3 * blue))
    if not len(found):
        return math.nan, math.nan, 0
    row, column = found.mean(axis=0)
    return float(row), float(column), len(found)


class TestBall:
    """Its place, size and colour."""

    def test_it_is_where_robot_toml_says_or_the_options(self, simulation: Simulation, ball: Ball):
        """Options win over the robot's own scene."""
        assert ball.place.tolist() == list(ICUB.scene.ball)
        other = find_ball(Simulation(build_icub(Options(cameras=True, ball=(-0.3, 0.1, 0.2)))))
        assert other is not None
        assert other.place.tolist() == [-0.3, 0.1, 0.2]

    def test_a_robot_without_cameras_has_none(self):
        """There is nothing to see it."""
        assert find_ball(Simulation(build_icub())) is None

    def test_pictures_show_it_where_it_was_moved_to_without_a_step(self, simulation: Simulation, ball: Ball):
        """To the left, which is -y, and down."""
        before = centre(simulation)
        ball.move([-0.45, -0.03, 0.22])
        after = centre(simulation)
        assert after[0] > before[0] + 5
        assert after[1] < before[1] - 5

    def test_it_stays_there_while_time_passes_and_goes_home_by_a_reset(self, simulation: Simulation, ball: Ball):
        """The mechanics do not move it."""
        ball.move([-0.45, -0.03, 0.22])
        moved = centre(simulation)
        simulation.advance(simulation.now + 0.05)
        assert centre(simulation) == pytest.approx(moved, abs=1.0)
        simulation.reset()
        assert ball.place.tolist() == list(ICUB.scene.ball)

    def test_it_is_larger_with_a_larger_radius_and_gone_when_hidden(self, simulation: Simulation, ball: Ball):
        """Twice the radius has four times the area."""
        place = list(ball.place)
        ball.show(place, 0.015)
        small = centre(simulation)[2]
        ball.show(place, 0.03)
        assert centre(simulation)[2] == pytest.approx(4 * small, rel=0.15)
        ball.hide()
        assert centre(simulation)[2] == 0
        assert not ball.there

    def test_the_robot_moves_the_same_wherever_the_ball_is(self):
        """To the last bit, also if it is inside of the robot."""
        ends = []
        for place in ((-0.45, 0.0, 0.25), (0.0, 0.0, 0.1)):
            simulation = Simulation(build_icub(Options(cameras=True)), seed=7)
            ball = find_ball(simulation)
            assert ball is not None
            ball.move(place)
            simulation.data.qfrc_applied[:] = 1.0
            simulation.advance(0.1)
            ends.append(simulation.data.qpos.tobytes())
        assert ends[0] == ends[1]

    @pytest.mark.parametrize("place", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, 11), (0, 0), (), (0, 0, 0, 0)])
    def test_places_that_are_none_are_refused(self, ball: Ball, place):
        """The ball stays where it is."""
        with pytest.raises(RefusedError, match="the place of a ball is three numbers"):
            ball.move(place)
        assert ball.place.tolist() == list(ICUB.scene.ball)

    @pytest.mark.parametrize(
        ("radius", "colour"), [(0.0, ()), (math.nan, ()), (1.0, ()), (0.03, (1.0, 2.0, 0.0)), (0.03, (1.0,))]
    )
    def test_sizes_and_colours_that_are_none_are_refused(self, ball: Ball, radius, colour):
        """With the range in the message."""
        with pytest.raises(RefusedError, match="from 0"):
            ball.show([-0.4, 0.0, 0.2], radius, colour)


class TestWorld:
    """Requests in the words of the iCub_SIM."""

    def test_frame_of_the_simulator(self):
        """To the left, up, and to the front; the root is 0.5976 m above its origin."""
        np.testing.assert_allclose(to_world([0.0, 0.0, 0.0]), [0.0, 0.5976, -0.026])
        np.testing.assert_allclose(to_world([-0.3, -0.1, 0.2]), [0.1, 0.7976, 0.274])
        np.testing.assert_allclose(from_world(to_world([-0.3, -0.1, 0.2])), [-0.3, -0.1, 0.2])

    def test_ball_is_moved_removed_and_made(self, ball: Ball):
        """By its name and by its number."""
        world = World(ball)
        ask = lambda words: world.answer(Bottle.parse(words)).to_text()  # noqa: E731
        assert ask("world set ball 0.0 0.9 0.3") == "[ok]"
        np.testing.assert_allclose(ball.place, [-0.326, 0.0, 0.3024])
        assert ask("world get ssph 1") == ask("world get ball")
        assert ask("world del all") == "[ok]"
        assert ask("world get ball") == '[fail] "get: there is no ball; make one: world mk ssph RADIUS X Y Z"'
        assert ask("world mk ssph 0.02 0 0.9 0.3 0 0 1") == "[ok]"
        assert (ball.there, ball.radius) == (True, 0.02)
        assert ask("world mk ssph 0.02 0 0.9 0.3").startswith('[fail] "mk: there is a ball already')

    @pytest.mark.parametrize(
        "words",
        [
            *("world set ball 0 nan 0", "world set ball 0 1", "world set ball a b c", "world set ssph 2 0 1 0"),
            *("world get box 1", "world mk box 1 1 1 0 0 0", "world", "", "quit", "world mk ssph inf 0 0 0"),
        ],
    )
    def test_bad_requests_fail_and_change_nothing(self, ball: Ball, words):
        """The reply says what was wrong."""
        before = ball.place
        reply = World(ball).answer(Bottle.parse(words))
        assert isinstance(reply, Bottle)
        assert reply.get(0) == Vocab("fail")
        np.testing.assert_array_equal(ball.place, before)

    @settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
    @given(
        st.lists(
            st.sampled_from(["world", "mk", "set", "get", "del", "all", "ball", "ssph", "sph", "help"])
            | st.integers(-(2**63), 2**63 - 1)
            | st.floats()
            | st.text(max_size=5)
            | st.builds(Vocab, st.sampled_from(["set", "get"])),
            max_size=10,
        )
    )
    def test_any_request_is_answered(self, ball: Ball, words):
        """Whatever it is; and the ball has a finite place."""
        reply = World(ball).answer(Bottle(words))
        assert isinstance(reply, Bottle)
        assert np.isfinite(ball.place).all()

    def test_port_of_a_robot(self):
        """It is there with the cameras, and the robot's eye sees what the request did."""
        network = Network(LocalNames())
        with (
            SimulatedRobot(ICUB, network=network, parts=("head",), lockstep=True, cameras=True) as robot,
            RpcClient("", "/icubSim/world", network=network) as client,
        ):
            before = centre(robot.simulation)
            reply = client.call(Bottle.parse("world set ball 0.03 0.82 0.424"))
            assert reply is not None
            assert reply.to_text() == "[ok]"
            assert centre(robot.simulation)[1] < before[1] - 5

    def test_place_of_ball_is_what_was_given(self):
        """As a tuple of floats."""
        assert place_of_ball([1, 2, 3]) == (1.0, 2.0, 3.0)
