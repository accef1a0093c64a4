"""Faults of the scale, of the axes, of the noise and of the names of sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.interfaces import SensorCategory
from rtf.simulator.faults.base import Parameter
from rtf.simulator.faults.sensors import CameraFault, ForceTorqueFault, ImuFault

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.simulated_cameras import SimulatedCamera

#: The axes that are exchanged.
_TWO_AXES = (
    Parameter("first", 0.0, "", "an axis: 0 for x, 1 for y, 2 for z", 0.0, 2.0, healthy=None),
    Parameter("second", 1.0, "", "the other one", 0.0, 2.0),
)


class ForceTorqueGain(ForceTorqueFault):
    """Wrong scale of a force-torque sensor."""

    kind = "ft_gain"
    description = "The force-torque sensor has a wrong scale: the calibration of another one, or a wrong full scale."
    symptom = "Its forces and torques are too small, or too large, in proportion."
    parameters = (Parameter("factor", 0.7, "", "by which all six are multiplied", 0.0, 10.0, healthy=1.0),)
    factor: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values *= self.factor


class ForceTorqueAxes(ForceTorqueFault):
    """Exchanged axes of a force-torque sensor."""

    kind = "ft_axes"
    description = "Two axes of the force-torque sensor are exchanged: a wrong calibration matrix, or it is turned."
    symptom = "A load along one of the axes shows along the other."
    parameters = _TWO_AXES
    first: float
    second: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        one, other = round(self.first), round(self.second)
        for begin in (0, 3):
            values[[begin + one, begin + other]] = values[[begin + other, begin + one]]


class ForceTorqueCrossTalk(ForceTorqueFault):
    """Cross-talk of a force-torque sensor."""

    kind = "ft_cross_talk"
    description = "A force of the sensor acts on another one, too: it is overloaded and bent, or its matrix is wrong."
    symptom = "A load along one axis shows along another one as well."
    parameters = (Parameter("share", 0.3, "", "of the force along z that x shows in addition", -10.0, 10.0),)
    share: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, category, now
        values[0] += self.share * values[2]


class _ImuNoise(ImuFault):
    """Noise of one of the sensors of an inertial unit."""

    category: SensorCategory
    deviation: float

    def begin(self) -> None:
        self._random = self.own_random(self.category.value)
        super().begin()

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        if category is self.category:
            values += self._random.normal(0.0, self.deviation, values.shape)


class GyroscopeNoise(_ImuNoise):
    """Noise of the gyroscope."""

    kind = "gyroscope_noise"
    category = SensorCategory.GYROSCOPE
    description = "The gyroscope of the inertial unit is noisy: its supply is disturbed, or its filter is off."
    symptom = "Its angular velocities jump from reading to reading, also at rest."
    parameters = (Parameter("deviation", 5.0, "deg/s", "standard deviation about each axis", 0.0, 1e4),)


class AccelerometerNoise(_ImuNoise):
    """Noise of the accelerometer."""

    kind = "accelerometer_noise"
    category = SensorCategory.ACCELEROMETER
    description = "The accelerometer of the inertial unit is noisy: it is loose, or its filter is off."
    symptom = "Its accelerations jump from reading to reading, also at rest."
    parameters = (Parameter("deviation", 1.0, "m/s2", "standard deviation along each axis", 0.0, 1e4),)


class _ImuGain(ImuFault):
    """A wrong scale of one of the sensors of an inertial unit."""

    category: SensorCategory
    factor: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        if category is self.category:
            values *= self.factor


class GyroscopeGain(_ImuGain):
    """Wrong scale of the gyroscope."""

    kind = "gyroscope_gain"
    category = SensorCategory.GYROSCOPE
    description = "The gyroscope of the inertial unit has a wrong scale: it was set to another range."
    symptom = "Its angular velocities are too small, or too large, in proportion."
    parameters = (Parameter("factor", 0.5, "", "by which they are multiplied", 0.0, 10.0, healthy=1.0),)


class AccelerometerGain(_ImuGain):
    """Wrong scale of the accelerometer."""

    kind = "accelerometer_gain"
    category = SensorCategory.ACCELEROMETER
    description = "The accelerometer of the inertial unit has a wrong scale: it was set to another range."
    symptom = "At rest it does not measure 9.81 m/s2."
    parameters = (Parameter("factor", 0.5, "", "by which they are multiplied", 0.0, 10.0, healthy=1.0),)


class GyroscopeAxes(ImuFault):
    """Exchanged axes of the gyroscope."""

    kind = "gyroscope_axes"
    description = "Two axes of the gyroscope are exchanged, those of the other sensors of the unit are not."
    symptom = "A rotation about one of the axes shows about the other."
    parameters = _TWO_AXES
    first: float
    second: float

    def show(self, name: str, category: SensorCategory, values: FloatArray, now: float) -> None:
        del name, now
        if category is SensorCategory.GYROSCOPE:
            pair = [round(self.first), round(self.second)]
            values[pair] = values[pair[::-1]]


class CamerasSwapped(CameraFault):
    """Exchanged cameras."""

    kind = "cameras_swapped"
    description = "The camera and the next one are exchanged: their cables, or their names."
    symptom = "Each shows what the other one should see."

    def begin(self) -> None:
        names = [*self.robot.cameras]
        other = self.robot.cameras[names[(names.index(self.target) + 1) % len(names)]]
        self._pair = ((self.camera, self._other(other)), (other, self._other(self.camera)))
        for camera, show in self._pair:
            camera.faults.append(show)

    def end(self) -> None:
        for camera, show in self._pair:
            camera.faults.remove(show)

    @staticmethod
    def _other(camera: SimulatedCamera) -> Callable[[NDArray[np.uint8], float], NDArray[np.uint8]]:
        return lambda _, __: camera.picture()[0]


class CameraZoom(CameraFault):
    """Another field of view than the camera reports."""

    kind = "camera_zoom"
    description = "The camera has another lens, or another resolution, than its configuration says."
    symptom = "Its pictures move farther, or less far, than its field of view says."
    parameters = (
        Parameter("factor", 1.3, "", "the focal length, as a multiple of the reported one", 1.0, 4.0, healthy=1.0),
    )
    factor: float

    def show(self, pixels: NDArray[np.uint8], now: float) -> NDArray[np.uint8]:
        del now
        rows, columns = (self._places(size) for size in pixels.shape[:2])
        return np.ascontiguousarray(pixels[rows][:, columns])

    def _places(self, size: int) -> NDArray[np.intp]:
        """Return which pixels are shown: those in the middle, each several times."""
        middle = (size - 1) / 2.0
        places: NDArray[np.intp] = np.rint(middle + (np.arange(size) - middle) / self.factor).astype(np.intp)
        return places


KINDS = (
    ForceTorqueGain,
    ForceTorqueAxes,
    ForceTorqueCrossTalk,
    GyroscopeGain,
    AccelerometerGain,
    GyroscopeAxes,
    GyroscopeNoise,
    AccelerometerNoise,
    CamerasSwapped,
    CameraZoom,
)
