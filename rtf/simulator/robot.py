"""A simulated robot: a simulation, its devices, and the same ports as the robot's."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Self

from rtf.bottle import Bottle, Property
from rtf.clock import use as use_clock
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.devices.analog_sensors_remapper import CATEGORY_TAGS, AnalogSensorsRemapper
from rtf.robot.interfaces import SensorCategory
from rtf.robot.sensors.analog import AnalogServer
from rtf.robot.sensors.analog_sensors import AnalogSensorsServer
from rtf.robot.sensors.battery import BatteryServer
from rtf.robot.sensors.inertial import InertialServer
from rtf.simulator.ball import find_ball
from rtf.simulator.battery import BATTERY_PERIOD, SimulatedBattery
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.kinematic_part import KinematicPart
from rtf.simulator.part import SimulatedPart
from rtf.simulator.plant import Options, build
from rtf.simulator.robot_sensors import RobotSensors
from rtf.simulator.simulated_outlets import SimulatedOutlets
from rtf.simulator.simulated_sensors import SimulatedForceTorques
from rtf.simulator.simulation import Simulation
from rtf.simulator.simulation_clock import CLOCK, SimulationClock, serve_time
from rtf.simulator.skin import SKIN_PERIOD
from rtf.simulator.world import WORLD, World

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.devices.control_board import ControlBoard
    from rtf.robot.devices.remapper import ControlBoardRemapper
    from rtf.robot.model import RobotModel
    from rtf.robot.publishing import Publisher
    from rtf.simulator.ball import Ball
    from rtf.simulator.depth_cameras import SimulatedDepthCamera
    from rtf.simulator.simulated_cameras import SimulatedCamera

#: States of each part and pictures a second, unless others are asked for.
STATE_RATE, CAMERA_RATE = 100.0, 30.0
#: Seconds between two messages of a sensor.
SENSOR_PERIOD = 0.01


class SimulatedRobot:
    """A robot on the network, from its construction to ``close``.

    ============================== ================================================================================
    ``/NAME/PART/rpc:i`` …         each part's control board: requests (YARP 4: ``nws/rpc:i``), commands, ``state:o``,
                                   ``stateExt:o``
    ``/NAME/PORT/analog:o``        each force-torque sensor, six numbers, and each group of sensors of joint angles
    ``/NAME/FTs/measures:o``       all force-torque sensors in one message, and ``rpc:o``
    ``/NAME/PORT``                 each inertial unit, twelve numbers; ``/NAME/PORT/measures:o`` and ``rpc:o``
    ``/NAME/PORT`` …               each patch of skin, twelve numbers a triangle, and ``rpc:i``
    ``/NAME/PORT/data:o`` …        the battery, and ``rpc:i``
    ``/NAME/PORT``                 each camera, with ``cameras``
    ``/NAME/world``                the red ball, with ``cameras``, if the scene has one
    ``/NAME/PORT/rgbImage:o`` …    each depth camera, likewise: ``depthImage:o``, ``rpc:i``
    ``/clock``                     the time: published, and served in lockstep
    ============================== ================================================================================

    ``serve`` False: without the ports of parts and sensors, which others serve; only the clock is served. ``model``
    says which parts and sensors there are, and the names of their ports. ``can``: its boards are emulated ones on CAN
    buses of this process, and the parts that are served have drivers on these; the clock is that of the process then.
    The parts of ``drives`` have boards that drive one motor each.
    ``lockstep``: time passes only while
    all participants wait for it; otherwise by itself, ``factor`` times as fast as the machine's clock (None: as fast as
    possible). The ``dialect`` of the network selects the protocol. The rates (Hz) are those of the parts' states and of
    the pictures.
    """

    def __init__(
        self,
        model: RobotModel,
        name: str = "",
        *,
        network: Network,
        parts: Sequence[str] = (),
        seed: int = 0,
        lockstep: bool = False,
        factor: float | None = 1.0,
        cameras: bool = False,
        state_rate: float = STATE_RATE,
        camera_rate: float = CAMERA_RATE,
        options: Options | None = None,
        clock: str = CLOCK,
        serve: bool = True,
        can: bool = False,
        drives: Collection[str] = (),
    ) -> None:
        self.model = model
        self.name = (name or model.simulated_name).strip("/")
        self.network = network
        self.lockstep = lockstep
        self._serves = serve
        self.simulation = Simulation(
            build(model, options or Options(cameras=cameras)), seed=seed, factor=None if lockstep else factor
        )
        self.outlets = SimulatedOutlets(self.simulation, lockstep=lockstep)
        served = parts or model.served
        own = [part for part in served if part in model.parts]
        sensors = RobotSensors(self.simulation)
        self.firmware = Firmware(self.simulation, own, sensors, drives) if can else None
        self.parts: dict[str, ControlBoard | KinematicPart | ControlBoardRemapper] = {
            part: self._board(part) for part in served
        }
        self.force_torques, self.angles = sensors.force_torques, sensors.angles
        self.imus, self.skin = sensors.imus, sensors.skin
        battery = model.sensors.battery
        self.battery = None if battery is None else SimulatedBattery(battery, self.simulation)
        self._state_period, self._camera_period = 1 / state_rate, 1 / camera_rate
        self.ball: Ball | None = None  # with cameras
        self.cameras: dict[str, SimulatedCamera] = {}
        self.depth_cameras: dict[str, SimulatedDepthCamera] = {}
        self._drivers: dict[Device, Device] = {}  # of sensors with boards
        with ExitStack() as opened:
            if self.firmware is not None:
                self._open_buses(opened, self.firmware, clock)
            self._open(opened, cameras=cameras, clock=clock)
            self._opened = opened.pop_all()

    def _board(self, part: str) -> SimulatedPart | KinematicPart:
        if part in self.model.kinematic_parts:
            return KinematicPart(self.model.kinematic_parts[part], self.simulation)
        return SimulatedPart(part, self.simulation.boards)

    def _open(self, opened: ExitStack, *, cameras: bool, clock: str) -> None:
        """Open all ports, the clock last, as the time begins with it."""
        for part, board in self.parts.items():
            self._serve(opened, ControlBoardServer, board, part, self._state_period)
        for place, sensor in self.force_torques.items():
            self._serve(opened, AnalogServer, self._driver(sensor), f"{place}/analog:o", SENSOR_PERIOD)
        for place, angles in self.angles.items():
            self._serve(opened, AnalogServer, self._driver(angles), f"{place}/analog:o", SENSOR_PERIOD)
        if self.force_torques:
            self._serve(opened, AnalogSensorsServer, self._all_force_torques(), "FTs", SENSOR_PERIOD)
        for place, imu in self.imus.items():
            self._serve(opened, InertialServer, self._driver(imu), place, SENSOR_PERIOD)
            self._serve(opened, AnalogSensorsServer, self._driver(imu), place, SENSOR_PERIOD)
        for patch in self.skin.values():
            self._serve(opened, AnalogServer, self._driver(patch), patch.settings.port, SKIN_PERIOD)
        if self.battery is not None:
            self.simulation.publish_regularly(self.battery)
            self._serve(opened, BatteryServer, self.battery, self.battery.settings.port, BATTERY_PERIOD)
        if cameras:
            self._open_cameras(opened)
        if self.firmware is None:
            self._start_time(opened, clock)
        self.simulation.settle.append(self._settle)

    def _driver(self, sensor: Device) -> Device:
        """Return the driver of a sensor that has a board on a bus, else the sensor."""
        return self._drivers.get(sensor, sensor)

    def _all_force_torques(self) -> Device:
        """Return all force-torque sensors as one device."""
        sensors = tuple(self.force_torques.values())
        if not self._drivers:
            return SimulatedForceTorques(sensors, self.simulation)
        remapper = AnalogSensorsRemapper("force-torque sensors", network=self.network)
        names = Bottle([one.name for one in sensors])
        remapper.open(Property({f"{CATEGORY_TAGS[SensorCategory.FORCE_TORQUE]}Names": names}))
        remapper.attach({one.name: self._driver(one) for one in sensors})
        return remapper

    def _start_time(self, opened: ExitStack, clock: str) -> None:
        self.clock = serve_time(self.simulation, clock, network=self.network, lockstep=self.lockstep)
        opened.callback(self.clock.close)

    def _open_buses(self, opened: ExitStack, firmware: Firmware, clock: str) -> None:
        """Start the time, share the buses, and open the drivers of the parts, which find their boards on them."""
        from rtf.robot.boards.can_frames import FRAMES_PERIOD, CanFramesServer
        from rtf.robot.devices.can.bus import share, unshare
        from rtf.robot.devices.can.bus_settings import SIMULATED, BusSettings
        from rtf.simulator.firmware.can_parts import open_can_parts, open_can_sensors
        from rtf.simulator.firmware.simulated_bus import provide_buses

        self._start_time(opened, clock)
        opened.callback(provide_buses(firmware, self.network.report))
        if self._serves:
            for wire in firmware.wires:
                bus = share(BusSettings(SIMULATED, wire), self.network.report)
                opened.callback(unshare, bus)
                self._serve(opened, CanFramesServer, bus, f"can/{wire}", FRAMES_PERIOD)
            time = SimulationClock(self.simulation, self.clock, self.outlets, lockstep=self.lockstep)
            opened.enter_context(use_clock(time))
            boards = [part for part in self.parts if part in self.model.parts]
            with self.simulation.held_at_home():  # until its motors have power
                self.parts |= open_can_parts(firmware, boards, self.network, opened)
            self._drivers |= open_can_sensors(firmware, self.network, opened)

    def _serve(self, opened: ExitStack, server: Callable[..., Any], device: object, name: str, period: float) -> None:
        if not self._serves:
            return
        made: Publisher = server(
            device, f"/{self.name}/{name}", network=self.network, period=period, outlets=self.outlets
        )
        opened.callback(made.close)  # type: ignore[attr-defined]  # every server has it
        opened.callback(self.simulation.publish_regularly(made))  # ended first: with boards on CAN time goes on

    def _open_cameras(self, opened: ExitStack) -> None:
        from rtf.robot.sensors.camera import FrameGrabberServer
        from rtf.robot.sensors.rgbd import RgbdServer
        from rtf.simulator.depth_cameras import SimulatedDepthCamera
        from rtf.simulator.simulated_cameras import SimulatedCamera

        self.ball = find_ball(self.simulation)
        if self.ball is not None:
            world = RpcServer(f"/{self.name}{WORLD}", World(self.ball).answer, network=self.network)
            opened.callback(world.close)
        for name, settings in self.model.sensors.cameras.items():
            camera = self.cameras[name] = SimulatedCamera(settings.camera, self.simulation)
            opened.callback(camera.close)
            self._serve(opened, FrameGrabberServer, camera, settings.port, self._camera_period)
        for name, described in self.model.sensors.depth_cameras.items():
            depths = self.depth_cameras[name] = SimulatedDepthCamera(name, described, self.simulation)
            opened.callback(depths.close)
            self._serve(opened, RgbdServer, depths, described.port, self._camera_period)

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
