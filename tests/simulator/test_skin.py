"""The skin of a simulated robot: its places, what it feels, and what its ports show."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.util import find_spec

import msgspec
import numpy as np
import pytest

from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.device import make_device
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAnalogSensor
from rtf.robot.model import RobotModelError, find_robot, load_robot
from rtf.robot.model.file import SkinPatch

pytestmark = pytest.mark.skipif(not find_spec("mujoco"), reason="needs pip install 'rtf[sim]'")

#: One without noise.
EXACT = SkinPatch(link="fore", port="skin/fore", triangles=60, noise=0.0)
#: A weight of 0.2 kg without friction in a slide, on the side of the fore arm of a bench that is at its home, 30 deg.
WEIGHT = """
    <body name="weight" pos="{x} 0.11 {z}">
      <joint name="fall" type="slide" axis="0 0 1"/>
      <geom name="ball" type="sphere" size="0.01" mass="0.2" condim="1" priority="1"/>
    </body>
  </worldbody>
"""
#: Half-way along the fore arm at home, which hangs forward by 30 deg from (0, 0.11, 0.35).
X, Z = -0.055, 0.35 - 0.0953


@pytest.fixture
def loaded(tmp_path):
    """A bench on whose fore arm a weight lies, simulated until it is at rest."""
    from rtf.simulator.plant import build
    from rtf.simulator.simulation import Simulation

    bench = find_robot("bench")
    (tmp_path / "robot.toml").write_text(bench.read_text(encoding="utf-8"), encoding="utf-8")
    text = (bench.parent / "bench.xml").read_text(encoding="utf-8")
    text = text.replace("  </worldbody>\n", WEIGHT.format(x=X, z=Z + 0.07))
    (tmp_path / "bench.xml").write_text(text, encoding="utf-8")
    return Simulation(build(load_robot(str(tmp_path))))


def patch(settings: SkinPatch, simulation, name: str = "fore"):
    """A patch of skin."""
    from rtf.simulator.skin import SimulatedSkin

    return SimulatedSkin(name, settings, simulation)


def bench(seed: int = 0):
    """A bench without contacts."""
    from rtf.simulator.plant import build
    from rtf.simulator.simulation import Simulation

    return Simulation(build(load_robot("bench")), seed=seed)


def test_taxels_cover_the_shape():
    """The middle of each triangle is on the capsule's surface, and its taxels are a few millimetres apart."""
    skin = patch(EXACT, bench())
    assert skin.places.shape == (720, 3)
    middles = skin.places.reshape(60, 12, 3)
    spread = np.linalg.norm(middles - middles.mean(axis=1, keepdims=True), axis=2).max()
    assert 0.005 < spread < 0.02
    # Taxels are in the plane that touches the capsule (radius 0.02 m, half length 0.11 m) at a point beside them.
    along = np.clip(skin.places[:, 2], -0.11, 0.11)
    heights = np.linalg.norm(skin.places - np.column_stack([0 * along, 0 * along, along]), axis=1)
    assert heights.min() >= 0.02 - 1e-9
    assert heights.max() < 0.028
    assert len({tuple(place) for place in skin.places.round(6)}) == 720


def test_a_weight_presses_the_taxels_below_it(loaded):
    """Those in the middle of the contact most; far ones not at all; the whole effect is that of the force."""
    skin = patch(EXACT, loaded)
    assert skin.read().values.tolist() == [240.0] * 720
    loaded.advance(1.5)
    pressed = 240.0 - skin.read().values
    assert loaded.data.ncon >= 1
    assert pressed.min() == 0.0
    assert pressed.max() > 5.0
    contact = (loaded.data.contact.pos[0] - loaded.data.geom("fore_shape").xpos) @ loaded.data.geom(
        "fore_shape"
    ).xmat.reshape(3, 3)
    distances = np.linalg.norm(skin.places - contact, axis=1)
    assert pressed[distances > 0.04].max() == 0.0
    assert np.argmax(pressed) == np.argmin(distances)


def test_the_reading_falls_with_the_force(loaded):
    """By the sensitivity, until it is 0. The ball can only move vertically, so its normal force is greater than 2 N."""
    loaded.advance(1.5)
    force = 0.2 * 9.81 / np.sin(loaded.data.qpos[:2].sum())
    some, more, most = (
        240.0 - patch(msgspec.structs.replace(EXACT, sensitivity=counts), loaded).read().values
        for counts in (10.0, 40.0, 1e6)
    )
    assert more == pytest.approx(4.0 * some, abs=2.5)
    skin, contact = patch(EXACT, loaded), loaded.data.contact.pos[0] - loaded.data.geom("fore_shape").xpos
    places = skin.places @ loaded.data.geom("fore_shape").xmat.reshape(3, 3).T
    nearest = np.linalg.norm(places - contact, axis=1).min()
    assert more.max() == pytest.approx(40.0 * force * np.exp(-((nearest / 0.01) ** 2)), rel=0.05)
    assert (most.min(), most.max()) == (0.0, 240.0)


def test_reading_it_does_not_change_the_mechanics(loaded, tmp_path):
    """A robot whose skin is read all the time moves as one without, to the last bit."""
    from rtf.simulator.simulation import Simulation

    other = Simulation(loaded.plant)
    skin = patch(EXACT, loaded)
    for _ in range(30):
        loaded.advance(loaded.now + 0.02)
        skin.read()
        other.advance(other.now + 0.02)
    assert loaded.data.qpos.tobytes() == other.data.qpos.tobytes()
    assert loaded.data.qvel.tobytes() == other.data.qvel.tobytes()


def test_noise_is_by_the_seed_and_the_name():
    """Patches differ, two robots with one seed do not; the noise of other sensors does not depend on the skin."""
    noisy = SkinPatch(link="fore", port="skin/fore", triangles=4)
    readings = [
        patch(noisy, simulation, name).read().values.tolist()
        for simulation, name in ((bench(), "fore"), (bench(), "fore"), (bench(seed=1), "fore"), (bench(), "upper"))
    ]
    assert readings[0] == readings[1]
    assert readings[0] != readings[2]
    assert readings[0] != readings[3]
    read, unread = bench(), bench()
    patch(noisy, read).read()
    assert read.noise(8).tolist() == unread.noise(8).tolist()
    again = patch(noisy, read)
    first = again.read().values.tolist()
    read.advance(0.1)
    assert again.read().values.tolist() != first
    read.reset()
    assert again.read().values.tolist() == first


def test_readings_are_counts():
    """Whole numbers from 0 to 255, whatever the noise is; a calibration is refused."""
    skin = patch(SkinPatch(link="fore", port="skin/fore", triangles=50, noise=200.0, rest=128.0), bench())
    values = skin.read().values
    assert (values == values.round()).all()
    assert {values.min(), values.max()} == {0.0, 255.0}
    with pytest.raises(NotSupportedError, match="no calibration"):
        skin.calibrate()


def test_what_the_model_does_not_have_is_named():
    """A missing link or shape is an error; skin of a robot without collisions feels nothing."""
    from rtf.simulator.plant import Options, build
    from rtf.simulator.simulation import Simulation

    with pytest.raises(RobotModelError, match="the skin fore is on 'hand'"):
        patch(SkinPatch(link="hand", port="skin/hand", triangles=1), bench())
    with pytest.raises(RobotModelError, match="no shape 'palm' that collides"):
        patch(SkinPatch(link="fore", port="skin/fore", triangles=1, shape="palm"), bench())
    ghost = Simulation(build(load_robot("bench"), Options(collision="none")))
    assert patch(EXACT, ghost).read().values.tolist() == [240.0] * 720


def test_a_robot_serves_its_skin(tmp_path, monkeypatch):
    """At the names of the real robot, twelve numbers a triangle."""
    from rtf.simulator.robot import SimulatedRobot

    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    network = Network(LocalNames(), patience=30)
    with ExitStack() as opened:
        robot = opened.enter_context(
            SimulatedRobot(load_robot("icub"), "icub", network=network, lockstep=True, parts=["head"])
        )
        client = make_device(
            "analogsensorclient",
            Property({"remote": "/icub/skin/left_forearm", "local": "/reader", "carrier": "tcp"}),
            network=network,
        )
        opened.callback(client.close)
        robot.simulation.advance(0.1)
        robot.outlets.settle()
        skin = client.view(IAnalogSensor)  # type: ignore[type-abstract]
        assert skin.channels() == 384
        assert skin.read().values.tolist() == robot.skin["left_forearm"].read().values.tolist()
