"""Client of a running simulator: the requests of its control port ``/NAME/simulator/rpc:i`` as methods."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from rtf.bottle import Bottle, Vocab, as_bool, as_float, as_int, as_list, as_string
from rtf.middleware.errors import ConnectError, MiddlewareError
from rtf.middleware.ports.network import default_network
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types.service import succeeded
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import RefusedError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType

    from rtf.middleware.ports.network import Network

_OK, _FAIL = Vocab("ok"), Vocab("fail")
#: The least real-time factor: a slower simulator could not be told from one that hangs.
SLOWEST = 0.1
#: The status of a participant that does not wait for a time.
WORKS = "works"
#: Suffix of the control port, and suffixes of the ports by which a board gets commands.
CONTROL = "/simulator/rpc:i"
BOARD_ENDS = ("rpc:i", "nws/rpc:i", "command:i")


def control_port(name: str) -> str:
    """Return the control port of a robot's simulator."""
    return f"/{name.strip('/')}{CONTROL}"


@dataclass(frozen=True, slots=True)
class FaultStatus:
    """An injected fault: its begin and end (s), and whether it has begun."""

    number: int
    kind: str
    target: str
    running: bool
    begins: float
    ends: float


@dataclass(frozen=True, slots=True)
class SimulatorStatus:
    """The status of a simulator.

    ``factor`` is the greatest real-time factor, and ``achieved`` the recent one. ``participants`` of the lockstep have
    a name and the time they wait for, None while they work. ``broken`` is the error that has stopped the time; it is
    empty in a healthy simulator.
    """

    name: str
    time: float
    factor: float
    achieved: float
    lockstep: bool
    clock: str
    parts: tuple[str, ...]
    participants: tuple[tuple[str, float | None], ...]
    contacts: tuple[tuple[str, str], ...]
    faults: tuple[FaultStatus, ...]
    broken: str

    @classmethod
    def of(cls, reply: Bottle) -> Self:
        """Decode a reply."""
        return cls(
            name=as_string(reply.find("name")),
            time=as_float(reply.find("time")),
            factor=as_float(reply.find("factor")),
            achieved=as_float(reply.find("achieved")),
            lockstep=as_bool(reply.find("lockstep")),
            clock=as_string(reply.find("clock")),
            parts=tuple(as_string(part) for part in _group(reply, "parts")),
            participants=tuple(_participant(one) for one in _lists(_group(reply, "participants"))),
            contacts=tuple(_pair(one) for one in _lists(_group(reply, "contacts"))),
            faults=tuple(_fault(one) for one in _lists(_group(reply, "faults"))),
            broken=as_string(reply.find("broken")),
        )


class SimulatorControl:
    """Client of a robot's simulator. It connects at the first request, and again after a lost connection.

    All methods raise RefusedError, with the simulator's message, for a refused request, and MiddlewareError if there is
    no answer within ``patience`` seconds. Not thread-safe.
    """

    def __init__(self, name: str = "icubSim", *, network: Network | None = None, patience: float = 10.0) -> None:
        self.port = control_port(name)
        self._network = network or default_network()
        self._patience = patience
        self._client: RpcClient | None = None

    def status(self) -> SimulatorStatus:
        """Return the status."""
        return SimulatorStatus.of(self.ask("status"))

    def serves(self, part: str = "") -> tuple[Contact, ...]:
        """Return the addresses of its control port and, with a part, of the ports by which that part gets commands."""
        reply = self.ask("serves", *([part] if part else []))
        return tuple(Contact(as_string(one.get(0)), as_string(one.get(1)), as_int(one.get(2))) for one in _lists(reply))

    def faults(self) -> tuple[str, ...]:
        """Return the kinds of faults."""
        return tuple(as_string(kind) for kind in self.ask("faults"))

    def inject(
        self,
        kind: str,
        target: str = "",
        values: Mapping[str, float] | None = None,
        *,
        delay: float = 0.0,
        duration: float = math.inf,
    ) -> int:
        """Inject a fault ``delay`` seconds from now for ``duration`` seconds; return its number.

        Raises ConnectError for a fault that ends the program at once, as there is no answer.
        """
        words: list[object] = ["inject", kind, *([target] if target else [])]
        words += [Bottle([name, float(value)]) for name, value in (values or {}).items()]
        words += ["delay", float(delay), "duration", float(duration)]
        return as_int(self.ask(*words).get(0))

    def clear(self, number: int | None = None) -> int:
        """Remove one fault, or all; return how many were removed."""
        return as_int(self.ask("clear", *([] if number is None else [number])).get(0))

    def active(self) -> tuple[FaultStatus, ...]:
        """Return the injected faults that have not ended."""
        return tuple(_fault(one) for one in _lists(self.ask("active")))

    def contacts(self) -> tuple[tuple[str, str], ...]:
        """Return the pairs of links that are in contact."""
        return tuple(_pair(one) for one in _lists(self.ask("contacts")))

    def pause(self) -> float:
        """Stop the time until ``resume``; return the time."""
        return as_float(self.ask("pause").get(0))

    def resume(self) -> float:
        """Let time pass again; return the time."""
        return as_float(self.ask("continue").get(0))

    def step(self, seconds: float) -> float:
        """Advance the paused time by ``seconds``, and wait for that; return the time."""
        return as_float(self.ask("step", float(seconds), timeout=None).get(0))

    def reset(self) -> float:
        """Reset the robot: at home, at rest and healthy. Return the time, which is not reset."""
        return as_float(self.ask("reset").get(0))

    def restore(self, factor: float) -> None:
        """Clear all faults, let the time pass again with a greatest real-time factor, and reset the robot."""
        self.clear()
        self.set_factor(factor)
        self.resume()
        self.reset()

    def set_factor(self, factor: float) -> None:
        """Set the greatest real-time factor; ``inf``: as fast as possible."""
        self.ask("factor", float(factor))

    def quit(self) -> None:
        """End the program."""
        self.ask("quit")

    def ask(self, *words: object, timeout: float | None = -1.0) -> Bottle:
        """Send a request in the protocol of the port; return the reply after ``[ok]``.

        ``timeout`` None: wait for ever.
        """
        if self._client is not None and not self._client.outputs:
            self.close()  # the simulator has closed the connection
        try:
            if self._client is None:
                self._client = RpcClient("", self.port, network=self._network)
            reply = self._client.call(Bottle(words), timeout=self._patience if timeout == -1.0 else timeout)
        except MiddlewareError:
            self.close()
            raise
        if reply is None or not succeeded(reply):
            raise RefusedError(as_string((reply or Bottle()).get(1)) or f"{self.port} gave no answer to {words[0]}")
        if reply.get(0) != _OK:
            self.close()
            raise ConnectError(f"{self.port} is not the control port of a simulator: it answers {reply.to_text()[:80]}")
        return reply.tail()

    def close(self) -> None:
        """Close the connection. The simulator goes on."""
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def describe_status(status: SimulatorStatus) -> str:
    """Return the status as text, in complete lines."""
    pace = "lockstep" if status.lockstep else f"factor {status.factor:g}"
    lines = [
        f"{status.name} at {status.time:.3f} s, {pace}, {status.achieved:.2f} s pass a second of the machine's clock",
        f"clock         {status.clock}",
        f"parts         {' '.join(status.parts)}",
    ]
    for name, until in status.participants:
        lines.append(f"participant   {name} {'works' if until is None else f'waits until {until:.3f} s'}")
    lines += [f"contact       {first} {second}" for first, second in status.contacts]
    for one in status.faults:
        end = "" if one.ends == math.inf else f" to {one.ends:.3f} s"
        state = "running" if one.running else "to come"
        lines.append(f"fault {one.number:<7} {one.kind} {one.target} {state}, from {one.begins:.3f} s{end}")
    lines += [f"TIME ENDED    {status.broken}"] if status.broken else []
    return "".join(f"{line}\n" for line in lines)


# Reading answers -------------------------------------------------------------------------------------------------


def _group(reply: Bottle, key: str) -> Bottle:
    found = reply.find_group(key)
    return Bottle() if found is None else found.tail()


def _lists(items: Bottle) -> list[Bottle]:
    return [found for found in map(as_list, items) if found is not None]


def _participant(one: Bottle) -> tuple[str, float | None]:
    until = one.get(1)
    return as_string(one.get(0)), None if until == WORKS else as_float(until)


def _pair(one: Bottle) -> tuple[str, str]:
    return as_string(one.get(0)), as_string(one.get(1))


def _fault(one: Bottle) -> FaultStatus:
    number, kind, target, running, begins, ends = (one.get(index) for index in range(6))
    return FaultStatus(
        as_int(number), as_string(kind), as_string(target), as_bool(running), as_float(begins), as_float(ends)
    )
