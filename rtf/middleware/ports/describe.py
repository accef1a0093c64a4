"""Text commands that a port answers, such as ``*`` and ``?``, and the commands that only change connections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from rtf.errors import RtfError
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Property
    from rtf.middleware.monitors.attached import Attached
    from rtf.middleware.monitors.script import ScriptName
    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.network import Network
    from rtf.middleware.ports.outputs import Output


class AdministeredPort(Protocol):
    """A port that can be described, and whose connections can be changed."""

    @property
    def name(self) -> str: ...
    @property
    def contact(self) -> Contact: ...
    @property
    def network(self) -> Network: ...
    @property
    def inputs(self) -> Sequence[Input]: ...
    @property
    def outputs(self) -> Sequence[Output]: ...
    @property
    def properties(self) -> Property: ...
    @property
    def allows_inputs(self) -> bool: ...
    @property
    def allows_outputs(self) -> bool: ...
    @property
    def rpc(self) -> bool: ...
    @property
    def promise(self) -> str: ...

    def add_output(self, target: str | Contact, carrier: str = "") -> Contact:
        """Connect to a port."""

    def remove_output(self, name: str) -> bool:
        """End the output to a port. Return False if there is none."""

    def remove_input(self, name: str) -> bool:
        """End the inputs from a port. Return False if there is none."""

    def attach_monitor(self, way: str, name: ScriptName | None) -> bool:
        """Have a script look at all messages ``in`` or ``out``; None ends that. Return whether there was one."""

    def port_monitor(self, way: str) -> Attached | None:
        """Return the script that does."""


_HELP = (
    "Commands of this port, one per line:",
    "  d            data for its owner follow on the next line; it may reply",
    "  D            the same, without a reply",
    "  a            an admin command follows on the next line, such as [help]",
    "  /name        send output to a port, also as carrier:/name",
    "  !/name       send no more output to a port",
    "  ~/name       take no more input from a port",
    "  r            reverse this connection: the port sends to it from now on",
    "  *            what this port is connected to",
    "  q            end this connection",
    "  ?            this text",
)
_UNKNOWN = ("Port command not understood.", "Type d to send data to the port's owner.", "Type ? for help.")

#: The reply to a caller that may not change connections.
NOT_ALLOWED = "Not allowed: this port takes such commands only from the machines in its settings."
_UNREACHABLE = "Cannot connect to "


def changes(key: str, text: str) -> bool:
    """Return whether a text command makes or ends connections."""
    return key in ("/", "!", "~") or ":/" in text


def answer(port: AdministeredPort, key: str, text: str) -> str:
    """Execute a command that is neither data nor an admin request. Return the lines of the reply."""
    if key == "*":
        lines: tuple[str, ...] = tuple(connections(port))
    elif key in ("?", "h"):
        lines = _HELP
    elif key == "/" or ":/" in text:
        lines = (add(port, text),)
    elif key == "!":
        lines = (remove_output(port, text[1:]),)
    elif key == "~":
        lines = (remove_input(port, text[1:]),)
    else:
        lines = _UNKNOWN
    return "".join(f"{line}\r\n" for line in lines)


def connections(port: AdministeredPort) -> list[str]:
    """Return the port's address and connections, one per line."""
    lines = [f"This is {port.name} at {port.contact.by('tcp')}"]
    outputs, inputs = port.outputs, port.inputs
    lines += [
        f"There is an output connection from {port.name} to {output.peer} using {output.carrier}" for output in outputs
    ] or ["There are no outgoing connections"]
    lines += [
        f"There is an input connection from {caller.peer} to {port.name} using {caller.carrier}" for caller in inputs
    ] or ["There are no incoming connections"]
    return lines


def add(port: AdministeredPort, target: str, carrier: str = "") -> str:
    """Connect an output. Return the result in YARP's words."""
    try:
        contact = Contact.parse(target)
        wanted = contact.by(carrier or contact.carrier)
        port.add_output(wanted)
    except RtfError as error:
        text = str(error)
        if not text.startswith(_UNREACHABLE):
            return text
        port.network.report(text)  # YARP's programs compare this text without the reason, which is reported here
        return text.partition(": ")[0]
    return f"Added connection from {port.name} to {target if not carrier else f'{carrier}:/{contact.name}'}"


def remove_output(port: AdministeredPort, name: str) -> str:
    """Disconnect an output. Return the result in YARP's words."""
    if port.remove_output(name):
        return f"Removed connection from {port.name} to {name}"
    return f"Could not find an outgoing connection to {name}"


def remove_input(port: AdministeredPort, name: str) -> str:
    """Disconnect an input. Return the result in YARP's words."""
    if port.remove_input(name):
        return f"Removing connection from {name} to {port.name}"
    return f"Could not find an incoming connection from {name}"
