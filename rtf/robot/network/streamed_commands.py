"""Streamed commands of control boards, which are not answered: velocities and immediate setpoints.

A command is a pair of a header, the words that name it and the axes, and the values. They are the same in YARP 3 and
YARP 4. The table is first, then the port of a client, then the receiver of a board.
"""

from __future__ import annotations

from enum import Enum
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf import clock
from rtf.bottle import Bottle, Value, Vocab, as_vocab
from rtf.errors import RtfError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.types import Pair
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.types.pair import PairCodec
from rtf.middleware.types.vector import VECTOR
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.interfaces import (
    IAxisInfo,
    ICurrentControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    ITorqueControl,
    IVelocityControl,
)
from rtf.robot.network.elements import inner, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import NDArray

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.interfaces import FloatArray


class Axes(Enum):
    """The selection of axes in the header of a command, after its words."""

    ONE = "the number of the axis"
    ALL = "nothing"
    GROUP = "the number of axes, and the list of them"

    # Headers are looked up by it for each command; an enumeration's own hash, that of its name, is slow.
    __hash__ = object.__hash__


class Streamed(NamedTuple):
    """A streamed command: the words of its header, and the method, called as ``method(values, axes)``."""

    words: tuple[str, ...]
    interface: type[Any]
    method: str
    axes: Axes


def _streamed(interface: type[Any], method: str, words: str) -> Iterator[Streamed]:
    """Return the streamed commands of a method for one axis, all and several; ``-``: there is none."""
    for head, axes in zip(words.split(","), Axes, strict=False):
        if head.strip() != "-":
            yield Streamed((*head.split(),), interface, method, axes)


#: The streamed commands, by the words of their header.
STREAMED: Mapping[tuple[str, ...], Streamed] = {
    command.words: command
    for command in chain(
        _streamed(IPositionControl, "position_move", "-, poss"),
        _streamed(IVelocityControl, "velocity_move", "vmo, vmos, vmog"),
        _streamed(IPositionDirect, "set_positions", "dpo, dpos, dpog"),
        _streamed(ITorqueControl, "set_reference_torques", "dtq, dtqs, dtqg"),
        _streamed(IPWMControl, "set_reference_duty_cycles", "ipwm ref, ipwm refs"),
        _streamed(ICurrentControl, "set_reference_currents", "icur ref, icur refs, icur refg"),
    )
}
#: The codec of a streamed command: the header, and the values.
COMMAND: PairCodec[Bottle, FloatArray] = PairCodec(BOTTLE, VECTOR)


def _heads() -> dict[str, dict[Axes, tuple[Value, ...]]]:
    found: dict[str, dict[Axes, tuple[Value, ...]]] = {}
    for command in STREAMED.values():
        found.setdefault(command.method, {})[command.axes] = tuple(map(Vocab, command.words))
    return found


#: The words of the headers, by method and selection of axes.
HEADS: Mapping[str, Mapping[Axes, tuple[Value, ...]]] = _heads()


class CommandStream:
    """The port that streams commands to a board. May be used from any thread.

    A command is sent in the background. While the previous one is in transit, a strict command waits for it, at most
    ``limit`` seconds, and any other is skipped: the next one follows soon. By a simulator's clock each is sent before
    ``send`` returns, so that it arrives at the simulated time of the call. ``strict`` overrides the choice for all
    commands unless it is None. ``remade`` is called to reconnect a lost connection before it is used.
    """

    def __init__(
        self,
        name: str,
        board: str,
        *,
        network: Network,
        carrier: str,
        limit: float,
        strict: bool | None,
        remade: Callable[[], None],
    ) -> None:
        self.board = board
        self._target = Contact(f"{board}/command:i")
        self._carrier = carrier
        self._limit = limit
        self._strict = strict
        self._remade = remade
        self._port: BufferedPort[Pair[Bottle, NDArray[Any]]] = BufferedPort(
            name, COMMAND, network=network, inputs=False
        )

    @property
    def name(self) -> str:
        """The name of the port."""
        return self._port.name

    @property
    def target(self) -> Contact:
        """The port of the board."""
        return self._target

    @property
    def connected(self) -> bool:
        """Whether the connection exists, as far as is known."""
        return bool(self._port.outputs)

    def reconnect(self) -> None:
        """Connect, or reconnect. Raises MiddlewareError."""
        self._port.add_output(self._target, self._carrier)

    def disconnect(self) -> None:
        """Disconnect; the next use reconnects."""
        self._port.remove_output(self._target.name)

    def close(self) -> None:
        """Send what is in transit, then disconnect."""
        self._port.close()

    def send(self, head: list[Value], values: FloatArray, *, strict: bool) -> None:
        """Send a command and its values. Raises NoAnswerError without a connection, or after the limit."""
        port = self._port
        if not port.outputs:
            self._remade()
        if self._strict is not None:
            strict = self._strict
        if strict:
            self._drain()
        if not port.write(Pair(Bottle.adopt(head), values)) and strict:
            raise NoAnswerError(f"the connection with {self._target.name} was lost, and the streamed command with it")
        if type(clock.current()) is not clock.SystemClock:
            self._drain()

    def _drain(self) -> None:
        if not self._port.wait(self._limit):
            raise NoAnswerError(f"{self.board} has not received the previous command within {self._limit:g} s")


class StreamedCommands:
    """Executes commands on a device, in the thread of the connection, before they are acknowledged.

    The commands of a client are thus executed in order, and none is lost. An invalid command, or one that the device
    refuses, is skipped and passed to ``report``; the same message is not repeated.
    """

    def __init__(self, device: object, report: Callable[[str], None]) -> None:
        self._device = device
        self._report = report
        self._reported = ""

    def take(self, delivery: IncomingMessage) -> None:
        """Execute one message."""
        try:
            command = delivery.read(COMMAND)
            self.carry_out(command.first, command.second)
        except RtfError as error:
            self._report_once(f"a command of {delivery.sender or 'a caller'} is skipped: {error}")
        except Exception as error:  # noqa: BLE001 - the port must survive errors of a device
            self._report_once(f"a command of {delivery.sender or 'a caller'} failed: {type(error).__name__}: {error}")

    def carry_out(self, head: Bottle, values: FloatArray) -> None:
        """Execute a command with its values. Raises RefusedError, and the errors of the device."""
        command, axes, count = self._find(head)
        if values.size != count or not count:
            raise RefusedError(f"{head.to_text()[:60]!r} takes {count} values, got {values.size}")
        if not isinstance(self._device, command.interface):
            raise NotSupportedError(f"the device has no {command.interface.__name__}")
        getattr(self._device, command.method)(values, axes)

    def _find(self, head: Bottle) -> tuple[Streamed, int | list[int] | None, int]:
        """Return the command, the selection of its axes, and their number."""
        words = [as_vocab(value).text for value in head[:2]]
        for length in (1, 2):
            command = STREAMED.get((*words[:length],))
            if command is not None:
                return command, *self._axes(command.axes, head[length:])
        raise RefusedError(f"{head.to_text()[:60]!r} is not a command")

    def _axes(self, axes: Axes, arguments: Bottle) -> tuple[int | list[int] | None, int]:
        if axes is Axes.ALL:
            assert isinstance(self._device, IAxisInfo)
            return None, self._device.axes()
        if axes is Axes.ONE:
            return whole(arguments.get(0)), 1
        joints = [whole(joint) for joint in inner(arguments.get(1), whole(arguments.get(0)))]
        return joints, len(joints)

    def _report_once(self, sentence: str) -> None:
        if sentence != self._reported:
            self._reported = sentence
            self._report(sentence)
