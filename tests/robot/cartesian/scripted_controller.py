"""A controller without a robot: it stores what it is told, and a motion is done when the test says so."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import CartesianPose, CartesianSolution, ControllerEvent, ICartesianControl

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.interfaces import CartesianPriority, EventObserver, FloatArray, Values

JOINTS = 10
INFO = '((server_version "2.0") (arm_version "2.5") (arm_type left_v2.5))'


class ScriptedController(ICartesianControl):
    """Ten joints; ``gate`` keeps a motion from beginning until it is set."""

    def __init__(self) -> None:
        self.gate = threading.Event()
        self.gate.set()
        self.said: list[tuple[object, ...]] = []
        self.present = CartesianPose(np.array([-0.3, -0.1, 0.1, 0.0, 0.0, 1.0, 0.5]), 100.25)
        self.solver, self.done = True, True
        self.text = INFO
        self._observers: list[EventObserver] = []
        self._time, self._tolerance, self._priority = 2.0, 0.01, "position"
        self._tracking = self._feedback = False
        self._active = [False] * 3 + [True] * 7
        self._rest, self._weights = np.zeros(JOINTS), np.zeros(JOINTS)
        self._limits = dict.fromkeys(range(JOINTS), (-90.0, 90.0))
        self._tip = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
        self._tweaks = Bottle.parse("((straightness 0.05) (task_2 (6 (0 0 -1) (0 0 1))))")
        self._contexts = {0: 2.0}
        self._next = 1
        self._shares: list[float] = []

    def happen(self, name: str, time: float, checkpoint: float | None = None) -> None:
        """Tell an event."""
        for observer in self._observers:
            observer(ControllerEvent(name, time, checkpoint))

    def go_to(self, target: Values, duration: float | None = None) -> None:
        self.gate.wait(20)
        if not self.solver:
            raise RefusedError("there is no solver")
        self.said.append(("go", np.asarray(target).tolist(), duration))
        self.done = False

    def stream_target(self, target: Values, duration: float | None = None) -> None:
        self.said.append(("stream", np.asarray(target).tolist(), duration))

    def stream_velocity(self, velocity: Values) -> None:
        self.said.append(("velocity", np.asarray(velocity).tolist()))

    def stop(self) -> None:
        self.said.append(("stop",))
        self.done = True

    def motion_done(self) -> bool:
        return self.done

    def ask(self, target: Values, start: Values | None = None) -> CartesianSolution:
        given = np.zeros(JOINTS) if start is None else np.asarray(start)
        return CartesianSolution(np.resize(np.asarray(target), 7), given)

    def pose(self, link: int | None = None) -> CartesianPose:
        if link is not None and not 0 <= link < JOINTS:
            raise RefusedError(f"there is no link {link}")
        return self.present if link is None else CartesianPose(np.full(7, float(link)), self.present.time)

    def desired(self) -> CartesianSolution:
        return CartesianSolution(self.present.vector, np.arange(10.0))

    def joint_velocities(self) -> FloatArray:
        return np.arange(7.0)

    def task_velocity(self) -> FloatArray:
        return np.arange(7.0) / 8

    def solver_connected(self) -> bool:
        return self.solver

    def info(self) -> Bottle:
        return Bottle.parse(self.text)[0] if self.text else Bottle()

    def trajectory_time(self) -> float:
        return self._time

    def set_trajectory_time(self, duration: float) -> None:
        self._time = max(duration, 0.1)

    def tolerance(self) -> float:
        return self._tolerance

    def set_tolerance(self, tolerance: float) -> None:
        self._tolerance = tolerance

    def tracking(self) -> bool:
        return self._tracking

    def set_tracking(self, tracking: bool) -> None:
        self._tracking = tracking

    def reference_feedback(self) -> bool:
        return self._feedback

    def set_reference_feedback(self, feedback: bool) -> None:
        self._feedback = feedback

    def priority(self) -> CartesianPriority:
        return self._priority

    def set_priority(self, priority: CartesianPriority) -> None:
        if priority not in ("position", "orientation"):
            raise RefusedError(f"there is no priority {priority}")
        self._priority = priority

    def active_joints(self) -> tuple[bool, ...]:
        return tuple(self._active)

    def set_active_joints(self, active: Sequence[bool | None]) -> tuple[bool, ...]:
        for joint, one in enumerate(active):
            self._active[joint] = self._active[joint] if one is None else one
        return tuple(self._active)

    def rest_posture(self) -> FloatArray:
        return self._rest

    def set_rest_posture(self, posture: Values) -> FloatArray:
        self._rest[: len(posture)] = posture
        return self._rest

    def rest_weights(self) -> FloatArray:
        return self._weights

    def set_rest_weights(self, weights: Values) -> FloatArray:
        self._weights[: len(weights)] = weights
        return self._weights

    def limits(self, joint: int) -> tuple[float, float]:
        if joint not in self._limits:
            raise RefusedError(f"there is no joint {joint}")
        return self._limits[joint]

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        low, high = self.limits(joint)
        if not low <= minimum <= maximum <= high:
            raise RefusedError("not within the limits of the board")
        self._limits[joint] = minimum, maximum

    def tip(self) -> FloatArray:
        return self._tip

    def set_tip(self, tip: Values) -> None:
        self._tip = np.asarray(tip)

    def tweaks(self) -> Bottle:
        return self._tweaks[0]

    def set_tweaks(self, tweaks: Bottle) -> None:
        self._tweaks = Bottle([tweaks])

    def store_context(self) -> int:
        self._contexts[self._next] = self._time
        self._next += 1
        return self._next - 1

    def restore_context(self, context: int) -> None:
        if context not in self._contexts:
            raise RefusedError(f"there is no context {context}")
        self._time = self._contexts[context]

    def delete_contexts(self, contexts: Sequence[int]) -> None:
        self.said.append(("delete", list(contexts)))
        for one in contexts:
            self._contexts.pop(one, None)

    def add_checkpoint(self, share: float) -> None:
        self._shares.append(share)

    def remove_checkpoint(self, share: float) -> None:
        if share not in self._shares:
            raise RefusedError(f"there is no checkpoint {share}")
        self._shares.remove(share)

    def checkpoints(self) -> FloatArray:
        return np.array(self._shares)

    def observe_events(self, observer: EventObserver) -> None:
        self._observers.append(observer)

    def unobserve_events(self, observer: EventObserver) -> None:
        self._observers.remove(observer)
