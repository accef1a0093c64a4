"""The receiver of streamed commands of a control board: pairs of a header, which names the command, and values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_vocab
from rtf.errors import RtfError
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import IAxisInfo
from rtf.robot.vocabulary import COMMAND, STREAMED, Shape, Streamed
from rtf.robot.vocabulary_kinds import inner, whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.interfaces import FloatArray


class StreamedCommands:
    """Executes commands on a device, in the thread of the connection, before they are acknowledged.

    The commands of a client are thus executed in order, and none is lost. An invalid command, or one that the device
    refuses, is skipped and passed to ``report``; the same message is not repeated.
    """

    def __init__(self, device: object, report: Callable[[str], None]) -> None:
        self._device = device
        self._report = report
        self._said = ""

    def take(self, delivery: IncomingMessage) -> None:
        """Execute one message."""
        try:
            command = delivery.read(COMMAND)
            self.carry_out(command.first, command.second)
        except RtfError as error:
            self._tell(f"a command of {delivery.sender or 'a caller'} is skipped: {error}")
        except Exception as error:  # noqa: BLE001 - the port must survive errors of a device
            self._tell(f"a command of {delivery.sender or 'a caller'} failed: {type(error).__name__}: {error}")

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
                return command, *self._axes(command.shape, head[length:])
        raise RefusedError(f"{head.to_text()[:60]!r} is not a command")

    def _axes(self, shape: Shape, arguments: Bottle) -> tuple[int | list[int] | None, int]:
        if shape is Shape.ALL:
            assert isinstance(self._device, IAxisInfo)
            return None, self._device.axes()
        if shape is Shape.ONE:
            return whole(arguments.get(0)), 1
        joints = [whole(joint) for joint in inner(arguments.get(1), whole(arguments.get(0)))]
        return joints, len(joints)

    def _tell(self, sentence: str) -> None:
        if sentence != self._said:
            self._said = sentence
            self._report(sentence)
