"""Gaze: neck and eyes turn until both eyes look at a point.

Positions are those of :class:`~rtf.robot.kinematics.Eyes`: torso, neck (three joints), tilt, version and vergence, in
degrees. The neck turns the axis of the head to the point, slowly; the eyes follow the point itself all the time, fast,
and so make up for what the neck still has to do. Saccades, one jump of the eyes to a new point, come before that.
Where the head is disturbed, the eyes turn against it, by the gyroscope (vestibulo-ocular reflex) and by what the neck
was told (opto-kinetic response).

:class:`GazeMotion` is called once a period with measured positions, and says what to command. It knows neither
boards nor ports nor clocks. Not there: stabilization of the head by the gyroscope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.controllers.minimum_jerk import MinimumJerkFilter
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import InverseKinematics, LookAt
from rtf.robot.kinematics.poses import rotation_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from rtf.robot.kinematics import Eyes

NECK = 3
#: How the target of the eyes follows the point, 1/s.
_FOLLOWING = 12.5
#: A point so near (deg) to the axis of the head moves the neck only after this time (s).
_NEAR, _PATIENCE = 5.0, 0.25
#: Tracking moves the neck again beyond this angle (deg), or while the torso is faster than this (deg/s).
_AWAY, _TORSO_SPEED = 2.5, 0.5
#: A motion is done within these (deg), but not before this time (s).
_NECK_DONE, _EYES_DONE, _SHORTEST = 0.5, 0.1, 0.1
#: The times (s) of eyes and neck are at least this, and the neck takes at least so much longer.
_LEAST_EYES, _LEAST_DIFFERENCE = 0.1, 0.2
#: Rotations (deg/s) that a gyroscope does not tell from none.
GYRO_THRESHOLD = 5.0


@dataclass(frozen=True, slots=True)
class GazeSettings:
    """What a gaze controller keeps to: its context."""

    neck_time: float = 0.75  # s
    eyes_time: float = 0.25  # s
    vestibular: float = 0.0  # the share of the vestibulo-ocular reflex
    opto_kinetic: float = 1.0  # the share of the opto-kinetic response
    saccades: bool = True
    saccade_pause: float = 0.2  # s, between two
    saccade_angle: float = 10.0  # deg, from the axis of the head
    neck_tolerance: float = 0.0  # deg
    tracking: bool = False
    neck_ranges: tuple[tuple[float, float], ...] = ()  # deg; none: the limits of the joints
    vergence: float | None = None  # deg: the eyes are bound, straight ahead

    def valid(self) -> GazeSettings:
        """Return it with times that eyes and neck can have."""
        eyes = max(self.eyes_time, _LEAST_EYES)
        return replace(self, eyes_time=eyes, neck_time=max(self.neck_time, eyes + _LEAST_DIFFERENCE))


@dataclass(frozen=True, slots=True)
class GazeCommand:
    """What to command now. ``events`` are those of the protocol: motion-onset, saccade-done and so on."""

    neck: NDArray[np.float64] | None = None  # deg: direct positions; None: leave it
    eyes: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))  # deg/s
    saccade: NDArray[np.float64] | None = None  # deg: a jump of the eyes, instead of the speeds
    events: Sequence[str] = ()


class GazeMotion:
    """A controller with ``limits`` (deg) of the six joints of neck and eyes, as (6, 2). ``period`` is in seconds."""

    def __init__(self, eyes: Eyes, limits: ArrayLike, *, period: float = 0.01) -> None:
        self.eyes = eyes
        self.period = period
        self.limits = np.asarray(limits, dtype=np.float64)
        if self.limits.shape != (NECK + 3, 2) or not (self.limits[:, 0] <= self.limits[:, 1]).all():
            raise RefusedError(f"neck and eyes have six pairs of limits, the smaller first, not {limits!r}")
        self.limits[-1, 0] = max(self.limits[-1, 0], eyes.smallest)
        self.torso = len(eyes.head) - NECK
        self._settings = GazeSettings()
        self._neck_filter = MinimumJerkFilter(NECK, period, self._settings.neck_time)
        self._eyes_filter = MinimumJerkFilter(3, period, self._settings.eyes_time)
        self._inverse = self._inverse_of_neck()
        self.point: NDArray[np.float64] | None = None
        #: Where neck and eyes are to be (deg).
        self.wanted = np.zeros(NECK + 3)
        #: The commanded speeds of neck and eyes (deg/s).
        self.speeds = np.zeros(NECK + 3)
        self.done = True
        self.in_saccade = False
        self._neck = np.zeros(NECK)  # commanded, deg
        self._new = False
        self._age = math.inf  # s, since the point was given
        self._moved = 0.0  # s, since the onset
        self._since_saccade = math.inf
        self._pending = False  # the neck has still to be told of the point
        self._before: NDArray[np.float64] | None = None  # the torso, a period ago

    # What it is told -------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> GazeSettings:
        """Its context; changes are in force from the next period on."""
        return self._settings

    @settings.setter
    def settings(self, settings: GazeSettings) -> None:
        self._settings = valid = settings.valid()
        self._neck_filter.duration, self._eyes_filter.duration = valid.neck_time, valid.eyes_time
        self._inverse = self._inverse_of_neck()

    def look_at(self, point: ArrayLike) -> None:
        """Look at a point (m, in the frame of the root); one out of reach is looked at as far as limits allow.

        Raises RefusedError for what is no point.
        """
        values = np.asarray(point, dtype=np.float64)
        if values.shape != (3,) or not np.isfinite(values).all():
            raise RefusedError(f"a point is three numbers, not {point!r}")
        self.point, self._new, self._age, self.done = values, True, 0.0, False

    def stop(self) -> None:
        """End a motion where it is; the next period says so."""
        self.point = None

    # A period --------------------------------------------------------------------------------------------------------

    def step(
        self, positions: ArrayLike, *, rotation: ArrayLike = (0.0, 0.0, 0.0), eyes_there: bool = True
    ) -> GazeCommand:
        """Return what to command, by measured positions (deg), all of which have been read at the same time.

        ``rotation`` is that of the head (rad/s, in axes of the root) by its gyroscope; ``eyes_there`` says whether the
        boards have ended a jump of the eyes.
        """
        now = np.asarray(positions, dtype=np.float64).copy()
        now[-1] = max(now[-1], self.eyes.smallest)
        torso_moves = self._torso_moves(now)
        self._age += self.period
        self._since_saccade += self.period
        if self.point is None:
            return self._ended()
        events: list[str] = []
        jump: NDArray[np.float64] | None = None
        away = self._angle(now)
        if self._new:
            self._begin(now, events)
            if self._wants_saccade(away):
                self.in_saccade, self._since_saccade = True, 0.0
                jump = self._saccade(now)
                self.wanted[NECK:] = jump
                events.append("saccade-onset")
        elif self.in_saccade and eyes_there:
            self.in_saccade = False
            self._eyes_filter.reset()
            events.append("saccade-done")
        self._aim(now, away, torso_moves=torso_moves)
        if self.done and self._off(now) and self.settings.tracking:
            self._onset(events)
        return self._commanded(now, np.asarray(rotation, dtype=np.float64), events, jump)

    def _begin(self, now: NDArray[np.float64], events: list[str]) -> None:
        if self._moved == 0.0:  # at rest
            self._neck_filter.reset()
            self._eyes_filter.reset()
            self._neck = now[self.torso : self.torso + NECK].copy()
            self.wanted = now[self.torso :].copy()
        self._new, self._pending = False, True
        self._onset(events)

    def _onset(self, events: list[str]) -> None:
        self.done = False
        if self._moved == 0.0:
            events.append("motion-onset")
            self._moved = self.period

    def _ended(self) -> GazeCommand:
        """Stop what still moves."""
        events = []
        if self._moved:
            events = ["motion-done"]
            self._rest()
        self.done, self.in_saccade = True, False
        return GazeCommand(events=events)

    def _rest(self) -> None:
        self._moved = 0.0
        self.speeds = np.zeros(NECK + 3)

    def _commanded(
        self,
        now: NDArray[np.float64],
        rotation: NDArray[np.float64],
        events: list[str],
        jump: NDArray[np.float64] | None,
    ) -> GazeCommand:
        if self.done and not self.settings.tracking:
            return GazeCommand(events=events)
        neck = self._neck_filter.step(self.wanted[:NECK] - now[self.torso : self.torso + NECK])
        self._neck = np.clip(self._neck + neck * self.period, *self._ranges().T)
        counter = self._counter(now, rotation, neck)
        self._follow(now, counter)
        eyes = counter.copy()
        if not self.in_saccade:
            eyes += self._eyes_filter.step(self.wanted[NECK:] - now[-3:])
        self.speeds = np.concatenate([neck, eyes])
        if not self.done:
            self._moved += self.period
            if not self._off(now) and self._moved > _SHORTEST and not self._pending:
                self.done = True
                events.append("motion-done")
                self._moved = 0.0
                if not self.settings.tracking:
                    self._rest()
                    eyes = np.zeros(3)
        return GazeCommand(self._neck.copy(), eyes, jump, events)

    # The neck --------------------------------------------------------------------------------------------------------

    def _aim(self, now: NDArray[np.float64], away: float, *, torso_moves: bool) -> None:
        """Seek where the neck is to be, when there is a reason for it."""
        settings = self.settings
        wanted = self._pending and (away >= _NEAR or self._age >= _PATIENCE)
        if settings.tracking and (torso_moves or (self.done and away > max(_AWAY, settings.neck_tolerance))):
            wanted = True
        if not wanted:
            return
        self._pending = False
        if away <= settings.neck_tolerance:
            self.wanted[:NECK] = now[self.torso : self.torso + NECK]
            return
        self.wanted[:NECK] = self.neck_for(self._short_of(now, away), now)

    def neck_for(self, point: ArrayLike, positions: ArrayLike) -> NDArray[np.float64]:
        """Return where the neck points the axis of the head to a point (deg), with the torso as it is."""
        posture = np.asarray(positions, dtype=np.float64)[: len(self.eyes.head)]
        rest = np.concatenate([posture[: self.torso], self._upright(posture)])
        active = [place >= self.torso for place in range(len(posture))]
        weights = [float(one) for one in active]
        return self._inverse.solve(
            LookAt(point), posture, rest=rest, weights=weights, active=active, attempts=1
        ).positions[self.torso :]

    def _inverse_of_neck(self) -> InverseKinematics:
        """Return the inverse of the chain of the head, with the ranges of the neck."""
        head = self.eyes.head
        ranges = zip(head.joints[self.torso :], self._ranges().tolist(), strict=True)
        return InverseKinematics(head.limited(dict(ranges)))

    def _ranges(self) -> NDArray[np.float64]:
        limits: NDArray[np.float64] = self.limits[:NECK]
        if not self.settings.neck_ranges:
            return limits
        ranges: NDArray[np.float64] = np.clip(self.settings.neck_ranges, limits[:, :1], limits[:, 1:])
        return ranges

    def _upright(self, posture: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the neck (deg) that holds the head upright on the torso: pitch and roll against gravity, no yaw."""
        base = posture.copy()
        base[self.torso :] = 0.0
        down = self.eyes.head.frames(base)[self.torso - 1][:3, :3].T @ (0.0, 0.0, -1.0) if self.torso else DOWN
        pitch = math.pi / 2 + math.atan2(down[1], down[0])
        roll = -math.pi / 2 - math.atan2(down[1], down[2])
        upright = [_turned(math.degrees(pitch)), _turned(math.degrees(roll)), 0.0]
        return np.clip(upright, *self._ranges().T)

    def _short_of(self, now: NDArray[np.float64], away: float) -> NDArray[np.float64]:
        """Return the point turned towards the axis of the head by the tolerance of the neck."""
        assert self.point is not None
        tolerance = self.settings.neck_tolerance
        if not tolerance:
            return self.point
        pose = self.eyes.head_pose(now)
        way = self.point - pose[:3, 3]
        axis = np.cross(way, pose[:3, 2])
        turned: NDArray[np.float64] = pose[:3, 3] + rotation_of(axis, math.radians(min(tolerance, away))) @ way
        return turned

    # The eyes --------------------------------------------------------------------------------------------------------

    def _follow(self, now: NDArray[np.float64], counter: NDArray[np.float64]) -> None:
        """Move the target of the eyes against what turns the head, and so that their point comes to the point."""
        assert self.point is not None
        bound = self.settings.vergence
        if bound is not None:
            self.wanted[NECK:] = np.clip((0.0, 0.0, bound), *self.limits[NECK:].T)
            return
        planned = np.concatenate([now[:-3], self.wanted[NECK:]])
        jacobian = self.eyes.fixation_jacobian(planned)[:, -3:]
        left = self.point - self.eyes.fixation_point(planned)
        rates = np.degrees(np.linalg.lstsq(jacobian, _FOLLOWING * left, rcond=None)[0])
        self.wanted[NECK:] = np.clip(self.wanted[NECK:] + (rates + counter) * self.period, *self.limits[NECK:].T)

    def _counter(
        self, now: NDArray[np.float64], rotation: NDArray[np.float64], neck: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the speeds of the eyes (deg/s) against what turns the head."""
        settings = self.settings
        if settings.vergence is not None:
            return np.zeros(3)
        jacobian = self.eyes.fixation_jacobian(now)
        moves = settings.opto_kinetic * jacobian[:, self.torso : -3] @ np.radians(neck)
        if settings.vestibular and math.degrees(float(np.linalg.norm(rotation))) >= GYRO_THRESHOLD:
            arm = self.eyes.fixation_point(now) - self.eyes.head_pose(now)[:3, 3]
            moves = moves + settings.vestibular * np.cross(rotation, arm)
        speeds: NDArray[np.float64] = -np.degrees(np.linalg.lstsq(jacobian[:, -3:], moves, rcond=None)[0])
        return speeds

    def _wants_saccade(self, away: float) -> bool:
        settings = self.settings
        free = settings.saccades and settings.vergence is None
        return free and away > settings.saccade_angle and self._since_saccade >= settings.saccade_pause

    def _saccade(self, now: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return tilt, version and vergence (deg) that look at the point with the head as it is."""
        assert self.point is not None
        pose = self.eyes.head_pose(now)
        x, y, z = pose[:3, :3].T @ (self.point - pose[:3, 3])
        vergence = 2.0 * math.atan2(self.eyes.half_baseline, math.sqrt(x * x + y * y + z * z))
        angles = np.degrees([-math.atan2(y, abs(z)), math.atan2(x, z), vergence])
        return np.clip(angles, *self.limits[NECK:].T)

    # What is seen ----------------------------------------------------------------------------------------------------

    def _angle(self, now: NDArray[np.float64]) -> float:
        """Return the angle (deg) between the axis of the head and the point."""
        assert self.point is not None
        pose = self.eyes.head_pose(now)
        way = self.point - pose[:3, 3]
        cosine = float(way @ pose[:3, 2]) / max(float(np.linalg.norm(way)), 1e-9)
        return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))

    def _off(self, now: NDArray[np.float64]) -> bool:
        left = self.wanted - now[self.torso :]
        return bool(
            self.in_saccade or np.linalg.norm(left[:NECK]) >= _NECK_DONE or np.linalg.norm(left[NECK:]) >= _EYES_DONE
        )

    def _torso_moves(self, now: NDArray[np.float64]) -> bool:
        torso, before = now[: self.torso], self._before
        self._before = torso
        return before is not None and bool(np.linalg.norm(torso - before) > _TORSO_SPEED * self.period)


DOWN = np.array([0.0, 0.0, -1.0])


def _turned(angle: float) -> float:
    """Return an angle between -180 and 180 deg."""
    return (angle + 180.0) % 360.0 - 180.0
