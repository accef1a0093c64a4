"""The monitors of a port: one at each connection that asks for it, and one for all that comes in, or goes out."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from rtf.middleware.ports import monitoring
from rtf.middleware.wire import modifiers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rtf.middleware.monitors.attached import Attached
    from rtf.middleware.monitors.script import ScriptName
    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.outputs import Output
    from rtf.middleware.wire.contact import Contact
    from rtf.middleware.wire.incoming_message import IncomingMessage


class PortMonitors:
    """Loads the monitors of a port, and has them look at its messages. ``report`` gets their errors."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._whole: dict[str, Attached] = {}  # of all inputs ("in") and all outputs ("out")
        self._lock = threading.Lock()

    def at_output(self, output: Output, port: str, target: Contact) -> None:
        """Load the monitor that a new connection names. Raises ConnectError."""
        name = monitoring.of_connection(modifiers.read(modifiers.split(target.carrier)[1]), "send")
        if name is not None:
            output.monitor = monitoring.attach(
                name, self._report, source=port, destination=target.name, carrier=target.carrier, sends=True
            )

    def at_input(self, caller: Input, port: str) -> None:
        """Load the monitor that the modifiers of an incoming connection name. Raises ProtocolError."""
        assert caller.link is not None
        caller.monitor = monitoring.at_input(
            caller.link.modifiers, self._report, source=caller.sender, destination=port, carrier=caller.carrier
        )

    def attach(self, way: str, name: ScriptName | None, port: str) -> Attached | None:
        """Have a script look at all messages in a direction; None ends that. Return the one before, to be ended.

        Raises ConnectError.
        """
        source, destination = (port, "") if way == "out" else ("", port)
        attached = None
        if name is not None:
            attached = monitoring.attach(
                name, self._report, source=source, destination=destination, carrier="", sends=way == "out"
            )
        with self._lock:
            before = self._whole.pop(way, None)
            if attached is not None:
                self._whole[way] = attached
        return before

    def of(self, way: str) -> Attached | None:
        """The script that looks at all messages in a direction."""
        return self._whole.get(way)

    def deliver(
        self,
        delivery: IncomingMessage,
        caller: Input,
        port: str,
        *,
        others: Callable[[], Iterable[Attached]],
        deliver: Callable[[IncomingMessage], None],
    ) -> IncomingMessage | None:
        """Deliver what the monitors make of a message; None if they drop it. ``others`` are those of all inputs."""
        monitors = [one for one in (self._whole.get("in"), caller.monitor) if one is not None]
        passed = monitoring.incoming(delivery, monitors, others)
        if passed is None:
            return None
        deliver(passed)
        if passed.answer:
            monitoring.reply(passed, port, monitors)
        return passed

    def end(self) -> None:
        """End those that look at all messages; those of connections end with them."""
        for one in self._whole.values():
            one.end()
