"""Base class of sensor clients: the latest message of a stream, and perhaps a connection for requests."""

from __future__ import annotations

import threading
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from rtf.errors import RtfError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.rpc import RpcClient
from rtf.robot import parameters
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError
from rtf.robot.interfaces import SensorStatus
from rtf.robot.network.client_settings import RPC_TIMEOUT, unique_local
from rtf.robot.network.latest_message import LatestMessage

if TYPE_CHECKING:
    from rtf.bottle import Bottle, Property
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec

T = TypeVar("T")


class RpcConnection:
    """A client port of the RPC port ``server``, which reconnects after a lost connection.

    ``patience`` is the timeout of a reply in seconds of real time. Raises DeviceError if there is no server.
    """

    def __init__(self, name: str, server: str, *, patience: float, network: Network) -> None:
        self.server = server
        self._patience = patience
        self._lock = threading.Lock()
        try:
            self._client = RpcClient(name, server, network=network)
        except MiddlewareError as error:
            raise DeviceError(f"{name} cannot be connected to {server}: {error}; is its robot running?") from error

    def ask(self, request: object) -> Bottle:
        """Send a request and return the reply. Raises NoAnswerError if there is none, or an invalid one."""
        try:
            with self._lock:
                if not self._client.outputs:
                    self._client.add_output(self.server)
            answer = self._client.call(request, timeout=self._patience)
        except RtfError as error:
            raise NoAnswerError(f"{self.server} does not answer: {error}") from error
        if answer is None:
            raise NoAnswerError(f"{self.server} gave no answer")
        return answer

    def close(self) -> None:
        """Close the port."""
        self._client.close()


class StreamClient(Device, Generic[T]):
    """A device of a configuration whose measurements are the messages of the server ``remote``.

    ``local`` is the prefix of the client's own ports (default: a unique one), ``carrier`` the carrier of the stream,
    ``timeout`` the greatest age of a message, in seconds of the robot's clock.
    """

    #: The codec of the messages. ``lazily``: see LatestMessage.
    codec: ClassVar[Codec[Any]]
    lazily: ClassVar[bool] = True
    #: The defaults of the parameters.
    carrier: ClassVar[str] = "tcp"
    timeout: ClassVar[float] = 0.1
    #: The endings of the ports of the stream, here and at the server, and those of the requests; None: there are none.
    ends: ClassVar[tuple[str, str]] = ("", "")
    rpc_ends: ClassVar[tuple[str, str] | None] = None

    _stream: LatestMessage[T] | None = None
    _rpc: RpcConnection | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """See Device. The server must be running."""
        remote = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(remote))
        timeout = parameters.positive(configuration, "timeout", self.timeout)
        carrier = parameters.carrier(configuration, self.carrier)
        self.configure(configuration)
        here, there = self.ends
        with ExitStack() as opened:
            stream = self.open_stream(f"{local}{here}", timeout)
            if stream is not None:
                opened.enter_context(closing(stream))
            rpc = self.connect_rpc(local, remote)
            if rpc is not None:
                opened.enter_context(closing(rpc))
            if stream is not None:
                self.connect_stream(stream, f"{remote}{there}", carrier)
            self._stream, self._rpc, self._opened = stream, rpc, opened.pop_all()

    def configure(self, configuration: Property) -> None:
        """Read the other parameters of this type of sensor. Raises ConfigurationError."""

    def open_stream(self, name: str, timeout: float) -> LatestMessage[T] | None:
        """Return the port of the stream, None if there is no stream. Raises DeviceError."""
        return LatestMessage(name, self.codec, timeout=timeout, network=self.network, lazily=self.lazily)

    def connect_rpc(self, local: str, remote: str) -> RpcConnection | None:
        """Return the connection for requests. Raises DeviceError."""
        if self.rpc_ends is None:
            return None
        here, there = self.rpc_ends
        return RpcConnection(f"{local}{here}", f"{remote}{there}", patience=RPC_TIMEOUT, network=self.network)

    def connect_stream(self, stream: LatestMessage[T], source: str, carrier: str) -> None:
        """Connect the stream of the server. Raises DeviceError."""
        stream.connect(source, carrier)

    def close(self) -> None:
        self._stream = self._rpc = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    @property
    def stream(self) -> LatestMessage[T]:
        """The stream. Raises DeviceError while the device is not open."""
        if self._stream is None:
            raise self.not_open()
        return self._stream

    @property
    def rpc(self) -> RpcConnection:
        """The connection for requests. Raises DeviceError while the device is not open."""
        if self._rpc is None:
            raise self.not_open()
        return self._rpc

    def stream_status(self) -> SensorStatus:
        """Return the status of the stream, which is that of all its sensors."""
        age = self.stream.age()
        if age is None:
            return SensorStatus.WAITING_FOR_FIRST_READ
        return SensorStatus.TIMEOUT if age > self.stream.timeout else SensorStatus.OK

    def not_open(self) -> DeviceError:
        """Return the error for a use of the device while it is not open."""
        return DeviceError(f"{self.name} is not open")
