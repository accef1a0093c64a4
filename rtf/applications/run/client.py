"""The client of a node, ours or YARP's: each request has a port and a connection of its own, as YARP's client."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rtf.applications.run.errors import NodeError
from rtf.applications.run.protocol import Ask, Ending, Kill, Running, Start, StartReply
from rtf.applications.run.sysinfo import SystemInfo
from rtf.bottle import as_string, to_string
from rtf.middleware.errors import MiddlewareError, NameNotFoundError
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types.codecs import BOTTLE

if TYPE_CHECKING:
    from rtf.applications.run.protocol import Request
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec
    from rtf.middleware.wire.contact import Contact

#: Seconds that a node may take to answer: it may have to start a large program.
TIMEOUT = 10.0


class RunClient:
    """Asks a node. Every method raises NodeError if the node cannot be reached, does not answer, or not as a node."""

    def __init__(self, node: str | Contact, *, network: Network, timeout: float = TIMEOUT) -> None:
        self._node = node
        self._network = network
        self._timeout = timeout

    @property
    def name(self) -> str:
        """The name of the node."""
        return self._node if isinstance(self._node, str) else self._node.name

    def start(self, request: Start) -> StartReply:
        """Start a program. The reply says whether it has been started."""
        return StartReply.read(self.ask(request))

    def kill(self, tag: str, signum: int) -> bool:
        """Send a signal to the programs of a tag. False if there is none."""
        return self._text(Kill(tag, signum)) == "kill OK"

    def terminate(self, tag: str) -> bool:
        """Ask the programs of a tag to end. False if there is none."""
        return self._text(Ask("sigterm", tag)) == "sigterm OK"

    def terminate_all(self) -> None:
        """Ask all programs to end."""
        self.ask(Ask("sigtermall"))

    def running(self) -> list[Running]:
        """Return the programs of the node."""
        return [Running.read(row) for row in self.ask(Ask("ps"))]

    def is_running(self, tag: str) -> bool:
        """Return whether a program of this tag runs."""
        return self._text(Ask("isrunning", tag)) == "running"

    def ending(self, tag: str) -> Ending | None:
        """Return how the last program of a tag has ended. Only RTF's nodes answer; YARP's raise NodeError."""
        return Ending.read(self.ask(Ask("ended", tag)))

    def output(self, tag: str) -> list[str]:
        """Return the last lines of a program of a tag. Only RTF's nodes answer; YARP's raise NodeError."""
        return [*map(as_string, self.ask(Ask("output", tag)))]

    def close_terminal(self, tag: str) -> None:
        """Ask the node to close the terminal that it has opened for a program."""
        self.ask(Ask("killstdio", tag))

    def which(self, program: str) -> str:
        """Return the path of a program on the node, or the program if it is not on its PATH."""
        return self._text(Ask("which", program))

    def system_info(self) -> SystemInfo:
        """Return the figures of the node's machine."""
        found = self.ask(Ask("sysinfo"), SystemInfo.codec)
        assert isinstance(found, SystemInfo)
        return found

    def exit(self) -> None:
        """Ask the node to end, with all its programs that are not held."""
        self.ask(Ask("exit"))

    def _text(self, request: Request) -> str:
        first = self.ask(request).get(0)
        return as_string(first) or to_string(first)

    def ask(self, request: Request, answer: Codec[Any] = BOTTLE) -> Any:  # Any: what the codec reads
        """Send a request and return the reply."""
        try:
            with RpcClient("", self._node, network=self._network) as port:
                reply = port.call(request.to_bottle(), codec=BOTTLE, answer=answer, timeout=self._timeout)
        except NameNotFoundError:
            raise NodeError(f"there is no node {self.name}; 'rtf name runners' lists them") from None
        except MiddlewareError as error:
            raise NodeError(f"the node {self.name} did not answer: {error}") from None
        if reply is None:
            raise NodeError(f"{self.name} gives no answers; is it a node? 'rtf name runners' lists them")
        return reply
