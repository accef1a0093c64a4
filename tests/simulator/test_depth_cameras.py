"""The depth cameras of simulated robots: depths of known surfaces, noise, clip planes, and the ports of a robot."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from pictures import needs_pictures
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.device import make_device
from rtf.robot.interfaces import IRgbdSensor, RgbdPart
from rtf.robot.model import load_robot
from rtf.robot.sensors.point_cloud import points_of

if TYPE_CHECKING:
    from rtf.simulator.simulation import Simulation


pytestmark = needs_pictures
BENCH = load_robot("bench")
SETTINGS = BENCH.sensors.depth_cameras["depth"]
EXACT = msgspec.structs.replace(SETTINGS, noise=0.0)


def bench(seed: int = 0) -> Simulation:
    """A bench in front of its depth camera."""
    from rtf.simulator.plant import Options, build
    from rtf.simulator.simulation import Simulation

    return Simulation(build(BENCH, Options(cameras=True)), seed=seed)


def camera(settings, simulation: Simulation, name: str = "depth"):
    """A depth camera, which is closed by its block."""
    from rtf.simulator.depth_cameras import SimulatedDepthCamera

    return closing(SimulatedDepthCamera(name, settings, simulation))


def view(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """The place of the camera, and its axes: right, down, ahead, as columns, in the world."""
    found = simulation.data.camera("outside")
    return found.xpos.copy(), found.xmat.reshape(3, 3) * np.array([1.0, -1.0, -1.0])


def test_the_points_of_the_floor_are_at_its_height():
    """All points that the camera sees below the robot are on the plane z = 0, to the millimetre."""
    simulation = bench()
    with camera(EXACT, simulation) as seen:
        images = seen.images()
        points = points_of(images.depth.pixels, seen.intrinsics(RgbdPart.DEPTH), seen.clip_planes())
    place, axes = view(simulation)
    world = points[230:].reshape(-1, 3) @ axes.T + place  # the last rows show nothing else
    assert np.isfinite(world).all()
    assert np.abs(world[:, 2]).max() < 1e-3


def test_the_known_depth_of_the_bench_is_that_of_the_floor():
    """The number in robot.toml follows from the place of the camera, its direction and its field of view."""
    (known,) = SETTINGS.known
    place, axes = view(bench())
    down = (2.0 * known.at[1] - 1.0) * np.tan(np.radians(45.0) / 2.0)
    ray = axes[:, 2] + down * axes[:, 1]
    assert -place[2] / ray[2] == pytest.approx(known.depth, abs=1e-3)


def test_a_near_surface_is_before_a_far_one():
    """The post of the bench covers the floor behind it: in the middle of the image the depth is that of the post."""
    with camera(EXACT, bench()) as seen:
        images = seen.images()
    distance = np.linalg.norm(np.subtract((0.9, 0.9, 0.8), (0.0, 0.0, 0.45)))
    middle = float(images.depth.pixels[118:122, 158:162].min())
    assert distance - 0.15 < middle < distance
    assert images.colour.pixels.shape == (240, 320, 3)
    assert images.depth.pixels.dtype == np.float32


def test_nothing_is_measured_out_of_the_clip_planes():
    """There the depth is 0, also where there is nothing at all; everywhere else it is between them."""
    settings = msgspec.structs.replace(SETTINGS, near=1.0, far=2.0, noise=0.01)
    with camera(settings, bench()) as seen:
        depth = seen.images().depth.pixels
    measured = depth[depth != 0.0]
    assert 0.0 < measured.size < depth.size
    assert measured.min() >= 1.0
    assert measured.max() <= 2.0
    assert depth[0, 0] == 0.0  # the sky


def test_noise_is_by_the_seed():
    """Its deviation is that of the settings, and the noise of other sensors does not change."""
    one, same, other = bench(), bench(), bench(seed=1)
    noisy = msgspec.structs.replace(SETTINGS, noise=0.02)
    found = []
    for simulation in (one, same, other):
        with camera(noisy, simulation) as seen:
            found.append(seen.images().depth.pixels)
    assert found[0].tobytes() == found[1].tobytes() != found[2].tobytes()
    with camera(EXACT, bench()) as seen:
        exact = seen.images().depth.pixels
    assert np.std((found[0] - exact)[200:]) == pytest.approx(0.02, rel=0.05)
    assert one.noise(8).tolist() == bench().noise(8).tolist()
    with camera(noisy, one) as seen:
        first = seen.images().depth.pixels
        assert seen.images().depth.pixels.tobytes() != first.tobytes()
        one.reset()
        assert seen.images().depth.pixels.tobytes() == first.tobytes()


def test_an_unknown_camera_is_named():
    """The error lists the cameras."""
    with pytest.raises(ValueError, match="no camera 'inside'; there are outside"):
        camera(msgspec.structs.replace(SETTINGS, camera="inside"), bench())


def test_a_robot_serves_its_depth_camera(tmp_path, monkeypatch):
    """The client reads it in lockstep with the simulation; it is there with cameras only."""
    from rtf.simulator.robot import SimulatedRobot

    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    network = Network(LocalNames(), patience=30)
    with ExitStack() as opened:
        robot = opened.enter_context(SimulatedRobot(BENCH, network=network, lockstep=True, cameras=True))
        device = make_device(
            "RGBDSensor_nwc_yarp",
            Property({"remote": "/benchSim/depthCamera", "ImageCarrier": "tcp", "DepthCarrier": "tcp"}),
            network=network,
        )
        opened.callback(device.close)
        client = device.view(IRgbdSensor)  # type: ignore[type-abstract]
        robot.simulation.advance(0.3)
        robot.outlets.settle()
        images = client.images()
        assert images.colour_time == images.depth_time
        assert images.depth.pixels[228, 160] == pytest.approx(1.276, abs=0.01)
        assert client.intrinsics(RgbdPart.DEPTH) == robot.depth_cameras["depth"].intrinsics(RgbdPart.DEPTH)
        assert client.clip_planes() == (0.2, 6.0)
    with SimulatedRobot(BENCH, network=network, lockstep=True) as blind:
        assert blind.depth_cameras == {}
