"""The server of a control board: requests of YARP 3, of YARP 4 or of both, streamed commands, streams of its state."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Dialect
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.device import Device, make_device
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IAxisInfo
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.state_streams import StateStreams
from rtf.robot.network.streamed_commands import StreamedCommands
from rtf.robot.parameters import flag
from rtf.robot.yarp3.server import ControlBoardRequests
from rtf.robot.yarp4.server import BoardService

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from rtf.bottle import Property
    from rtf.middleware.ports.network import Network
    from rtf.robot.publishing import Outlets

#: Default period of the state, in seconds.
DEFAULT_PERIOD = 0.02


class ControlBoardServer:
    """The ports of a board: ``NAME/command:i``, ``NAME/state:o``, ``NAME/stateExt:o``, and those of its requests.

    ``protocols`` says which requests are answered, by default those of the network's dialect: ``NAME/rpc:i`` answers
    the words of YARP 3, ``NAME/nws/rpc:i`` is the service of YARP 4, which has its dialect on every network. With the
    service alone the streams have that dialect, too, otherwise that of the network.

    The ports are open from construction to ``close``. The owner calls ``publish`` every ``period`` seconds. ``outlets``
    is explained at :class:`StateStreams`. Raises NotSupportedError for a device
    without the number of its axes, and the middleware's errors if the ports cannot be opened.
    """

    def __init__(
        self,
        device: object,
        name: str,
        *,
        network: Network,
        period: float = DEFAULT_PERIOD,
        outlets: Outlets | None = None,
        protocols: Collection[Dialect] | None = None,
    ) -> None:
        if not isinstance(device, IAxisInfo):
            raise NotSupportedError(f"{name}: a {type(device).__name__} is not a control board: it has no IAxisInfo")
        self.name = name
        self.period = period
        protocols = protocols or (network.dialect,)
        newer = network.in_dialect(Dialect.YARP4)
        streaming = network if Dialect.YARP3 in protocols else newer

        def report(sentence: str) -> None:
            network.report(f"{name}: {sentence}")

        with ExitStack() as opened:
            if Dialect.YARP3 in protocols:
                words = ControlBoardRequests(device, report)
                opened.enter_context(RpcServer(f"{name}/rpc:i", words.answer, network=network, guarded=True))
            if Dialect.YARP4 in protocols:
                service = BoardService(device, name, network=network)
                opened.enter_context(RpcServer(f"{name}/nws/rpc:i", service.answer, network=newer, guarded=True))
            commands = StreamedCommands(device, report)
            opened.enter_context(
                Port(f"{name}/command:i", commands.take, network=streaming, outputs=False, guarded=True)
            )
            self._state = StateStreams(device, device.axes(), name, network=streaming, outlets=outlets)
            opened.callback(self._state.close)
            self._opened = opened.pop_all()

    def publish(self, now: float) -> None:
        """Publish the state."""
        self._state.publish(now)

    def settle(self) -> None:
        """Wait until all readers that acknowledge have processed what was published."""
        self._state.settle()

    def close(self) -> None:
        """Close the ports after the commands in progress. A second call has no effect."""
        self._opened.close()


class ControlBoardDevice(PublishingDevice):
    """``controlBoard_nws_yarp``: the server as a device of a configuration.

    ``name`` is the prefix of its ports, ``period`` in seconds (default 0.02), and ``service``, yes or no, whether it
    has the service of YARP 4; the default follows the dialect of the network.
    """

    default_period = DEFAULT_PERIOD
    ros_device, ros_message = "controlBoard_nws_ros", "sensor_msgs/JointState"
    _protocols: tuple[Dialect, ...] = ()

    def configure(self, configuration: Property) -> None:
        if configuration.check("service"):
            self._protocols = (Dialect.YARP4 if flag(configuration, "service") else Dialect.YARP3,)

    def serve(self, device: Device) -> ControlBoardServer:
        return ControlBoardServer(
            device.implementation,
            self.port_name,
            network=self.network,
            period=self.period,
            outlets=self.outlets,
            protocols=self._protocols,
        )


class ControlBoardWrapperDevice(ControlBoardDevice):
    """``controlboardwrapper2``, the older type: its period is in milliseconds, and it can combine several boards.

    With ``networks`` and ``joints`` it serves the attached boards as a :class:`ControlBoardRemapper` of them; with
    ``subdevice`` a device of that type, which it creates with the same configuration.
    """

    unit = 0.001  # milliseconds
    default_period = DEFAULT_PERIOD / unit
    _subdevice: Device | None = None
    _remapper: Device | None = None

    def open(self, configuration: Property) -> None:
        super().open(configuration)
        kind = configuration.find("subdevice")
        if not isinstance(kind, str):
            return
        self._subdevice = make_device(kind, configuration, name=f"{self.name}.{kind}", network=self._given_network)
        try:
            super().attach({kind: self._subdevice})
        except Exception:
            self.close()
            raise

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Serve one board, or those in ``networks``."""
        if self._configuration is None or not isinstance(self._configuration.find("networks"), Bottle):
            super().attach(devices)
            return
        from rtf.robot.devices.remapper import ControlBoardRemapper

        remapper = ControlBoardRemapper(f"{self.name}.networks", network=self._given_network)
        try:
            remapper.open(self._configuration)
            remapper.attach(devices)
            super().attach({remapper.name: remapper})
        except Exception:
            remapper.close()
            raise
        self._remapper = remapper

    def detach(self) -> None:
        """Stop serving. The ``subdevice`` that it created is kept."""
        super().detach()
        if self._remapper is not None:
            self._remapper.close()
            self._remapper = None

    def close(self) -> None:
        super().close()
        if self._subdevice is not None:
            self._subdevice.close()
            self._subdevice = None
