"""Gaze: neck and eyes turn until both eyes look at a point.

Positions are those of :class:`~rtf.robot.kinematics.Eyes`: torso, neck (three joints), tilt, version and vergence, in
degrees. The neck turns the axis of the head to the point, slowly; the eyes follow the point itself all the time, fast,
and so make up for what the neck still has to do. Saccades, one jump of the eyes to a new point, come before that.
Where the head is disturbed, the eyes turn against it, by the gyroscope (vestibulo-ocular reflex) and by the commands of
the neck (opto-kinetic response). Stabilization holds neck and eyes against what the gyroscope says.

:class:`GazeMotion` is called once a period with measured positions, and says what to command. It knows neither
boards nor ports nor clocks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

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
#: So long (s) eyes and neck go on after that: boards lag, and the neck may still turn by what counts as done.
_SETTLING = 0.5
#: The times (s) of eyes and neck are at least this, and the neck takes at least so much longer.
_LEAST_EYES, _LEAST_DIFFERENCE = 0.1, 0.2
#: How stabilization follows what the neck should turn the head by in space, 1/s, and the vergence (deg) from which the
#: eyes take part.
_STABILIZING, _STABILIZED_VERGENCE = 11.0, 4.0


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
    stabilization: bool = False  # by the gyroscope
    gyro_threshold: float = 5.0  # deg/s: below it a rotation counts as none
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
    interrupts: bool = False  # a jump of the eyes
    events: Sequence[str] = ()


class _Disturbance(NamedTuple):
    """What turns the head, as it is measured: see :meth:`GazeMotion.step`."""

    rotation: NDArray[np.float64] | None = None
    speeds: NDArray[np.float64] | None = None


class GazeMotion:
    """A controller with ``limits`` (deg) of the six joints of neck and eyes, as (6, 2). ``period`` is in seconds.

    The neck is commanded speeds up to ``neck_speeds`` (deg/s). The speeds of the eyes follow what they are commanded
    ``eyes_lag`` (s) later; what they are turned against is foreseen by that.
    """

    def __init__(
        self,
        eyes: Eyes,
        limits: ArrayLike,
        *,
        neck_speeds: ArrayLike = math.inf,
        eyes_lag: float = 0,
        period: float = 0.01,
    ) -> None:
        self.eyes, self.eyes_lag, self.period = eyes, eyes_lag, period
        self.neck_speeds = np.broadcast_to(np.asarray(neck_speeds, dtype=np.float64), NECK)
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
        self._neck_held = False  # whether the commanded neck is that of the period before
        self._neck = np.zeros(NECK)  # commanded, deg
        self._new = False
        self._age = math.inf  # s, since the point was given
        self._moved = 0.0  # s, since the onset
        self._since_saccade = math.inf
        self._pending = False  # the point has still to be sent to the neck
        self._before: NDArray[np.float64] | None = None  # the torso, a period ago
        self._began = np.zeros(NECK + 3)  # deg
        self._settling = 0.0  # s that are left
        self._unturned = np.zeros(NECK)  # deg: what stabilization has still to make up for
        self._countered: NDArray[np.float64] | None = None  # deg/s, a period ago

    # Commands -------------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> GazeSettings:
        """Its context; changes are in force from the next period on."""
        return self._settings

    @settings.setter
    def settings(self, settings: GazeSettings) -> None:
        if settings.stabilization and not self._settings.stabilization:
            self._neck_held = False
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
        self.point, self.done = None, True

    def abort(self) -> bool:
        """End a motion at once, without another period; return whether there was one."""
        moving = bool(self._moved)
        self.point, self.done, self.in_saccade, self._moved = None, True, False, 0.0
        self._rest()
        return moving

    @property
    def at_work(self) -> bool:
        """Whether there is something to command."""
        keeps = self.point is not None and (not self.done or self.settings.tracking or self._settling > 0.0)
        return bool(keeps or self._moved or self.speeds.any() or self.settings.stabilization)

    def share(self, positions: ArrayLike) -> float:
        """Return which share of its way a motion has done, 0 to 1, by measured positions (deg).

        It is that of the neck, for eyes go there and back; only where the neck stands it is that of the eyes.
        """
        way = self.wanted - self._began
        done = np.asarray(positions)[self.torso :] - self._began
        moves = slice(NECK) if np.linalg.norm(way[:NECK]) > _NECK_DONE else slice(NECK, None)
        length = float(np.linalg.norm(way[moves]))
        return min(1.0, float(np.linalg.norm(done[moves])) / length) if length else 1.0

    # A period --------------------------------------------------------------------------------------------------------

    def step(
        self,
        positions: ArrayLike,
        *,
        rotation: ArrayLike | None = None,
        speeds: ArrayLike | None = None,
        eyes_there: bool = True,
    ) -> GazeCommand:
        """Return what to command, by measured positions (deg), all of which have been read at the same time.

        ``rotation`` is that of the head (rad/s, in axes of the root) by its gyroscope. The measured ``speeds`` of torso
        and neck (deg/s) say where the head is carried, which no gyroscope does, and without one also how the torso
        turns it. ``eyes_there`` says whether the boards have ended a jump of the eyes.
        """
        now = np.asarray(positions, dtype=np.float64).copy()
        now[-1] = max(now[-1], self.eyes.smallest)
        torso_moves = self._torso_moves(now)
        self._age += self.period
        self._since_saccade += self.period
        disturbance = _Disturbance(*(None if one is None else np.asarray(one) for one in (rotation, speeds)))
        if self.point is None:
            return self._held(now, disturbance) if self.settings.stabilization else self._ended()
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
            self._onset(now, events)
        return self._commanded(now, disturbance, events, jump)

    def _begin(self, now: NDArray[np.float64], events: list[str]) -> None:
        if self._moved == 0.0:  # at rest
            self._neck_filter.reset()
            self._eyes_filter.reset()
            self._hold_neck(now)
            self.wanted = now[self.torso :].copy()
        self._new, self._pending = False, True
        self._onset(now, events)

    def _hold_neck(self, now: NDArray[np.float64]) -> None:
        """Begin with the neck where it is, unless it has been commanded until now."""
        if not self._neck_held:
            self._neck = now[self.torso : self.torso + NECK].copy()
            self._unturned = np.zeros(NECK)
            self._neck_held = True

    def _onset(self, now: NDArray[np.float64], events: list[str]) -> None:
        self.done = False
        if self._moved == 0.0:
            events.append("motion-onset")
            self._moved = self.period
            self._began = now[self.torso :].copy()

    def _ended(self) -> GazeCommand:
        """Stop what still moves."""
        events = self._end_motion()
        interrupts, self.in_saccade = self.in_saccade, False
        self._rest()
        return GazeCommand(interrupts=interrupts, events=events)

    def _end_motion(self) -> list[str]:
        """Return the event of a motion that has ended, if there was one."""
        events = ["motion-done"] if self._moved else []
        self.done, self._moved = True, 0.0
        return events

    def _rest(self) -> None:
        self._neck_held, self._settling, self._countered = False, 0.0, None
        self.speeds = np.zeros(NECK + 3)

    def _held(self, now: NDArray[np.float64], disturbance: _Disturbance) -> GazeCommand:
        """Hold head and eyes in space, without a point to look at."""
        events = self._end_motion()
        interrupts, self.in_saccade = self.in_saccade, False
        self._hold_neck(now)
        neck = self._turned_neck(now, disturbance, np.zeros(NECK))
        eyes = self._against(now, disturbance) if now[-1] > _STABILIZED_VERGENCE else np.zeros(3)
        self.speeds = np.concatenate([neck, eyes])
        return GazeCommand(self._neck.copy(), eyes, interrupts=interrupts, events=events)

    def _turned_neck(
        self, now: NDArray[np.float64], disturbance: _Disturbance, speeds: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Move the commanded neck by speeds (deg/s), and return these: in space, if it is stabilized."""
        if self.settings.stabilization and disturbance.rotation is not None:
            turns = self.eyes.head.jacobian(now[:-3])[3:, self.torso :]
            felt = np.degrees(np.linalg.lstsq(turns, disturbance.rotation, rcond=None)[0])
            self._unturned = self._unturned + (speeds - felt) * self.period
            speeds = _STABILIZING * self._unturned
        moved = self._neck + speeds * self.period
        self._neck = np.clip(moved, *self.ranges().T)
        self._unturned[moved != self._neck] = 0.0  # at a limit
        return speeds

    def _commanded(
        self,
        now: NDArray[np.float64],
        disturbance: _Disturbance,
        events: list[str],
        jump: NDArray[np.float64] | None,
    ) -> GazeCommand:
        if self.done and not self.settings.tracking:
            self._settling -= self.period
            if self._settling <= 0.0:
                if self.settings.stabilization:
                    return self._held(now, disturbance)
                self._rest()
                return GazeCommand(events=events)
        self._hold_neck(now)
        neck = self._neck_filter.step(self.wanted[:NECK] - self._neck)  # what is measured lags, and would overshoot
        neck = self._turned_neck(now, disturbance, neck / max(1.0, float(np.max(np.abs(neck) / self.neck_speeds))))
        counter = self._counter(now, disturbance, neck)
        self._follow(now, counter)
        eyes = self._foreseen(counter)
        if not self.in_saccade:
            eyes += self._eyes_filter.step(self.wanted[NECK:] - now[-3:])
        self.speeds = np.concatenate([neck, eyes])
        if not self.done:
            self._moved += self.period
            if not self._off(now) and self._moved > _SHORTEST and not self._pending:
                events += self._end_motion()
                self._settling = _SETTLING
        return GazeCommand(self._neck.copy(), eyes, jump, events=events)

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
        ranges = zip(head.joints[self.torso :], self.ranges().tolist(), strict=True)
        return InverseKinematics(head.limited(dict(ranges)))

    def ranges(self) -> NDArray[np.float64]:
        """Return the ranges of the neck (deg), (3, 2)."""
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
        return np.clip(upright, *self.ranges().T)

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
        self, now: NDArray[np.float64], disturbance: _Disturbance, neck: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the speeds of the eyes (deg/s) against what turns the head."""
        settings = self.settings
        if settings.vergence is not None:
            return np.zeros(3)
        jacobian = self.eyes.fixation_jacobian(now)
        moves = settings.opto_kinetic * jacobian[:, self.torso : -3] @ np.radians(neck)
        if settings.vestibular:
            moves = moves + settings.vestibular * self._disturbed(now, jacobian, disturbance)
        speeds: NDArray[np.float64] = -np.degrees(np.linalg.lstsq(jacobian[:, -3:], moves, rcond=None)[0])
        return speeds

    def _foreseen(self, counter: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the speeds against what turns the head as they will be when the eyes follow, by their change now."""
        before = counter if self._countered is None else self._countered
        self._countered = counter
        foreseen: NDArray[np.float64] = counter + (counter - before) * (self.eyes_lag / self.period)
        return foreseen

    def _disturbed(
        self, now: NDArray[np.float64], jacobian: NDArray[np.float64], disturbance: _Disturbance
    ) -> NDArray[np.float64]:
        """Return how the fixation point is moved (m/s): by the gyroscope, without one by the torso's encoders."""
        rotation, speeds = disturbance
        carried = np.zeros(len(self.eyes.head)) if speeds is None else np.radians(speeds)
        if rotation is None:
            moved: NDArray[np.float64] = jacobian[:, : self.torso] @ carried[: self.torso]
            return moved
        if math.degrees(float(np.linalg.norm(rotation))) < self.settings.gyro_threshold:
            return np.zeros(3)
        turned: NDArray[np.float64] = (
            np.cross(rotation, self._arm(now)) + self.eyes.head.jacobian(now[:-3])[:3] @ carried
        )
        return turned

    def _against(self, now: NDArray[np.float64], disturbance: _Disturbance) -> NDArray[np.float64]:
        """Return the speeds of the eyes (deg/s) that hold their point against all of a measured rotation."""
        if disturbance.rotation is None or self.settings.vergence is not None:
            return np.zeros(3)
        jacobian = self.eyes.fixation_jacobian(now)[:, -3:]
        moved = np.cross(disturbance.rotation, self._arm(now))
        speeds: NDArray[np.float64] = -np.degrees(np.linalg.lstsq(jacobian, moved, rcond=None)[0])
        return speeds

    def _arm(self, now: NDArray[np.float64]) -> NDArray[np.float64]:
        arm: NDArray[np.float64] = self.eyes.fixation_point(now) - self.eyes.head_pose(now)[:3, 3]
        return arm

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
