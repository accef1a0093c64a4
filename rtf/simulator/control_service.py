"""The control port of a simulated robot: status, faults and time.

It is an ordinary RPC port, ``/NAME/simulator/rpc:i``; :class:`rtf.simulator.control_client.SimulatorControl` is its
client. Replies begin with ``[ok]`` and the result, or with ``[fail]`` and a message.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab, as_float, as_list, as_string
from rtf.errors import RtfError
from rtf.middleware.carriers.local import ports_here
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.robot.errors import RefusedError
from rtf.simulator.contacts import touching
from rtf.simulator.control_client import BOARD_ENDS, CONTROL, SLOWEST, WORKS, control_port
from rtf.simulator.faults.injection import FaultInjector
from rtf.simulator.faults.kinds import KINDS, find_kind

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.simulator.faults.base import Fault
    from rtf.simulator.faults.injection import ActiveFault
    from rtf.simulator.robot import SimulatedRobot

_OK, _FAIL = Vocab("ok"), Vocab("fail")
#: The greatest number of characters of a request that a reply repeats.
_ECHO = 80
_LATELY = 1.0  # s

HELP = (
    "status                 name, time, factor and achieved factor, parts, participants, contacts, faults",
    "faults                 the kinds of faults",
    "describe KIND          target, parameters, description and symptom of a kind of fault",
    "inject KIND [TARGET] [(NAME VALUE) ...] [delay S] [duration S]",
    "                       inject a fault; the reply is its number",
    "clear [NUMBER]         clear a fault, or all; the reply is how many",
    "active                 the injected faults: number, kind, target, whether it has begun, begin, end",
    "contacts               the pairs of links that are in contact",
    "serves [PART]          the addresses of this port and of a part's board: groups of name, host and port number",
    "pause, continue        stop the time, and continue it",
    "step S                 advance the paused time by S seconds",
    "reset                  reset the robot: at home, at rest and healthy; the time is not reset",
    "factor F               the greatest real-time factor; inf: no limit",
    "quit                   end the program",
)


class SimulatorService:
    """Server of a robot's control port. ``end`` is called, in any thread, for a request to quit."""

    def __init__(self, robot: SimulatedRobot, *, network: Network, end: Callable[[], object]) -> None:
        self.robot = robot
        self.injector = FaultInjector(robot)
        self._network = network
        self._end = end
        self._speed = _Speed()
        self._requests: dict[str, Callable[[Bottle], object]] = {
            "status": self._status,
            "faults": lambda _: Bottle([_OK, *KINDS]),
            "describe": self._describe,
            "inject": self._inject,
            "clear": self._clear,
            "active": lambda _: Bottle([_OK, *self._faults()]),
            "contacts": lambda _: Bottle([_OK, *self._contacts()]),
            "serves": self._serves,
            **dict.fromkeys(("pause", "continue", "step", "reset"), self._ask_clock),
            "factor": self._factor,
            "quit": self._quit,
            "help": lambda _: Bottle([Vocab("many"), *HELP]),
        }
        self.port = RpcServer(control_port(robot.name), self.answer, network=network)

    def close(self) -> None:
        """Close the port."""
        self.port.close()

    def answer(self, request: Bottle) -> object:
        """Return the reply to a request. May be called in any thread."""
        word = as_string(request.get(0))
        asked = self._requests.get(word)
        try:
            if asked is None:
                raise RefusedError(f"{word[:_ECHO]!r} is not a request; the requests are {', '.join(self._requests)}")
            return asked(request)
        except RtfError as error:
            return Bottle([_FAIL, str(error)])

    # Status ------------------------------------------------------------------------------------------------------

    def _status(self, _request: Bottle) -> Bottle:
        simulation, time = self.robot.simulation, self.robot.clock
        # The clock has a lock of its own, which must not be taken with the simulation's lock held: the clock takes them
        # in the other order.
        participants = [Bottle([one.name, WORKS if one.until is None else one.until]) for one in time.participants]
        with simulation.lock:
            now = simulation.now
        factor = math.inf if simulation.factor is None else simulation.factor
        broken = "" if time.broken is None else f"{type(time.broken).__name__}: {time.broken}"
        return Bottle(
            [
                _OK,
                Bottle(["name", self.robot.name]),
                Bottle(["time", now]),
                Bottle(["factor", factor]),
                Bottle(["achieved", self._speed.at(now)]),
                Bottle(["lockstep", int(self.robot.lockstep)]),
                Bottle(["clock", time.name]),
                Bottle(["parts", *self.robot.parts]),
                Bottle(["participants", *participants]),
                Bottle(["contacts", *self._contacts()]),
                Bottle(["faults", *self._faults()]),
                Bottle(["broken", broken]),
            ]
        )

    def _serves(self, request: Bottle) -> Bottle:
        """Return the addresses of ports of this process, as registrations can be stale or those of another robot."""
        wanted = [self.port.name]
        if len(request) > 1:
            part, known = _word(request.get(1), "serves: the part"), self.robot.parts
            if part not in known:
                raise RefusedError(f"serves: this robot has no part {part[:_ECHO]!r}; its parts are {', '.join(known)}")
            begin = self.port.name.removesuffix(CONTROL)  # the network may have added a prefix to the robot's name
            wanted += [f"{begin}/{part}/{end}" for end in BOARD_ENDS]
        here = [port.contact for port in ports_here() if port.name in wanted]
        return Bottle([_OK, *(Bottle([contact.name, contact.host, contact.port]) for contact in here)])

    def _contacts(self) -> list[Bottle]:
        simulation = self.robot.simulation
        with simulation.lock:
            return [Bottle(pair) for pair in touching(simulation.plant.model, simulation.data)]

    def _faults(self) -> list[Bottle]:
        return [_of_fault(one) for one in self.injector.active]

    # Faults ------------------------------------------------------------------------------------------------------

    def _describe(self, request: Bottle) -> Bottle:
        return Bottle([_OK, *describe(find_kind(_word(request.get(1), "describe: the kind")))])

    def _inject(self, request: Bottle) -> Bottle:
        kind = _word(request.get(1), "inject: the kind")
        target, values, times = "", {}, {"delay": 0.0, "duration": math.inf}
        words = list(request)[2:]
        while words:
            word = words.pop(0)
            pair = as_list(word)
            if pair is not None:
                if len(pair) != 2:  # noqa: PLR2004 - a name and a value
                    raise RefusedError(f"inject: write (NAME VALUE), not {pair.to_text()[:_ECHO]}")
                values[_word(pair.get(0), "inject: a parameter")] = _number(pair.get(1), "inject: a parameter")
            elif isinstance(word, str) and word in times:
                times[word] = _number(words.pop(0) if words else None, f"inject: {word}")
            elif target:
                raise RefusedError(
                    f"inject: a fault has one target, {target}; there is another word, {str(word)[:_ECHO]!r}"
                )
            else:
                target = _word(word, "inject: the target")
        return Bottle([_OK, self.injector.inject(kind, target, values, **times)])

    def _clear(self, request: Bottle) -> Bottle:
        number = request.get(1)
        if number is not None and not isinstance(number, int):
            raise RefusedError(f"clear: {str(number)[:_ECHO]!r} is not the number of a fault; 'active' lists them")
        return Bottle([_OK, self.injector.clear(number)])

    # Time --------------------------------------------------------------------------------------------------------

    def _ask_clock(self, request: Bottle) -> object:
        """Pass a request on to the clock."""
        with RpcClient("", self.robot.clock.name, network=self._network) as client:
            return client.call(request)

    def _factor(self, request: Bottle) -> Bottle:
        factor = _number(request.get(1), "factor")
        if not factor >= SLOWEST:
            raise RefusedError(f"factor: it must be {SLOWEST:g} or more, not {factor:g}; 'pause' stops the time")
        simulation = self.robot.simulation
        with simulation.lock:
            simulation.pace(None if factor == math.inf else factor)
        return Bottle([_OK])

    def _quit(self, _request: Bottle) -> Bottle:
        self._end()
        return Bottle([_OK])


class _Speed:
    """The achieved real-time factor: over the requests of the last second, or since the last request."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seen = deque([(clock.monotonic(), 0.0)], maxlen=100)

    def at(self, now: float) -> float:
        """Return the simulated seconds that have passed for a second of the machine's clock."""
        with self._lock:
            machine, seen = clock.monotonic(), self._seen
            seen.append((machine, now))
            while len(seen) > 2 and seen[1][0] < machine - _LATELY:  # noqa: PLR2004 - a beginning and an end
                seen.popleft()
            began, then = seen[0]
        return (now - then) / max(machine - began, 1e-6)


def describe(kind: type[Fault]) -> list[Bottle]:
    """Return the facts of a kind of fault, as groups."""
    parameters = [
        Bottle([one.name, one.default, one.unit, one.description, one.minimum, one.maximum]) for one in kind.parameters
    ]
    return [
        Bottle(["kind", kind.kind]),
        Bottle(["layer", kind.layer.value]),
        Bottle(["target", kind.target_kind.value]),
        Bottle(["description", kind.description]),
        Bottle(["symptom", kind.symptom]),
        Bottle(["parameters", *parameters]),
    ]


def _of_fault(one: ActiveFault) -> Bottle:
    return Bottle([one.number, one.fault.kind, one.fault.target, int(one.running), one.begins, one.ends])


def _word(value: Value | None, what: str) -> str:
    if not isinstance(value, str):
        raise RefusedError(f"{what} must be a word, not {'nothing' if value is None else str(value)[:_ECHO]}")
    return value


def _number(value: Value | None, what: str) -> float:
    if not isinstance(value, int | float):
        raise RefusedError(f"{what} must be a number, not {'nothing' if value is None else str(value)[:_ECHO]}")
    return as_float(value)
