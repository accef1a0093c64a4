"""The control port of a simulated robot: how it is, what is broken in it, and how its time passes.

It is an ordinary RPC port, ``/NAME/simulator/rpc:i``; :class:`rtf.simulator.control.SimulatorControl` asks it. What
works is answered with ``[ok]`` and what was asked for, everything else with ``[fail]`` and a sentence.
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
from rtf.middleware.rpc import RpcClient, RpcServer
from rtf.robot.errors import RefusedError
from rtf.simulator.contacts import touching
from rtf.simulator.control import BOARD_ENDS, CONTROL, SLOWEST, WORKS, control_port
from rtf.simulator.faults.injection import FaultInjector
from rtf.simulator.faults.kinds import KINDS, find_kind

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.bottle import Value
    from rtf.middleware.network import Network
    from rtf.simulator.faults.base import Fault
    from rtf.simulator.faults.injection import ActiveFault
    from rtf.simulator.icub import SimulatedIcub

_OK, _FAIL = Vocab("ok"), Vocab("fail")
#: Letters of a stranger's words that are said again in an answer.
_ECHO = 80
_LATELY = 1.0  # s

HELP = (
    "status                 name, time, factor and what was achieved of it, parts, participants, contacts, faults",
    "faults                 the kinds of faults",
    "describe KIND          what it strikes, its parameters, what it means and how it shows",
    "inject KIND [TARGET] [(NAME VALUE) ...] [delay S] [duration S]",
    "                       put a fault in; the answer is its number",
    "clear [NUMBER]         take a fault out, or all; the answer is how many",
    "active                 the faults that are there: number, kind, target, whether it runs, from when, until when",
    "contacts               the pairs of links that touch now",
    "serves [PART]          where this port listens, and those of a part's board: groups of name, host and number",
    "pause, continue        stop the time, and let it pass again",
    "step S                 let so many seconds pass while it is paused",
    "reset                  put the robot to its home, at rest and healthy; time goes on",
    "factor F               how many times faster than the machine's clock time passes at most; inf: no bound",
    "quit                   end the program",
)


class SimulatorService:
    """Answers at the control port of a robot. ``end`` is called when somebody asks it to quit, in any thread."""

    def __init__(self, robot: SimulatedIcub, *, network: Network, end: Callable[[], object], lockstep: bool) -> None:
        self.robot = robot
        self.injector = FaultInjector(robot)
        self._network = network
        self._lockstep = lockstep
        self._end = end
        self._speed = _Speed()
        self._questions: dict[str, Callable[[Bottle], object]] = {
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
        """Answer no more."""
        self.port.close()

    def answer(self, question: Bottle) -> object:
        """The answer to a question. From any thread."""
        word = as_string(question.get(0))
        asked = self._questions.get(word)
        try:
            if asked is None:
                raise RefusedError(f"{word[:_ECHO]!r} is none of {', '.join(self._questions)}")
            return asked(question)
        except RtfError as error:
            return Bottle([_FAIL, str(error)])

    # How it is ---------------------------------------------------------------------------------------------------

    def _status(self, _question: Bottle) -> Bottle:
        simulation, time = self.robot.simulation, self.robot.clock
        # The clock has a lock of its own, which is never taken while the lock is held: the clock does it the other way.
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
                Bottle(["lockstep", int(self._lockstep)]),
                Bottle(["clock", time.name]),
                Bottle(["parts", *self.robot.parts]),
                Bottle(["participants", *participants]),
                Bottle(["contacts", *self._contacts()]),
                Bottle(["faults", *self._faults()]),
                Bottle(["broken", broken]),
            ]
        )

    def _serves(self, question: Bottle) -> Bottle:
        """What really is here, for those who ask where the names lead: registrations may be old, or a stranger's."""
        wanted = [self.port.name]
        if len(question) > 1:
            part, known = _word(question.get(1), "serves: the part"), self.robot.parts
            if part not in known:
                raise RefusedError(f"serves: {part[:_ECHO]!r} is no part of this robot; it has {', '.join(known)}")
            begin = self.port.name.removesuffix(CONTROL)  # the network may have put something before the robot's name
            wanted += [f"{begin}/{part}/{end}" for end in BOARD_ENDS]
        here = [port.contact for port in ports_here() if port.name in wanted]
        return Bottle([_OK, *(Bottle([contact.name, contact.host, contact.port]) for contact in here)])

    def _contacts(self) -> list[Bottle]:
        simulation = self.robot.simulation
        with simulation.lock:
            return [Bottle(pair) for pair in touching(simulation.robot.model, simulation.data)]

    def _faults(self) -> list[Bottle]:
        return [_of_fault(one) for one in self.injector.active]

    # Faults ------------------------------------------------------------------------------------------------------

    def _describe(self, question: Bottle) -> Bottle:
        return Bottle([_OK, *describe(find_kind(_word(question.get(1), "describe: the kind")))])

    def _inject(self, question: Bottle) -> Bottle:
        kind = _word(question.get(1), "inject: the kind")
        target, values, times = "", {}, {"delay": 0.0, "duration": math.inf}
        words = list(question)[2:]
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
                raise RefusedError(f"inject: there is one target, {target}, and then {str(word)[:_ECHO]!r}")
            else:
                target = _word(word, "inject: the target")
        return Bottle([_OK, self.injector.inject(kind, target, values, **times)])

    def _clear(self, question: Bottle) -> Bottle:
        number = question.get(1)
        if number is not None and not isinstance(number, int):
            raise RefusedError(f"clear: {str(number)[:_ECHO]!r} is no number of a fault; 'active' tells them")
        return Bottle([_OK, self.injector.clear(number)])

    # Time --------------------------------------------------------------------------------------------------------

    def _ask_clock(self, question: Bottle) -> object:
        """Hand a question on to the clock, whose business it is."""
        with RpcClient("", self.robot.clock.name, network=self._network) as client:
            return client.call(question)

    def _factor(self, question: Bottle) -> Bottle:
        factor = _number(question.get(1), "factor")
        if not factor >= SLOWEST:
            raise RefusedError(f"factor: it is {SLOWEST:g} or more, not {factor:g}; to stop the time there is pause")
        simulation = self.robot.simulation
        with simulation.lock:
            simulation.pace(None if factor == math.inf else factor)
        return Bottle([_OK])

    def _quit(self, _question: Bottle) -> Bottle:
        self._end()
        return Bottle([_OK])


class _Speed:
    """How fast time has passed: between the questions of the last second, or since the one before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seen = deque([(clock.monotonic(), 0.0)], maxlen=100)

    def at(self, now: float) -> float:
        """Seconds that have passed a second of the machine's clock."""
        with self._lock:
            machine, seen = clock.monotonic(), self._seen
            seen.append((machine, now))
            while len(seen) > 2 and seen[1][0] < machine - _LATELY:  # noqa: PLR2004 - a beginning and an end
                seen.popleft()
            began, then = seen[0]
        return (now - then) / max(machine - began, 1e-6)


def describe(kind: type[Fault]) -> list[Bottle]:
    """What is to be known of a kind of fault, as groups."""
    parameters = [
        Bottle([one.name, one.default, one.unit, one.meaning, one.minimum, one.maximum]) for one in kind.parameters
    ]
    return [
        Bottle(["kind", kind.kind]),
        Bottle(["layer", kind.layer.value]),
        Bottle(["target", kind.target_kind.value]),
        Bottle(["meaning", kind.meaning]),
        Bottle(["shows", kind.shows]),
        Bottle(["parameters", *parameters]),
    ]


def _of_fault(one: ActiveFault) -> Bottle:
    return Bottle([one.number, one.fault.kind, one.fault.target, int(one.running), one.begins, one.ends])


def _word(value: Value | None, what: str) -> str:
    if not isinstance(value, str):
        raise RefusedError(f"{what} is a word, not {'nothing' if value is None else str(value)[:_ECHO]}")
    return value


def _number(value: Value | None, what: str) -> float:
    if not isinstance(value, int | float):
        raise RefusedError(f"{what}: a number is needed, not {'nothing' if value is None else str(value)[:_ECHO]}")
    return as_float(value)
