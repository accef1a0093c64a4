"""The server of gaze control: the ports of a controller.

==================  ===================================================================================================
``NAME/rpc``        requests, see :mod:`rtf.robot.gaze.requests`; each client is served in a thread of its own
``NAME/xd:i``       streamed points, without an answer
``NAME/angles:i``   ``abs`` or ``rel``, azimuth, elevation and vergence
``NAME/mono:i``     ``left`` or ``right``, a pixel, and a depth, or ``ver`` and a vergence
``NAME/stereo:i``   the pixels of both eyes
``NAME/x:o``        the fixation point with its stamp
``NAME/q:o``        the positions of torso and head
``NAME/angles:o``   the angles of the fixation point
``NAME/events:o``   events with their stamps; none is skipped
==================  ===================================================================================================
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Vocab, as_vocab
from rtf.robot.errors import RefusedError
from rtf.robot.gaze.requests import TABLE, TARGETS
from rtf.robot.network.task_server import TaskServer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.interfaces.gaze import IGazeControl
    from rtf.robot.publishing import Outlets

_FIRST_WORDS = {words[0] for words in TABLE.by_words}
_QUIT = {Vocab(word) for word in ("quit", "exit", "bye")}
_UNKNOWN = "command not recognized"


class GazeServer(TaskServer["tuple[FloatArray, ...]"]):
    """The ports of a controller; ``period`` in s is that of its streams.

    ``quit_program`` is called for a request that ends the program; without it, such a request is refused. Raises
    ConnectError and AddressError.
    """

    table, streams, rpc_end = TABLE, ("/x:o", "/q:o", "/angles:o"), "/rpc"

    def __init__(
        self,
        control: IGazeControl,
        name: str,
        *,
        network: Network,
        period: float = 0.01,
        outlets: Outlets | None = None,
        quit_program: Callable[[], None] | None = None,
    ) -> None:
        self._control = control
        self._quit = quit_program
        super().__init__(control, name, network=network, period=period, outlets=outlets)

    def measure(self, now: float) -> tuple[tuple[FloatArray, ...], float]:
        control = self._control
        point, joints, angles = control.fixation_point(), control.joints(), control.angles()
        return (point.values, joints.values, angles.values), point.time or now

    def send(self, value: tuple[FloatArray, ...], envelope: str) -> None:
        """Write each vector to its port."""
        for port, one in zip(self._ports, value, strict=True):
            port.write(one, envelope=envelope)

    def commands(self) -> Sequence[tuple[str, Callable[[Sequence[Value]], None]]]:
        return [(f"/{end}:i", partial(self._look, end)) for end in TARGETS]

    def _look(self, end: str, message: Sequence[Value]) -> None:
        self._control.stream_target(TARGETS[end](message))

    def answer(self, request: Bottle) -> Bottle:
        """Return the reply to a request. An unknown first word is repeated, as by the original."""
        word = as_vocab(request[0] if request else None)
        if word in _QUIT:
            if self._quit is None:
                raise RefusedError(f"{self.name} is part of another program, and is not ended by a request")
            self._quit()
            return Bottle([Vocab("bye")])
        if word not in _FIRST_WORDS:
            return Bottle([_UNKNOWN, _UNKNOWN])
        return super().answer(request)
