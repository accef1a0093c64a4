"""The simulated iCub: a simulation, its devices, and the same ports as the robot's."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Self

from rtf.robot.server.analog import AnalogServer
from rtf.robot.server.analog_sensors import AnalogSensorsServer
from rtf.robot.server.board_server import serve_board
from rtf.robot.server.inertial import InertialServer
from rtf.simulator.axes import FACE, SERVED
from rtf.simulator.face import SimulatedFace
from rtf.simulator.hand_sensors import SimulatedFingers
from rtf.simulator.model import Options, build
from rtf.simulator.part import SimulatedPart
from rtf.simulator.simulated_outlets import SimulatedOutlets
from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedForceTorques, SimulatedImu
from rtf.simulator.simulation import Simulation
from rtf.simulator.simulation_clock import CLOCK, serve_time

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.periodic_thread import Publisher
    from rtf.simulator.simulated_cameras import SimulatedCamera

#: States of each part and pictures a second, unless others are asked for.
STATE_RATE, CAMERA_RATE = 100.0, 30.0
#: Seconds between two messages of a sensor.
SENSOR_PERIOD = 0.01
#: Where the robot publishes its force-torque sensors.
_FT_PORTS = {
    "l_arm_ft_sensor": "left_arm",
    "r_arm_ft_sensor": "right_arm",
    "l_leg_ft_sensor": "left_leg",
    "r_leg_ft_sensor": "right_leg",
    "l_foot_ft_sensor": "left_foot",
    "r_foot_ft_sensor": "right_foot",
}
_HANDS = ("left", "right")
CAMERAS = {"left": "left_eye", "right": "right_eye"}


class SimulatedIcub:
    """A robot on the network, from its construction to ``close``.

    ============================== ================================================================================
    ``/NAME/PART/rpc:i`` …         each part's control board: requests (YARP 4: ``nws/rpc:i``), commands, ``state:o``,
                                   ``stateExt:o``
    ``/NAME/PART/analog:o``        its force-torque sensor (arms, legs, ``left_foot``, ``right_foot``)
    ``/NAME/left_hand/analog:o`` … the sensors in the fingers of a hand, fifteen numbers
    ``/NAME/FTs/measures:o``       all of them in one message, and ``rpc:o``
    ``/NAME/inertial``             the inertial unit, twelve numbers; ``/NAME/inertial/measures:o`` and ``rpc:o``
    ``/NAME/cam/left``, ``right``  the eyes, with ``cameras``
    ``/clock``                     the time: published, and served in lockstep
    ============================== ================================================================================

    ``lockstep``: time passes only while all participants wait for it; otherwise by itself, ``factor`` times as fast as
    the machine's clock (None: as fast as possible). The ``dialect`` of the network selects the protocol. The rates (Hz)
    are those of the parts' states and of the pictures.
    """

    def __init__(
        self,
        name: str = "icubSim",
        *,
        network: Network,
        parts: Sequence[str] = SERVED,
        seed: int = 0,
        lockstep: bool = False,
        factor: float | None = 1.0,
        cameras: bool = False,
        state_rate: float = STATE_RATE,
        camera_rate: float = CAMERA_RATE,
        options: Options | None = None,
        clock: str = CLOCK,
    ) -> None:
        self.name = name.strip("/")
        self.network = network
        self.simulation = Simulation(
            build(options or Options(cameras=cameras)), seed=seed, factor=None if lockstep else factor
        )
        self.outlets = SimulatedOutlets(self.simulation, network, lockstep=lockstep)
        self.parts = {part: self._board(part) for part in parts}
        self.force_torques = {
            _FT_PORTS[sensor.name]: SimulatedForceTorque(sensor, self.simulation)
            for sensor in self.simulation.robot.ft_sensors
        }
        self.fingers = {side: SimulatedFingers(side[0], self.simulation) for side in _HANDS}
        self.imu = SimulatedImu(self.simulation)
        self._state_period, self._camera_period = 1 / state_rate, 1 / camera_rate
        self.cameras: dict[str, SimulatedCamera] = {}
        with ExitStack() as opened:
            self._open(opened, lockstep=lockstep, cameras=cameras, clock=clock)
            self._opened = opened.pop_all()

    def _board(self, part: str) -> SimulatedPart | SimulatedFace:
        if part == FACE:
            return SimulatedFace(self.simulation)
        return SimulatedPart(part, self.simulation.boards)

    def _open(self, opened: ExitStack, *, lockstep: bool, cameras: bool, clock: str) -> None:
        """Open all ports, the clock last, as the time begins with it."""
        for part, board in self.parts.items():
            self._serve(opened, serve_board, board, part, self._state_period)
        for place, sensor in self.force_torques.items():
            self._serve(opened, AnalogServer, sensor, f"{place}/analog:o", SENSOR_PERIOD)
        for side, fingers in self.fingers.items():
            self._serve(opened, AnalogServer, fingers, f"{side}_hand/analog:o", SENSOR_PERIOD)
        everything = SimulatedForceTorques(tuple(self.force_torques.values()), self.simulation)
        self._serve(opened, AnalogSensorsServer, everything, "FTs", SENSOR_PERIOD)
        self._serve(opened, InertialServer, self.imu, "inertial", SENSOR_PERIOD)
        self._serve(opened, AnalogSensorsServer, self.imu, "inertial", SENSOR_PERIOD)
        if cameras:
            self._open_cameras(opened)
        self.clock = serve_time(self.simulation, clock, network=self.network, lockstep=lockstep)
        opened.callback(self.clock.close)
        self.simulation.settle.append(self._settle)

    def _serve(self, opened: ExitStack, server: Callable[..., Any], device: object, name: str, period: float) -> None:
        made: Publisher = server(
            device, f"/{self.name}/{name}", network=self.network, period=period, outlets=self.outlets
        )
        opened.callback(made.close)  # type: ignore[attr-defined]  # every server has it
        self.simulation.publish_regularly(made)

    def _open_cameras(self, opened: ExitStack) -> None:
        from rtf.robot.server.frame_grabber import FrameGrabberServer
        from rtf.simulator.simulated_cameras import SimulatedCamera

        for side, name in CAMERAS.items():
            camera = self.cameras[side] = SimulatedCamera(name, self.simulation)
            opened.callback(camera.close)
            self._serve(opened, FrameGrabberServer, camera, f"cam/{side}", self._camera_period)

    def _settle(self) -> None:
        if self.clock.participants:
            self.outlets.settle()
        else:
            self.outlets.flush()

    def close(self) -> None:
        """Stop the time and close all ports."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
