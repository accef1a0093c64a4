"""The master of a ROS 1 system: who publishes and who serves what, and the parameters."""

from __future__ import annotations

import os
from typing import Any

from rtf.ros1 import xml_rpc
from rtf.ros1.errors import MasterError

#: Where the master is unless ROS_MASTER_URI says so.
DEFAULT_MASTER = "http://localhost:11311"
_SUCCESS = 1


class Master:
    """Calls of a node to its master. All methods raise MasterError, whose message says what to do."""

    def __init__(self, uri: str, node: str) -> None:
        xml_rpc.address(uri)
        self.uri = uri
        self._node = node

    def call(self, method: str, *parameters: Any) -> Any:
        """Return the value of a call; the name of the node is its first parameter."""
        return call_node(self.uri, method, self._node, *parameters)

    def pid(self) -> int:
        """Return the number of the master's process: another one is another master."""
        number = self.call("getPid")
        if not isinstance(number, int):
            raise MasterError(f"{self.uri} answered getPid with {number!r:.100}; is it a master?")
        return number

    def parameter(self, name: str) -> Any:
        """Return a parameter."""
        return self.call("getParam", name)

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter."""
        self.call("setParam", name, value)

    def has_parameter(self, name: str) -> bool:
        """Return whether there is a parameter."""
        return bool(self.call("hasParam", name))


def call_node(uri: str, method: str, *parameters: Any) -> Any:
    """Call a node or the master, and return the value. Raises MasterError, also if it says that it failed."""
    reply = xml_rpc.call(uri, method, *parameters)
    if not isinstance(reply, list | tuple) or len(reply) != 3 or not isinstance(reply[0], int):  # noqa: PLR2004 - code, sentence, value
        raise MasterError(f"{uri} answered {method} with {reply!r:.200} instead of a code, a sentence and a value")
    code, sentence, value = reply
    if code != _SUCCESS:
        raise MasterError(f"{uri} refused {method}: {sentence!s:.200}")
    return value


def master_of_environment() -> str:
    """Return the address of the master: ROS_MASTER_URI, else that of this machine."""
    return os.environ.get("ROS_MASTER_URI") or DEFAULT_MASTER


def host_of_environment() -> str:
    """Return the address of this machine for other nodes: ROS_HOSTNAME or ROS_IP, else loopback's."""
    return os.environ.get("ROS_HOSTNAME") or os.environ.get("ROS_IP") or "127.0.0.1"
