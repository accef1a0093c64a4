"""The shipped gaze controller on the simulated iCub, in lockstep, and what it looks at."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rtf import clock
from rtf.bottle import Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import Device, make_device
from rtf.robot.interface.robot_reader import read_robot
from rtf.robot.interfaces import ControllerEvent, FixationPoint, IControlMode, IEncoders, IGazeControl, IVelocityControl
from rtf.robot.kinematics import Eyes, robot_chains
from rtf.robot.model import load_robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ICUB = load_robot("icub")
EYES = Eyes(*(robot_chains(ICUB).chain(name, "2.5") for name in ("left_eye", "right_eye", "head")))
SHIPPED = Path(__file__).parents[1] / "suites" / "robots" / "icubSim" / "icubSim.xml"


class SimulatedGaze:
    """A context: the robot with the device of the shipped file, and a client of its ports."""

    def __init__(self, seed: int = 0, client: str = "") -> None:
        self._seed, self._client = seed, client
        self._opened = ExitStack()
        self.events: list[ControllerEvent] = []

    def __enter__(self) -> Self:
        with ExitStack() as opened:
            self.network = Network(LocalNames(), patience=30)
            self._found = {entry.name: entry for entry in read_robot(SHIPPED).robot.devices}
            self.simulation: Any = self._made("simulatedICub", opened, lockstep=True, seed=self._seed)
            self.boards: dict[str, Device] = {}
            for name, kind in (("torso", "simulatedBoard"), ("head", "simulatedBoard"), ("imu", "simulatedImu")):
                self.boards[name] = self._made(kind, opened, **({} if name == "imu" else {"part": name}))
                self.boards[name].attach({"simulation": self.simulation})
            configuration = self._found["gaze"].configuration
            device = make_device("gazecontrollerserver", configuration, network=self.network)
            opened.callback(device.close)
            device.attach({name: board.implementation for name, board in self.boards.items()})
            where = Property({"remote": "/iKinGazeCtrl", "carrier": "tcp"})
            client = opened.enter_context(closing(make_device("gazecontrollerclient", where, network=self.network)))
            self.gaze = client.view(IGazeControl)  # type: ignore[type-abstract]  # it is only looked for
            self.gaze.observe_events(self.events.append)
            self._opened = opened.pop_all()
        return self

    def _made(self, kind: str, opened: ExitStack, **settings: Any) -> Device:
        made = make_device(kind, Property(settings), network=self.network)
        opened.callback(made.close)
        return made

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    # Time and truth --------------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        """Let some time pass."""
        clock.current().sleep(seconds)

    def positions(self) -> Array:
        """The positions of torso, in the order of the chain, and head, deg."""
        torso, head = (self.boards[name].view(IEncoders).encoders() for name in ("torso", "head"))  # type: ignore[type-abstract]
        return np.concatenate([torso[::-1], head])

    def error(self, point: Any) -> float:
        """The greater angle between the axis of an eye and a point, deg, by the encoders."""
        angles = []
        for pose in EYES.poses(self.positions()):
            way = np.asarray(point) - pose[:3, 3]
            angles.append(np.degrees(np.arctan2(np.linalg.norm(np.cross(way, pose[:3, 2])), way @ pose[:3, 2])))
        return float(max(angles))

    def look(self, point: Any, timeout: float = 5.0) -> float:
        """Look at a point, and return how long that took, s. Raises TimeoutError."""
        begin = clock.current().now()
        self.gaze.look_at(FixationPoint(point))
        if not self.gaze.wait_motion_done(timeout, 0.02):
            raise TimeoutError(f"the motion to {np.asarray(point).tolist()} does not end: {self.error(point):.2f} deg")
        return clock.current().now() - begin

    def turn_torso(self, speeds: Any) -> None:
        """Turn the torso: pitch, roll and yaw, deg/s."""
        board = self.boards["torso"]
        modes, velocities = board.view(IControlMode), board.view(IVelocityControl)  # type: ignore[type-abstract]
        if any(mode is not ControlMode.VELOCITY for mode in modes.control_modes()):
            modes.set_control_modes(ControlMode.VELOCITY)
        velocities.velocity_move(np.asarray(speeds, dtype=np.float64)[::-1])


def random_point(generator: np.random.Generator) -> Array:
    """A point in front of the robot that neck and eyes can look at."""
    azimuth, elevation, vergence = generator.uniform((-40, -30, 3), (40, 25, 12))
    return EYES.point_of((azimuth, elevation, vergence))
