"""Faults of cameras that change their pictures: noise, exposure, colours, blur, and wrong columns and lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.simulator.faults.base import Parameter
from rtf.simulator.faults.sensors import CameraFault

if TYPE_CHECKING:
    from numpy.typing import NDArray

_WHITE = 255.0


class CameraNoise(CameraFault):
    """Noise of the pixels of a camera."""

    kind = "camera_noise"
    description = "The pictures of the camera are noisy: its gain is too high, or its cable is disturbed."
    symptom = "Pixels differ from their neighbours, and from picture to picture."
    parameters = (Parameter("deviation", 15.0, "%", "standard deviation of each colour, of white", 0.0, 100.0),)
    deviation: float

    def begin(self) -> None:
        self._random = self.own_random(*self.target.encode())
        super().begin()

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        noise = self._random.normal(0.0, self.deviation / 100.0 * _WHITE, pixels.shape)
        return np.clip(np.rint(pixels + noise), 0.0, _WHITE).astype(np.uint8)


class CameraExposure(CameraFault):
    """Wrong exposure of a camera."""

    kind = "camera_exposure"
    description = "The exposure of the camera is wrong: its settings are lost, or its iris hangs."
    symptom = "Its pictures are darker, or brighter, than those of another camera that sees the same scene."
    parameters = (Parameter("factor", 0.3, "", "of the brightness", 0.0, 100.0, healthy=1.0),)
    factor: float

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        brighter: NDArray[np.uint8] = np.minimum(np.rint(self.factor * pixels), _WHITE).astype(np.uint8)
        return brighter


class CameraColours(CameraFault):
    """Exchanged colours of a camera."""

    kind = "camera_colours"
    description = "Red and blue of the camera are exchanged: its driver has another order of the colours."
    symptom = "Red things are blue; another camera that sees the same scene shows other colours."

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        return np.ascontiguousarray(pixels[:, :, ::-1])


class CameraBlur(CameraFault):
    """Lens of a camera out of focus."""

    kind = "camera_blur"
    description = "The lens of the camera is out of focus, or dirty."
    symptom = "Edges are wide; another camera that sees the same scene shows them sharply."
    parameters = (Parameter("deviation", 3.0, "px", "standard deviation of the blur", 0.0, 100.0),)
    deviation: float

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        from PIL import Image, ImageFilter  # here, as few robots need it

        del now
        return np.array(Image.fromarray(pixels).filter(ImageFilter.GaussianBlur(self.deviation)))


class CameraGrey(CameraFault):
    """Pictures of a camera without colours."""

    kind = "camera_grey"
    description = "The camera sends grey pictures: its driver has lost the colours."
    symptom = "Another camera that sees the same scene shows colours."

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        grey = np.rint(pixels.mean(axis=2, keepdims=True)).astype(np.uint8)
        return np.repeat(grey, pixels.shape[2], axis=2)


class CameraDeadColumns(CameraFault):
    """Dead columns of a camera."""

    kind = "camera_dead_columns"
    description = "Columns of the camera's sensor are dead."
    symptom = "They are black in every picture, whatever the camera sees."
    parameters = (
        Parameter("count", 1.0, "", "how many, side by side", 0.0, 1e4),
        Parameter("place", 0.4, "", "where the first one is: 0 at the left, 1 at the right", 0.0, 1.0),
    )
    count: float
    place: float

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        first = round(self.place * (pixels.shape[1] - 1))
        shown = pixels.copy()
        shown[:, first : first + round(self.count)] = 0
        return shown


class CameraLines(CameraFault):
    """Displaced lines of a camera."""

    kind = "camera_lines"
    description = "Every other line of the camera is displaced: two half pictures do not fit."
    symptom = "Edges look like combs."
    parameters = (Parameter("shift", 5.0, "px", "of every other line, to the right", 0.0, 1e4),)
    shift: float

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        shown = pixels.copy()
        shown[1::2] = np.roll(shown[1::2], round(self.shift), axis=1)
        return shown


KINDS = (CameraNoise, CameraExposure, CameraColours, CameraGrey, CameraBlur, CameraDeadColumns, CameraLines)
