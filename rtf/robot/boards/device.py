"""The devices of a robot interface that serve a control board, or several as one, on ports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Dialect, Property
from rtf.middleware.errors import MiddlewareError
from rtf.robot.boards.server import DEFAULT_PERIOD, ControlBoardServer
from rtf.robot.device import Device, make_device
from rtf.robot.errors import DeviceError
from rtf.robot.parameters import flag, port_name, positive
from rtf.robot.periodic_thread import PeriodicThread

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.ports.network import Network


class ControlBoardDevice(Device):
    """``controlBoard_nws_yarp``: serves the device that it is attached to, with a thread of its own.

    Parameters: ``name``, the prefix of its ports, ``period`` in seconds, and ``service``, yes or no: whether it speaks
    YARP 4's protocol. The default follows the dialect of the network.
    """

    _unit = 1.0  # seconds

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        super().__init__(name, network=network)
        self._prefix = ""
        self._period = DEFAULT_PERIOD
        self._protocols: tuple[Dialect, ...] = ()
        self._server: ControlBoardServer | None = None
        self._thread: PeriodicThread | None = None

    def open(self, configuration: Property) -> None:
        self._prefix = port_name(configuration, "name")
        self._period = positive(configuration, "period", DEFAULT_PERIOD / self._unit) * self._unit
        if configuration.check("service"):
            self._protocols = (Dialect.YARP4 if flag(configuration, "service") else Dialect.YARP3,)

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Serve one board."""
        if len(devices) != 1:
            raise DeviceError(f"{self.name} serves one device, not {len(devices)} ({', '.join(devices)})")
        self._serve(*devices.values())

    def _serve(self, device: Device) -> None:
        if self._server is not None:
            raise DeviceError(f"{self.name} serves a device already; detach it first")
        try:
            self._server = ControlBoardServer(
                device, self._prefix, network=self.network, period=self._period, protocols=self._protocols
            )
        except MiddlewareError as error:
            raise DeviceError(f"{self.name} cannot open its ports: {error}") from error
        report = self.network.report
        self._thread = PeriodicThread(
            self._server, name=self._prefix, report=lambda text: report(f"{self.name}: {text}")
        )

    def detach(self) -> None:
        if self._thread is not None:
            self._thread.stop()
        if self._server is not None:
            self._server.close()
        self._thread = self._server = None

    def close(self) -> None:
        self.detach()


class ControlBoardWrapperDevice(ControlBoardDevice):
    """``controlboardwrapper2``, the older type: its period is in milliseconds, and it can combine several boards.

    With ``networks`` and ``joints`` it serves the attached boards as a :class:`ControlBoardRemapper` of them; with
    ``subdevice`` a device of that type, which it creates with the same configuration.
    """

    _unit = 0.001  # milliseconds

    def __init__(self, name: str = "", *, network: Network | None = None) -> None:
        super().__init__(name, network=network)
        self._configuration = Property()
        self._own: Device | None = None

    def open(self, configuration: Property) -> None:
        super().open(configuration)
        self._configuration = configuration
        subdevice = configuration.find("subdevice")
        if isinstance(subdevice, str):
            self._own = make_device(
                subdevice, configuration, name=f"{self.name}.{subdevice}", network=self._given_network
            )
            try:
                self._serve(self._own)
            except Exception:
                self.close()
                raise

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Serve one board, or those in ``networks``."""
        if not isinstance(self._configuration.find("networks"), Bottle):
            super().attach(devices)
            return
        from rtf.robot.devices.remapper import ControlBoardRemapper

        remapper = ControlBoardRemapper(f"{self.name}.networks", network=self._given_network)
        remapper.open(self._configuration)
        try:
            remapper.attach(devices)
            self._serve(remapper)
        except Exception:
            remapper.close()
            raise
        self._own = remapper

    def detach(self) -> None:
        """Stop serving. The ``subdevice`` that it created is kept."""
        super().detach()
        if self._own is not None and not self._configuration.check("subdevice"):
            self._own.close()
            self._own = None

    def close(self) -> None:
        super().close()
        if self._own is not None:
            self._own.close()
            self._own = None
