"""The client of gaze control, ``gazecontrollerclient``, for our servers and iKinGazeCtrl of the iCub."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from rtf.bottle import Bottle
from rtf.robot.gaze.requests import FORMS, JOINTS_SIZE, TABLE, target_elements
from rtf.robot.interfaces.gaze import FixationPoint, GazeMeasurement, IGazeControl
from rtf.robot.network.request_table import POSITION_SIZE, vector
from rtf.robot.network.task_client import TaskClient

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.interfaces import CartesianPose, FloatArray, Values
    from rtf.robot.interfaces.gaze import Eye, GazeTarget, NeckAxis


class GazeClient(TaskClient, IGazeControl):
    """``gazecontrollerclient``: see :class:`~rtf.robot.network.task_client.TaskClient` for its parameters."""

    kind, table, rpc_ends = "gaze control", TABLE, ("/rpc", "/rpc")
    command_ends = ("xd", "angles", "mono", "stereo")
    stream_sizes: ClassVar[Mapping[str, int]] = {"x": POSITION_SIZE, "angles": POSITION_SIZE, "q": JOINTS_SIZE}

    # Motions ---------------------------------------------------------------------------------------------------------

    def look_at(self, target: GazeTarget) -> None:
        self.call(f"look {FORMS[type(target)][0]}", target)

    def stream_target(self, target: GazeTarget) -> None:
        self.stream(FORMS[type(target)][1], Bottle(target_elements(target)))

    def saccade_done(self) -> bool:
        return bool(self.call("saccade_done"))

    def suspend(self) -> None:
        self.call("suspend")

    def resume(self) -> None:
        self.call("resume")

    def status(self) -> str:
        return str(self.call("status"))

    # State -----------------------------------------------------------------------------------------------------------

    def fixation_point(self) -> GazeMeasurement:
        """Return the latest one of the stream."""
        return self._measured("x")

    def angles(self) -> GazeMeasurement:
        """Return the latest ones of the stream."""
        return self._measured("angles")

    def joints(self) -> GazeMeasurement:
        """Return the latest ones of the stream."""
        return self._measured("q")

    def _measured(self, end: str) -> GazeMeasurement:
        latest = self.latest(end)
        return GazeMeasurement(latest.value.copy(), latest.time)

    def pose(self, part: Eye | Literal["head"]) -> CartesianPose:
        found: CartesianPose = self.call("pose", part)
        return found

    def desired(self) -> FloatArray:
        return self.call_array("desired")

    def joint_velocities(self) -> FloatArray:
        return self.call_array("joint_velocities")

    def pixel_of(self, eye: Eye, point: Values) -> FloatArray:
        return self.call_array("pixel_of", eye, point)

    def point_of(self, target: GazeTarget) -> FloatArray:
        if isinstance(target, FixationPoint):
            return vector(target.point, POSITION_SIZE)
        return self.call_array(f"point {FORMS[type(target)][0]}", target)

    def point_on_plane(self, eye: Eye, pixel: Values, plane: Values) -> FloatArray:
        return self.call_array("point_on_plane", eye, pixel, plane)

    def angles_of(self, point: Values) -> FloatArray:
        return self.call_array("angles_of", point)

    # Settings --------------------------------------------------------------------------------------------------------

    def neck_trajectory_time(self) -> float:
        return float(self.call("neck_trajectory_time"))

    def set_neck_trajectory_time(self, duration: float) -> None:
        self.call("set_neck_trajectory_time", duration)

    def eyes_trajectory_time(self) -> float:
        return float(self.call("eyes_trajectory_time"))

    def set_eyes_trajectory_time(self, duration: float) -> None:
        self.call("set_eyes_trajectory_time", duration)

    def vor_gain(self) -> float:
        return float(self.call("vor_gain"))

    def set_vor_gain(self, gain: float) -> None:
        self.call("set_vor_gain", gain)

    def ocr_gain(self) -> float:
        return float(self.call("ocr_gain"))

    def set_ocr_gain(self, gain: float) -> None:
        self.call("set_ocr_gain", gain)

    def saccades(self) -> bool:
        return bool(self.call("saccades"))

    def set_saccades(self, saccades: bool) -> None:
        self.call("set_saccades", saccades)

    def saccades_inhibition_period(self) -> float:
        return float(self.call("saccades_inhibition_period"))

    def set_saccades_inhibition_period(self, period: float) -> None:
        self.call("set_saccades_inhibition_period", period)

    def saccades_activation_angle(self) -> float:
        return float(self.call("saccades_activation_angle"))

    def set_saccades_activation_angle(self, angle: float) -> None:
        self.call("set_saccades_activation_angle", angle)

    def neck_tolerance(self) -> float:
        return float(self.call("neck_tolerance"))

    def set_neck_tolerance(self, tolerance: float) -> None:
        self.call("set_neck_tolerance", tolerance)

    def stabilization(self) -> bool:
        return bool(self.call("stabilization"))

    def set_stabilization(self, stabilization: bool) -> None:
        self.call("set_stabilization", stabilization)

    def stereo_options(self) -> Bottle:
        return self.call_bottle("stereo_options")

    def set_stereo_options(self, options: Bottle) -> None:
        self.call("set_stereo_options", options)

    # Ranges ----------------------------------------------------------------------------------------------------------

    def neck_range(self, axis: NeckAxis) -> tuple[float, float]:
        low, high = self.call(f"range {axis}")
        return float(low), float(high)

    def bind_neck(self, axis: NeckAxis, minimum: float, maximum: float) -> None:
        self.call(f"bind {axis}", minimum, maximum)

    def clear_neck(self, axis: NeckAxis) -> None:
        self.call(f"clear {axis}")

    def blocked_vergence(self) -> float | None:
        found: float | None = self.call("blocked_vergence")
        return found

    def bind_eyes(self, vergence: float) -> None:
        self.call("bind_eyes", vergence)

    def clear_eyes(self) -> None:
        self.call("clear_eyes")
