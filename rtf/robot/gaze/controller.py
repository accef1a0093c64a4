"""The gaze controller: turns neck and eyes, whose joints are those of a board, until both eyes look at a point.

In every period :class:`~rtf.robot.controllers.gaze.GazeMotion` says by the measured positions what to command: direct
positions of the neck, velocities of the eyes, and position moves of the eyes for saccades. So the eyes are in mixed
mode. The vestibulo-ocular reflex goes by a gyroscope, without one, and while its messages are late, by the encoders of
the torso.

Positions that do not come, or are no numbers, end a motion and suspend the controller, until a command to run.
A joint in fault ends a motion, too. Left out: the loop on streamed stereo pixels, which are triangulated.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from rtf import clock
from rtf.bottle import Bottle
from rtf.robot.control_modes import ControlMode
from rtf.robot.controllers.gaze import NECK, GazeCommand, GazeMotion, GazeSettings
from rtf.robot.controllers.task import TaskController
from rtf.robot.errors import NoAnswerError, RefusedError, RobotError, StaleStateError
from rtf.robot.interfaces import (
    CartesianPose,
    ControllerEvent,
    FixationPoint,
    GazeMeasurement,
    IControlLimits,
    IControlMode,
    IEncoders,
    IGazeControl,
    IPositionControl,
    IPositionDirect,
    IVelocityControl,
)
from rtf.robot.kinematics import vector_of
from rtf.robot.network.request_table import finite

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.robot.device import Device
    from rtf.robot.gaze.views import EyeViews
    from rtf.robot.interfaces import Eye, FloatArray, GazeTarget, NeckAxis, Values

#: Periods between two looks at the modes of the joints.
_LOOK = 10
#: The acceleration (deg/s²) of velocities, which are smooth already, and the peak of a trajectory's speed by its mean.
_ACCELERATION, _PEAK = 1e4, 1.875
#: So long (s) the encoders take the place of a gyroscope whose messages are late: as long as a board's may be.
_LOST = 0.5
_TORSO = 3
_AXES: tuple[NeckAxis, ...] = ("pitch", "roll", "yaw")
_MODES = (*[ControlMode.POSITION_DIRECT] * NECK, *[ControlMode.MIXED] * NECK)
_BROKEN = frozenset({ControlMode.HARDWARE_FAULT, ControlMode.IDLE, ControlMode.NOT_CONFIGURED})
_EVENTS = (
    "motion-onset", "motion-done", "motion-ongoing", "saccade-onset", "saccade-done", "stabilization-on",
    "stabilization-off", "closing", "suspended", "resumed", "comm-timeout", "*",
)  # fmt: skip


class GazeController(TaskController[GazeSettings], IGazeControl):
    """A controller of a board whose axes are those of torso (or none), neck and eyes, in the order of the chains.

    ``gyroscope`` returns the rotation (deg/s) in the frame of the sensor, whose orientation in that of the root
    ``sensor_pose`` returns for positions (deg) of torso and neck. ``tilt`` are limits of the eyes (deg) within those
    of the board; for ``eyes_lag`` (s) see GazeMotion. ``publish`` is called every ``period`` (s), with the robot's
    time; all other methods in any thread. Errors of the board are passed on.

    No lock is held while a board is called, see :class:`~rtf.robot.cartesian.controller.CartesianController`.
    """

    def __init__(
        self,
        board: Device,
        views: EyeViews,
        *,
        settings: GazeSettings | None = None,
        gyroscope: Callable[[], FloatArray] | None = None,
        sensor_pose: Callable[[FloatArray], FloatArray] | None = None,
        tilt: tuple[float, float] = (-np.inf, np.inf),
        eyes_lag: float = 0.0,
        period: float = 0.01,
        info: Sequence[tuple[str, str]] = (),
    ) -> None:
        self.period = period
        self._encoders = board.view(IEncoders)  # type: ignore[type-abstract]  # it is only looked for
        self._modes = board.view(IControlMode)  # type: ignore[type-abstract]  # it is only looked for
        self._direct = board.view(IPositionDirect)  # type: ignore[type-abstract]  # it is only looked for
        self._velocities = board.view(IVelocityControl)  # type: ignore[type-abstract]  # it is only looked for
        self._moves = board.view(IPositionControl)  # type: ignore[type-abstract]  # it is only looked for
        limits = board.view(IControlLimits)  # type: ignore[type-abstract]  # it is only looked for
        self._views, self._gyroscope, self._sensor_pose, self._info = views, gyroscope, sensor_pose, info
        self._torso = len(views.eyes.head) - NECK
        self._places = range(self._torso, self._torso + 2 * NECK)
        self._neck, self._eyes = [*self._places[:NECK]], [*self._places[NECK:]]
        allowed = np.array([limits.limits(place) for place in self._places])
        self._jump_speeds = [limits.velocity_limits(place)[1] / _PEAK for place in self._eyes]
        allowed[NECK] = np.clip(allowed[NECK], *tilt)
        speeds = [limits.velocity_limits(place)[1] for place in self._neck]
        self._motion = GazeMotion(views.eyes, allowed, neck_speeds=speeds, eyes_lag=eyes_lag, period=period)
        self._motion.settings = settings or GazeSettings()
        super().__init__(self._motion.settings)
        self._suspended = self._halting = self._has_modes = False
        self._unfelt = 0.0  # s, since the gyroscope measured a rotation
        self._periods = 0
        self._stops = 0  # how often it was stopped: a motion that is being prepared does not begin after a stop

    # Motions ---------------------------------------------------------------------------------------------------------

    def look_at(self, target: GazeTarget) -> None:
        stops = self._stops
        self._check_running()
        point = self._views.point_of(target, self._measured())
        self._prepare()
        with self.lock:
            self._check_running()
            if self._stops != stops:
                raise RefusedError("the gaze controller was stopped before the motion began")
            self._motion.look_at(point)
            self.begin_checkpoints()

    def stream_target(self, target: GazeTarget) -> None:
        self.look_at(target)

    def _check_running(self) -> None:
        if self._suspended:
            raise RefusedError("the gaze controller is suspended; tell it to run first")

    def _prepare(self) -> None:
        """Bring the joints into the modes that they are commanded in. Raises RefusedError for one in fault."""
        places = [*self._places]
        changed = self._others(self._checked_modes())
        if changed:
            self._let_go()
            self._modes.set_control_modes([_MODES[index] for index in changed], [places[index] for index in changed])
            self._has_modes = False
            if any(index >= NECK for index in changed):
                self._moves.set_reference_accelerations([_ACCELERATION] * NECK, self._eyes)
                self._moves.set_reference_speeds(self._jump_speeds, self._eyes)

    def _checked_modes(self) -> Sequence[ControlMode]:
        """Return the modes of neck and eyes. Raises RefusedError for a joint in fault."""
        found = self._modes.control_modes([*self._places])
        broken = [place for place, mode in enumerate(found) if mode in _BROKEN]
        if broken:
            raise RefusedError(f"{self._named(broken, found)}: neck and eyes are not moved")
        return found

    @staticmethod
    def _others(found: Sequence[ControlMode]) -> list[int]:
        return [index for index, mode in enumerate(found) if mode is not _MODES[index]]

    def _named(self, joints: Sequence[int], found: Sequence[ControlMode]) -> str:
        names = [*self._views.eyes.head.joints[self._torso :], "eyes_tilt", "eyes_version", "eyes_vergence"]
        return "; ".join(f"{names[joint]} is in mode {found[joint].name}" for joint in joints)

    def _look_at_modes(self) -> None:
        """Raise RefusedError for a joint in fault; let go of joints that another program has taken meanwhile."""
        found = self._checked_modes()
        others = self._others(found)
        if others and self._has_modes:
            self._let_go()
            raise RefusedError(
                f"{self._named(others, found)}: another program has taken the head, the motion was ended"
            )
        self._has_modes = not others  # a board may report its modes late

    def _let_go(self) -> None:
        """End a motion without a command: the joints may be moved by another program."""
        with self.lock:
            moving = self._motion.abort()
        if moving:
            self.notify([ControllerEvent("motion-done", clock.current().now())])

    def stop(self) -> None:
        """See ITaskControl: when it returns, the boards have the command, and later commands of others count."""
        self._halt()

    def _halt(self) -> None:
        """End a motion, and stop the eyes; the neck holds its last setpoint. Raises RobotError."""
        with self.lock:
            jumps, moving = self._motion.in_saccade, self._motion.abort()
            self._stops += 1
            self._halting = True  # a period that is under way may still command a velocity
        try:
            if jumps:
                self._moves.stop(self._eyes)
            self._velocities.velocity_move([0.0] * NECK, self._eyes)
        finally:
            if moving:
                self.notify([ControllerEvent("motion-done", clock.current().now())])

    def motion_done(self) -> bool:
        with self.lock:
            return self._motion.done

    def saccade_done(self) -> bool:
        with self.lock:
            return not self._motion.in_saccade

    def suspend(self) -> None:
        self._suspend("suspended")
        self._halt()

    def _suspend(self, event: str) -> None:
        with self.lock:
            was, self._suspended = self._suspended, True
        if not was:
            self.notify([ControllerEvent(event, clock.current().now())])

    def resume(self) -> None:
        with self.lock:
            was, self._suspended = self._suspended, False
        if was:
            self.notify([ControllerEvent("resumed", clock.current().now())])

    def status(self) -> str:
        return "suspended" if self._suspended else "running"

    # A period --------------------------------------------------------------------------------------------------------

    def publish(self, now: float) -> None:
        """Do what a period needs, at the robot's time. Raises RobotError, and a motion ends, for boards that fail."""
        self._periods += 1
        with self.lock:
            works, jumps, halting = self._motion.at_work, self._motion.in_saccade, self._halting
            self._halting = False
        if not works:
            if halting:
                self._velocities.velocity_move([0.0] * NECK, self._eyes)
            return
        try:
            if self._periods % _LOOK == 0:
                self._look_at_modes()
            measured, rotation, speeds = self._measured(), self._rotation(), None
            if self._motion.settings.vestibular:
                speeds = self._encoders.encoder_speeds([*range(self._torso + NECK)])
            if rotation is not None and self._sensor_pose is not None:
                rotation = self._sensor_pose(measured[:-NECK])[:3, :3] @ rotation
            there = not jumps or self._moves.motion_done(self._eyes)
            with self.lock:
                command = self._motion.step(measured, rotation=rotation, speeds=speeds, eyes_there=there)
                events = self._events(command, measured, now)
            self._command(command)
        except RefusedError as error:
            self._give_up(error)
            raise
        except RobotError as error:
            self._suspend("comm-timeout")
            self._give_up(error)
            raise
        self.notify(events)

    def _measured(self) -> FloatArray:
        """Return the positions of all joints. Raises NoAnswerError for what is no number."""
        measured = self._encoders.encoders()
        if not np.isfinite(measured).all():
            raise NoAnswerError(f"positions of torso and head are no numbers: {measured.tolist()}")
        return measured

    def _rotation(self) -> FloatArray | None:
        """Return the rotation (rad/s) in the frame of the gyroscope; None without one, and if it is not needed.

        None, too, while its messages are late, for a short time. Raises RobotError.
        """
        settings = self._motion.settings
        if self._gyroscope is None or not (settings.vestibular or settings.stabilization):
            return None
        try:
            measured = self._gyroscope()
        except StaleStateError:
            self._unfelt += self.period
            if self._unfelt > _LOST:
                raise
            return None
        self._unfelt = 0.0
        if not np.isfinite(measured).all():
            raise NoAnswerError(f"the rotation by the gyroscope is no number: {measured.tolist()}")
        return np.radians(measured)

    def _events(self, command: GazeCommand, measured: FloatArray, now: float) -> list[ControllerEvent]:
        """Return the events of a period; with the lock held."""
        events = [ControllerEvent(name, now) for name in command.events]
        if not self._motion.done or "motion-done" in command.events:
            ends = "motion-done" in command.events
            passed = self.pass_checkpoints(1.0 if ends else self._motion.share(measured), now)
            place = len(events) - 1 if ends else len(events)
            events[place:place] = passed
        return events

    def _command(self, command: GazeCommand) -> None:
        if command.neck is not None:
            self._direct.set_positions(command.neck, self._neck)
        if command.saccade is not None:
            self._moves.position_move(command.saccade, self._eyes)
        elif command.interrupts:
            self._moves.stop(self._eyes)
        elif not self._motion.in_saccade:  # a velocity would end it
            self._velocities.velocity_move(command.eyes, self._eyes)

    def _give_up(self, error: RobotError) -> None:
        """End a motion, and stop the eyes if their board answers."""
        self._change(stabilization=False)
        try:
            self._halt()
        except RobotError as other:
            error.add_note(f"the eyes could not be stopped either: {other}")

    # State -----------------------------------------------------------------------------------------------------------

    def fixation_point(self) -> GazeMeasurement:
        return self._timed(self._point(self._measured()))

    def angles(self) -> GazeMeasurement:
        return self._timed(self._views.eyes.angles_of(self._point(self._measured())))

    def joints(self) -> GazeMeasurement:
        measured = self._measured()
        return self._timed(np.concatenate([np.zeros(_TORSO - self._torso), measured]))

    def _point(self, measured: FloatArray) -> FloatArray:
        return self._views.eyes.fixation_point(self._seen(measured))

    def _seen(self, measured: FloatArray) -> FloatArray:
        """Return positions with a vergence at which the eyes look at a point in front."""
        seen = measured.copy()
        seen[-1] = max(seen[-1], self._views.eyes.smallest)
        return seen

    def _timed(self, values: FloatArray) -> GazeMeasurement:
        return GazeMeasurement(values, float(np.max(self._encoders.encoder_times())))

    def pose(self, part: Eye | Literal["head"]) -> CartesianPose:
        measured = self._seen(self._measured())
        pose = self._views.eyes.head_pose(measured) if part == "head" else self._views.pose(part, measured)
        return CartesianPose(vector_of(pose), self._timed(measured).time)

    def desired(self) -> FloatArray:
        with self.lock:
            if self._motion.point is not None:
                return self._motion.wanted.copy()
        return self._measured()[self._torso :]

    def joint_velocities(self) -> FloatArray:
        with self.lock:
            return self._motion.speeds.copy()

    def pixel_of(self, eye: Eye, point: Values) -> FloatArray:
        return self._views.pixel_of(eye, point, self._measured())

    def point_of(self, target: GazeTarget) -> FloatArray:
        return self._views.point_of(target, self._measured())

    def point_on_plane(self, eye: Eye, pixel: Values, plane: Values) -> FloatArray:
        return self._views.point_on_plane(eye, pixel, plane, self._measured())

    def angles_of(self, point: Values) -> FloatArray:
        return self._views.eyes.angles_of(np.asarray(point, dtype=np.float64))

    def info(self) -> Bottle:
        pairs = [Bottle([key, value]) for key, value in self._info]
        vergence = Bottle(["min_allowed_vergence", float(self._views.eyes.smallest)])
        return Bottle([*pairs, vergence, Bottle(["events", Bottle([*_EVENTS])]), *self.tweaks()])

    # Settings --------------------------------------------------------------------------------------------------------

    def context(self) -> GazeSettings:
        return self._motion.settings

    def restore_context(self, context: int) -> None:
        with self.lock:
            settings = self.stored(context)
        self._change(**{name: getattr(settings, name) for name in GazeSettings.__slots__})

    def _change(self, **changes: object) -> None:
        with self.lock:
            before = self._motion.settings
            self._motion.settings = after = replace(before, **changes)  # type: ignore[arg-type] # names of members
            if before.tracking and not after.tracking and self._motion.done:
                self._motion.stop()
        if before.stabilization != after.stabilization:
            name = "stabilization-on" if after.stabilization else "stabilization-off"
            self.notify([ControllerEvent(name, clock.current().now())])

    def tracking(self) -> bool:
        return self._motion.settings.tracking

    def set_tracking(self, tracking: bool) -> None:
        """See ITaskControl; without a target, the present point is the one that is kept."""
        self._change(tracking=tracking)
        if tracking and self._motion.point is None:
            self.look_at(FixationPoint(self._point(self._measured())))

    def neck_trajectory_time(self) -> float:
        return self._motion.settings.neck_time

    def set_neck_trajectory_time(self, duration: float) -> None:
        self._change(neck_time=finite(duration))

    def eyes_trajectory_time(self) -> float:
        return self._motion.settings.eyes_time

    def set_eyes_trajectory_time(self, duration: float) -> None:
        self._change(eyes_time=finite(duration))

    def vor_gain(self) -> float:
        return self._motion.settings.vestibular

    def set_vor_gain(self, gain: float) -> None:
        self._change(vestibular=finite(gain))

    def ocr_gain(self) -> float:
        return self._motion.settings.opto_kinetic

    def set_ocr_gain(self, gain: float) -> None:
        self._change(opto_kinetic=finite(gain))

    def saccades(self) -> bool:
        return self._motion.settings.saccades

    def set_saccades(self, saccades: bool) -> None:
        self._change(saccades=saccades)

    def saccades_inhibition_period(self) -> float:
        return self._motion.settings.saccade_pause

    def set_saccades_inhibition_period(self, period: float) -> None:
        self._change(saccade_pause=finite(period))

    def saccades_activation_angle(self) -> float:
        return self._motion.settings.saccade_angle

    def set_saccades_activation_angle(self, angle: float) -> None:
        self._change(saccade_angle=finite(angle))

    def neck_tolerance(self) -> float:
        return self._motion.settings.neck_tolerance

    def set_neck_tolerance(self, tolerance: float) -> None:
        self._change(neck_tolerance=max(0.0, finite(tolerance)))

    def stabilization(self) -> bool:
        return self._motion.settings.stabilization

    def set_stabilization(self, stabilization: bool) -> None:
        if stabilization:
            if self._gyroscope is None:
                raise RefusedError("without a gyroscope the head is not stabilized")
            self._check_running()
            self._prepare()
        self._change(stabilization=stabilization)

    def stereo_options(self) -> Bottle:
        return Bottle()

    def set_stereo_options(self, options: Bottle) -> None:
        raise RefusedError(f"pixels of both eyes are triangulated, which has no options such as {options.to_text()}")

    def tweaks(self) -> Bottle:
        return self._views.tweaks()

    def set_tweaks(self, tweaks: Bottle) -> None:
        self._views.set_tweaks(tweaks)

    # Ranges ----------------------------------------------------------------------------------------------------------

    def neck_range(self, axis: NeckAxis) -> tuple[float, float]:
        low, high = self._motion.ranges()[_AXES.index(axis)].tolist()
        return low, high

    def bind_neck(self, axis: NeckAxis, minimum: float, maximum: float) -> None:
        if not finite(minimum) <= finite(maximum):
            raise RefusedError(f"a range of neck {axis} is not {minimum:g} to {maximum:g}")
        self._bind(axis, (minimum, maximum))

    def clear_neck(self, axis: NeckAxis) -> None:
        self._bind(axis, (-np.inf, np.inf))

    def _bind(self, axis: NeckAxis, bounds: tuple[float, float]) -> None:
        with self.lock:
            place = _AXES.index(axis)
            low, high = self._motion.limits[place]
            ranges = [(float(one), float(other)) for one, other in self._motion.ranges()]
            ranges[place] = (float(np.clip(bounds[0], low, high)), float(np.clip(bounds[1], low, high)))
            self._change(neck_ranges=tuple(ranges))

    def blocked_vergence(self) -> float | None:
        return self._motion.settings.vergence

    def bind_eyes(self, vergence: float) -> None:
        if finite(vergence) >= 0.0:
            self._change(vergence=max(vergence, self._views.eyes.smallest))

    def clear_eyes(self) -> None:
        self._change(vergence=None)
