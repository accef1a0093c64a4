"""The contract of cameras, local or through the network."""

from __future__ import annotations

import numpy as np
import pytest

from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot.interfaces import CameraFeature, IFrameGrabber, IFrameGrabberControls
from waiting import eventually


class FrameGrabberContract:
    """To be subclassed with a fixture ``camera``: one of 64 x 48 colour pixels whose picture changes, and its controls.

    ``controls`` is the same device with BRIGHTNESS and WHITE_BALANCE and without FOCUS.
    """

    def test_images_have_its_size(self, camera: IFrameGrabber):
        """Width and height are those of every image."""
        image, time = camera.image()
        assert (camera.width(), camera.height()) == (image.width, image.height) == (64, 48)
        assert image.code == "rgb"
        assert time > 0

    def test_images_change(self, camera: IFrameGrabber):
        """Later images differ; an image that was read does not change."""
        first, time = camera.image()
        kept = first.pixels.copy()
        eventually(lambda: camera.image()[1] > time, "no other image comes")
        eventually(lambda: not np.array_equal(camera.image()[0].pixels, kept), "the picture stands still")
        assert (first.pixels == kept).all()

    def test_field_of_view(self, camera: IFrameGrabber):
        """The field of view is two angles in degrees."""
        assert all(0 < angle < 180 for angle in camera.field_of_view())

    def test_description(self, controls: IFrameGrabberControls):
        """The description has the number of the bus, and a text."""
        bus, text = controls.camera_description()
        assert isinstance(bus, int)
        assert text

    def test_features_that_it_has(self, controls: IFrameGrabberControls):
        """Values that are set can be read, one or two for each feature."""
        assert controls.has_feature(CameraFeature.BRIGHTNESS)
        controls.set_feature(CameraFeature.BRIGHTNESS, 0.25)
        assert controls.feature(CameraFeature.BRIGHTNESS) == (0.25,)
        controls.set_feature(CameraFeature.WHITE_BALANCE, 0.25, 0.75)
        assert controls.feature(CameraFeature.WHITE_BALANCE) == (0.25, 0.75)

    @pytest.mark.parametrize("on", [True, False])
    def test_switches(self, controls: IFrameGrabberControls, on: bool):
        """A feature is switched on and off, and left to the camera or not."""
        controls.set_active(CameraFeature.BRIGHTNESS, active=on)
        controls.set_automatic(CameraFeature.BRIGHTNESS, automatic=not on)
        assert controls.is_active(CameraFeature.BRIGHTNESS) is on
        assert controls.is_automatic(CameraFeature.BRIGHTNESS) is not on

    def test_features_that_it_has_not(self, controls: IFrameGrabberControls):
        """A missing feature can be asked for; reading and setting it is refused."""
        assert not controls.has_feature(CameraFeature.FOCUS)
        for forbidden in (
            lambda: controls.feature(CameraFeature.FOCUS),
            lambda: controls.set_feature(CameraFeature.FOCUS, 0.5),
            lambda: controls.is_active(CameraFeature.FOCUS),
            lambda: controls.set_automatic(CameraFeature.FOCUS, automatic=True),
        ):
            with pytest.raises((RefusedError, NotSupportedError)):
                forbidden()

    @pytest.mark.parametrize("values", [(1.5,), (-0.1,), (np.nan,), (0.1, 0.2)])
    def test_values_out_of_range_are_refused(self, controls: IFrameGrabberControls, values: tuple[float, ...]):
        """Values are fractions of the range, and as many as the feature has; others change nothing."""
        controls.set_feature(CameraFeature.BRIGHTNESS, 0.5)
        with pytest.raises(RefusedError):
            controls.set_feature(CameraFeature.BRIGHTNESS, *values)
        assert controls.feature(CameraFeature.BRIGHTNESS) == (0.5,)
