"""A camera as both protocols offer it: its image, optics and features, by the interfaces of the device."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, BottleError, Dialect, Property, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.types import Image
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from rtf.robot.network.camera_optics import pinhole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

#: The code of a crop by two corners; the other one of YARP, a list of pixels, is not implemented there either.
RECTANGLE = 0
_CORNERS = 2


class FeatureMode(IntEnum):
    """The setting of a feature: by the user, or by the camera."""

    UNKNOWN = 0
    MANUAL = 1
    AUTOMATIC = 2


class Configuration(NamedTuple):
    """A size of images, their rate in images a second, and the number of the word for the pixel format."""

    width: int
    height: int
    rate: float
    pixels: int


class ServedCamera:
    """A camera and its controls, which are None if it has none. ``period`` is the image period in s.

    All methods raise RefusedError and NotSupportedError as the interfaces of the device do.
    """

    def __init__(self, camera: IFrameGrabber, controls: IFrameGrabberControls | None, period: float) -> None:
        self._camera = camera
        self._controls = controls
        self._period = period

    @property
    def controls(self) -> IFrameGrabberControls:
        """The controls. Raises NotSupportedError if the camera has none."""
        if self._controls is None:
            raise NotSupportedError("the camera has no controls")
        return self._controls

    # Images ----------------------------------------------------------------------------------------------------------

    def width(self) -> int:
        """Return the pixels per row."""
        return self._camera.width()

    def height(self) -> int:
        """Return the number of rows."""
        return self._camera.height()

    def colour_image(self) -> Image:
        """Return the image in colours."""
        return self._camera.image()[0].to("rgb")

    def raw_image(self) -> Image:
        """Return the image as the camera gives it, if that is not in colours."""
        image, _ = self._camera.image()
        if image.format.channels != 1:
            raise NotSupportedError("the camera gives colours only")
        return image

    def cropped_image(self, kind: int, corners: Sequence[tuple[int, int]]) -> Image:
        """Return the part of the colour image between two corners, inclusive."""
        if kind != RECTANGLE or len(corners) != _CORNERS:
            raise NotSupportedError("a part of the image is a rectangle, given by two corners")
        return cropped(self.colour_image(), corners)

    # Optics ----------------------------------------------------------------------------------------------------------

    def resolution(self) -> tuple[int, int]:
        """Return width and height."""
        return self._camera.width(), self._camera.height()

    def set_resolution(self, width: int, height: int) -> None:
        """Refuse: these interfaces have no way to set it."""
        raise NotSupportedError(f"the resolution cannot be set to {width} x {height}")

    def field_of_view(self) -> tuple[float, float]:
        """Return the horizontal and the vertical field of view in deg."""
        horizontal, vertical = self._camera.field_of_view()
        return float(horizontal), float(vertical)

    def set_field_of_view(self, horizontal: float, vertical: float) -> None:
        """Refuse: these interfaces have no way to set it."""
        raise NotSupportedError(f"the field of view cannot be set to {horizontal} and {vertical} deg")

    def configurations(self) -> list[Configuration]:
        """Return the possible sizes and rates of images: the present one."""
        return [Configuration(*self.resolution(), 1.0 / self._period, Vocab("rgb").value)]

    def intrinsic_parameters(self, matrix: str = "rectificationMatrix") -> Property:
        """Return the intrinsic parameters; lengths in pixels. ``matrix`` is the name of one of them."""
        focal_x, focal_y, centre_x, centre_y, _ = pinhole(self.resolution(), self._camera.field_of_view())
        return Property(
            {
                "physFocalLength": 0.0,
                "focalLengthX": focal_x,
                "focalLengthY": focal_y,
                "principalPointX": centre_x,
                "principalPointY": centre_y,
                matrix: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                "distortionModel": "none",
                **dict.fromkeys(("k1", "k2", "k3", "t1", "t2"), 0.0),
            }
        )

    def mirrored(self) -> bool:
        """Return whether the image is mirrored."""
        return self._mirrors() and self.controls.feature(CameraFeature.MIRROR)[0] != 0

    def set_mirrored(self, mirrored: float) -> None:
        """Mirror the image, or not."""
        if not self._mirrors():
            raise NotSupportedError("the camera does not mirror images")
        self.controls.set_feature(CameraFeature.MIRROR, float(mirrored))

    def _mirrors(self) -> bool:
        return self._controls is not None and self._controls.has_feature(CameraFeature.MIRROR)

    # Features --------------------------------------------------------------------------------------------------------

    def camera_description(self) -> tuple[int, str]:
        """Return the kind of bus, and a text."""
        return self.controls.camera_description()

    def has_feature(self, feature: CameraFeature) -> bool:
        """Return whether the camera has a feature; one that it has can be set by hand."""
        return self.controls.has_feature(feature)

    def has_switch(self, feature: CameraFeature) -> bool:
        """Return whether a feature can be switched on and off."""
        return self._supports(feature, self.controls.is_active)

    def has_automatic(self, feature: CameraFeature) -> bool:
        """Return whether the camera can control a feature automatically."""
        return self._supports(feature, self.controls.is_automatic)

    def _supports(self, feature: CameraFeature, ask: Callable[[CameraFeature], bool]) -> bool:
        if not self.has_feature(feature):
            return False
        try:
            ask(feature)
        except NotSupportedError:
            return False
        return True

    def has_one_push(self, feature: CameraFeature) -> bool:  # noqa: ARG002 - the same for all
        """Return whether the camera can adjust a feature once: False, these interfaces have no way to ask for it."""
        return False

    def feature(self, feature: CameraFeature) -> float:
        """Return the value of a feature that has one."""
        return self._values(feature, 1)[0]

    def feature_pair(self, feature: CameraFeature) -> tuple[float, float]:
        """Return the values of a feature that has two."""
        first, second = self._values(feature, 2)
        return first, second

    def _values(self, feature: CameraFeature, count: int) -> tuple[float, ...]:
        values = self.controls.feature(feature)
        if len(values) != count:
            raise RefusedError(f"{feature.name} has {len(values)} values")
        return tuple(map(float, values))

    def set_feature(self, feature: CameraFeature, *values: float) -> None:
        """Set the value of a feature, or the two."""
        self.controls.set_feature(feature, *values)

    def is_active(self, feature: CameraFeature) -> bool:
        """Return whether a feature is switched on."""
        return self.controls.is_active(feature)

    def set_active(self, feature: CameraFeature, active: bool) -> None:
        """Switch a feature on or off."""
        self.controls.set_active(feature, active=active)

    def mode(self, feature: CameraFeature) -> FeatureMode:
        """Return by whom a feature is set."""
        return FeatureMode.AUTOMATIC if self.controls.is_automatic(feature) else FeatureMode.MANUAL

    def set_mode(self, feature: CameraFeature, mode: FeatureMode) -> None:
        """Set by whom a feature is set."""
        if mode is FeatureMode.UNKNOWN:
            raise RefusedError(f"{feature.name} is set by the user or by the camera")
        self.controls.set_automatic(feature, automatic=mode is FeatureMode.AUTOMATIC)

    def push_once(self, feature: CameraFeature) -> None:
        """Refuse: these interfaces have no way to let the camera adjust a feature once."""
        raise NotSupportedError(f"{feature.name} cannot be adjusted once")


def cropped(image: Image, corners: Sequence[tuple[int, int]]) -> Image:
    """Return the part of an image between two corners, inclusive. Raises RefusedError."""
    (x0, y0), (x1, y1) = corners
    left, right, top, bottom = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
    if not (left >= 0 and right < image.width and top >= 0 and bottom < image.height):
        raise RefusedError(f"({x0} {y0} {x1} {y1}) is not inside of {image.width} x {image.height} pixels")
    return type(image)(image.pixels[top : bottom + 1, left : right + 1], image.format, image.quantum)


def image_of(elements: Bottle) -> Image:
    """Return the image in an answer, its only element. Raises BottleError for anything else."""
    value = elements.get(0)
    if len(elements) != 1 or not isinstance(value, Bottle):
        raise BottleError(f"an image was expected, not {elements.to_text()[:60]!r}")
    try:
        return Image.codec.decode(encode(value), Dialect.YARP4)
    except ValueError as error:
        raise BottleError(f"an image was expected: {error}") from error
