"""A controller without a robot: it stores what it is told, and answers what the test says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.bottle import Bottle
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CartesianPose, ControllerEvent, GazeMeasurement, IGazeControl

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.interfaces import EventObserver

INFO = '((server_version "2.0") (head_version "2.5") (min_allowed_vergence 0.5))'
POSE = CartesianPose(np.array([-0.05, 0.03, 0.35, 0.0, 0.0, 1.0, 0.5]), 100.25)
#: What methods return at first; those of a setting are changed by ``set_``.
RESULTS: dict[str, Any] = {
    "motion_done": True,
    "saccade_done": True,
    "info": Bottle.parse(INFO)[0],
    "tracking": False,
    "tweaks": Bottle.parse("((camera_width_left 320))")[0],
    "store_context": 1,
    "checkpoints": np.array([0.5]),
    "status": "running",
    "fixation_point": GazeMeasurement(np.array([-0.5, 0.125, 0.25]), 100.25),
    "angles": GazeMeasurement(np.array([10.0, -5.0, 7.5]), 100.25),
    "joints": GazeMeasurement(np.arange(9.0), 100.25),
    "pose": POSE,
    "desired": np.arange(6.0),
    "joint_velocities": np.arange(6.0) / 8,
    "pixel_of": np.array([160.0, 120.5]),
    "point_of": np.array([-0.5, 0.125, 0.25]),
    "point_on_plane": np.array([-0.5, 0.25, 0.25]),
    "angles_of": np.array([10.0, -5.0, 7.5]),
    "neck_trajectory_time": 0.75,
    "eyes_trajectory_time": 0.25,
    "vor_gain": 1.0,
    "ocr_gain": 0.0,
    "saccades": True,
    "saccades_inhibition_period": 0.25,
    "saccades_activation_angle": 10.0,
    "neck_tolerance": 0.0,
    "stabilization": False,
    "stereo_options": Bottle.parse("((Kp (0.001)) (Ki (0.001)))")[0],
    "neck_range": (-40.0, 22.5),
    "blocked_vergence": None,
}


def _method(name: str) -> Callable[..., Any]:
    def called(self: ScriptedGaze, *given: Any) -> Any:
        self.said.append((name, *given))
        if name in self.refused:
            raise RefusedError(f"{name} is refused")
        if name.startswith("set_"):
            self.results[name.removeprefix("set_")] = given[0]
        return self.results.get(name)

    return called


class ScriptedGaze(IGazeControl):
    """``said`` are the calls, ``refused`` the names of methods that refuse."""

    def __init__(self) -> None:
        self.said: list[tuple[Any, ...]] = []
        self.refused: set[str] = set()
        self.results = dict(RESULTS)
        self._observers: list[EventObserver] = []

    locals().update({name: _method(name) for name in IGazeControl.__abstractmethods__})

    def observe_events(self, observer: EventObserver) -> None:
        self._observers.append(observer)

    def unobserve_events(self, observer: EventObserver) -> None:
        self._observers.remove(observer)

    def happen(self, name: str, time: float, checkpoint: float | None = None) -> None:
        """Tell an event."""
        for observer in self._observers:
            observer(ControllerEvent(name, time, checkpoint))
