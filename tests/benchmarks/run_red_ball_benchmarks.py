"""How exactly the red ball is located: ``python tests/benchmarks/run_red_ball_benchmarks.py``.

The ball is put to random places in front of the simulated robot, whose head, eyes and torso look about there, with its
arms anywhere; both eyes' pictures are rendered, with noise if that is asked for. Errors are distances from the true
place in the frame of the root; times are those of the processor for a picture.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import TYPE_CHECKING

import numpy as np

from rtf.red_ball.detection import find_ball
from rtf.red_ball.eyes import cameras_of, in_root, pinhole
from rtf.red_ball.stereo import locate
from rtf.robot.model import load_robot
from rtf.robot.model.engine import mujoco
from rtf.simulator import ball as simulated
from rtf.simulator.cameras import Camera
from rtf.simulator.plant import Options, build
from rtf.simulator.scene import BALL_RADIUS
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LOWEST, HIGHEST = (-0.45, -0.3, -0.15), (-0.2, 0.3, 0.35)
VIEW = 42.0  # deg, vertical


def posture(random: np.random.Generator, place: Array, names: list[str]) -> dict[str, float]:
    """Positions (deg) with which the eyes look near a place."""
    x, y, z = place - np.array([-0.06, 0.0, 0.34])
    yaw, pitch = math.degrees(math.atan2(-y, -x)), math.degrees(math.atan2(z, math.hypot(x, y)))
    vergence = math.degrees(2 * math.atan(0.034 / math.sqrt(x * x + y * y + z * z)))
    arms = [name for name in names if any(word in name for word in ("shoulder", "elbow", "wrist"))]
    return {
        "torso_yaw": random.uniform(-10, 10),
        "torso_pitch": random.uniform(-5, 10),
        "neck_yaw": 0.7 * yaw,
        "neck_pitch": max(0.7 * pitch, -35.0),
        "eyes_tilt": 0.3 * pitch,
        "eyes_version": -0.3 * yaw,
        "eyes_vergence": random.uniform(0.6, 1.0) * vergence,
        **{name: random.uniform(-20, 20) for name in arms},
    }


def looks(count: int, noise: float) -> Iterator[tuple[Array, list[NDArray[np.uint8]], Array]]:
    """Yield places, the pictures of both eyes, and the positions of the joints that carry them (deg)."""
    robot = load_robot("icub")
    simulation = Simulation(build(robot, Options(cameras=True)))
    ball = simulated.find_ball(simulation)
    assert ball is not None
    plant, random = simulation.plant, np.random.default_rng(1)
    joints = cameras_of(robot).joints
    names = [axis.name for axis in robot.axes]
    with Camera(plant.model, "eyes_left", 320, 240) as left, Camera(plant.model, "eyes_right", 320, 240) as right:
        for _ in range(count):
            place = random.uniform(LOWEST, HIGHEST)
            axes = plant.home_axes.copy()
            for name, position in posture(random, place, names).items():
                index = robot.index[name]
                axes[index] = math.radians(position) + (axes[index] if name[:2] in ("l_", "r_") else 0.0)
            simulation.data.qpos[:] = plant.pose(axes)
            mujoco().mj_forward(plant.model, simulation.data)
            ball.move(place)
            pictures = [eye.render(simulation.data).astype(np.float64) for eye in (left, right)]
            noisy = [one + random.normal(0.0, noise, one.shape) if noise else one for one in pictures]
            positions = np.degrees([axes[robot.index[joint]] for joint in joints])
            yield place, [one.clip(0, 255).astype(np.uint8) for one in noisy], positions


def row(name: str, errors: list[float]) -> str:
    """Percentiles of errors (m), in mm."""
    middle, high, worst = np.percentile(np.array(errors) * 1e3, [50, 95, 100])
    return f"{name:22} {len(errors):4} places: median {middle:6.2f}, 95 % {high:6.2f}, worst {worst:6.2f} mm"


def main() -> None:
    """Locate the ball at all places."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--places", type=int, default=200)
    parser.add_argument("--noise", type=float, default=0.0, help="standard deviation of the pixels, of 255")
    options = parser.parse_args()
    eyes, camera = cameras_of(load_robot("icub")).eyes, pinhole(320, 240, VIEW)
    both, one, refused, hidden, spent = [], [], 0, 0, []
    for place, pictures, positions in looks(options.places, options.noise):
        began = time.process_time()
        seen = [find_ball(picture, camera, BALL_RADIUS) for picture in pictures]
        spent.append((time.process_time() - began) / 2)
        poses = eyes.poses(positions)
        one += [
            float(np.linalg.norm(in_root(ball.place, pose) - place))
            for ball, pose in zip(seen, poses, strict=True)
            if ball is not None
        ]
        if seen[0] is None or seen[1] is None:
            hidden += 1
            continue
        found = locate(seen[0], seen[1], camera, np.linalg.inv(poses[0]) @ poses[1])
        if found.place is None:
            refused += 1
        else:
            both.append(float(np.linalg.norm(in_root(found.place, poses[0]) - place)))
    print(row("with both eyes", both))
    print(row("by its size in an eye", one))
    print(f"not seen by an eye: {hidden}; refused, as the eyes did not agree: {refused}")
    print(f"a picture takes {np.median(spent) * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
