"""The client of a camera server."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.types import IMAGE, Image
from rtf.robot import parameters
from rtf.robot.client.latest_message import LatestMessage
from rtf.robot.client.rpc_connection import RpcConnection
from rtf.robot.client.settings import RPC_TIMEOUT, unique_local
from rtf.robot.device import Device
from rtf.robot.errors import DeviceError, NoAnswerError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.server.camera_vocabulary import AUTOMATIC, COLOUR, CONTROLS, FEATURE, GET, HAS, IS, MANUAL, OPTICS, SET

if TYPE_CHECKING:
    from rtf.bottle import Property

#: Default age after which an image is stale, in seconds: the slowest cameras give one image a second.
TIMEOUT = 2.0
_REFUSALS = (Vocab("fail"), Vocab("nak"))
#: The index of the first value in an answer, after the part of the camera, the word, and "is".
_VALUES = 3
_MAX_SIDE = 1 << 16


class FrameGrabberClient(Device, IFrameGrabber, IFrameGrabberControls):
    """``frameGrabber_nwc_yarp``: the camera of a server. Images are streamed, everything else is requested.

    ============= ==============================================================================================
    ``remote``    the name of the server, such as ``/icub/cam/left``; required
    ``local``     the client's own port; default: a unique name
    ``carrier``   the carrier of the images (default fast_tcp)
    ``no_stream`` images are requested, too
    ``timeout``   the greatest age of an image, in seconds of the robot's clock (default 2)
    ============= ==============================================================================================
    """

    _stream: LatestMessage[Image] | None = None
    _rpc: RpcConnection | None = None
    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        """See Device. The server must be there."""
        source = parameters.port_name(configuration, "remote")
        local = parameters.port_name(configuration, "local", unique_local(source))
        timeout = parameters.positive(configuration, "timeout", TIMEOUT)
        carrier = parameters.carrier(configuration, "fast_tcp")
        asked = parameters.flag(configuration, "no_stream")
        with ExitStack() as opened:
            rpc = RpcConnection(f"{local}/rpc", f"{source}/rpc", patience=RPC_TIMEOUT, network=self.network)
            opened.callback(rpc.close)
            stream = None
            if not asked:
                stream = LatestMessage(local, IMAGE, timeout=timeout, network=self.network)
                opened.callback(stream.close)
                stream.connect(source, carrier)
            self._stream, self._rpc, self._opened = stream, rpc, opened.pop_all()

    def close(self) -> None:
        self._stream = self._rpc = None
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    # The image -------------------------------------------------------------------------------------------------------

    def width(self) -> int:
        return self._side("w")

    def height(self) -> int:
        return self._side("h")

    def _side(self, word: str) -> int:
        size = self._integer(COLOUR, GET, Vocab(word))
        if not 0 <= size <= _MAX_SIDE:
            raise NoAnswerError(f"{self.name}: {size} is not a valid image size ({word})")
        return size

    def image(self) -> tuple[Image, float]:
        """Return the latest image and its time. Without a stream the time is that of the request.

        Raises StaleStateError if no image has arrived yet, or the latest is too old.
        """
        if self._stream is not None:
            latest = self._stream.fresh()
            return latest.value, latest.at if latest.stamp is None else latest.stamp.time
        asked = clock.current().now()
        values = self._ask(COLOUR, GET, COLOUR)
        if len(values) != 1 or not isinstance(values[0], Bottle):
            raise NoAnswerError(f"{self.name}: the server's answer holds no image")
        try:
            return IMAGE.decode(encode(values[0]), self.network.dialect), asked
        except ValueError as error:
            raise NoAnswerError(f"{self.name}: the server's answer holds no image: {error}") from error

    def field_of_view(self) -> tuple[float, float]:
        horizontal, vertical = self._numbers(2, OPTICS, GET, Vocab("fov"))
        return horizontal, vertical

    # Controls --------------------------------------------------------------------------------------------------------

    def camera_description(self) -> tuple[int, str]:
        values = self._ask(CONTROLS, GET, Vocab("camd"))
        if len(values) != 2 or not isinstance(values[0], int) or not isinstance(values[1], str):  # noqa: PLR2004 - bus, text
            raise NoAnswerError(f"{self.name}: invalid description of the camera: {values.to_text()[:60]}")
        return values[0], values[1]

    def has_feature(self, feature: CameraFeature) -> bool:
        return self._integer(CONTROLS, HAS, FEATURE, int(feature)) != 0

    def feature(self, feature: CameraFeature) -> tuple[float, ...]:
        if feature is CameraFeature.WHITE_BALANCE:
            return self._numbers(2, CONTROLS, GET, Vocab("fea2"), int(feature))
        return self._numbers(1, CONTROLS, GET, FEATURE, int(feature))

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        word = FEATURE if len(values) == 1 else Vocab("fea2")
        self._set(word, int(feature), *map(float, values))

    def is_active(self, feature: CameraFeature) -> bool:
        return self._integer(CONTROLS, GET, Vocab("actv"), int(feature)) != 0

    def set_active(self, feature: CameraFeature, *, active: bool) -> None:
        self._set(Vocab("actv"), int(feature), int(active))

    def is_automatic(self, feature: CameraFeature) -> bool:
        return self._integer(CONTROLS, GET, Vocab("mode"), int(feature)) == AUTOMATIC

    def set_automatic(self, feature: CameraFeature, *, automatic: bool) -> None:
        self._set(Vocab("mode"), int(feature), AUTOMATIC if automatic else MANUAL)

    # Requests --------------------------------------------------------------------------------------------------------

    def _set(self, *words: object) -> None:
        answer = self._answer(CONTROLS, SET, *words)
        # YARP's servers answer [fgc] [set] and whether it worked, or nothing at all when it did.
        if len(answer) > 2 and answer[2] == 0:  # noqa: PLR2004 - behind these two words
            raise RefusedError(f"{self.name}: the camera refuses {Bottle(words).to_text()}")

    def _integer(self, *words: object) -> int:
        values = self._ask(*words)
        if not len(values) or not isinstance(values[-1], int):
            raise NoAnswerError(f"{self.name}: {values.to_text()[:60]!r} is not an answer to {Bottle(words)}")
        return int(values[-1])

    def _numbers(self, count: int, *words: object) -> tuple[float, ...]:
        values = self._ask(*words)
        found = tuple(float(value) for value in values if isinstance(value, int | float))
        if len(found) != len(values) or len(found) != count:
            raise NoAnswerError(f"{self.name}: {values.to_text()[:60]!r} is not an answer to {Bottle(words)}")
        return found

    def _ask(self, *words: object) -> Bottle:
        """Return the values in the answer to a ``get`` or ``has`` request."""
        answer = self._answer(*words)
        head = [words[0], HAS, FEATURE] if words[1] == HAS else [words[0], words[2], IS]
        if answer[:_VALUES] != Bottle(head):
            raise NoAnswerError(f"{self.name}: {answer.to_text()[:60]!r} is not an answer to {Bottle(words)}")
        return answer[_VALUES:]

    def _answer(self, *words: object) -> Bottle:
        if self._rpc is None:
            raise DeviceError(f"{self.name} is not open")
        answer = self._rpc.ask(Bottle(words))
        if answer.get(0) in _REFUSALS:
            raise RefusedError(f"{self.name}: the server answers {Bottle(words)} with {answer.to_text()[:60]}")
        return answer
