"""The Cartesian controller: moves the tip of a chain whose joints are those of a board.

A target goes to the inverse kinematics, whose posture :class:`~rtf.robot.controllers.cartesian.CartesianMotion` leads
the joints to, by direct positions in every period. A motion is done when planned and measured tip are within the
tolerance of the posture's pose; so a target out of reach has an end, too, at the nearest pose.

Left out: feedback by the setpoints of the board, and streamed velocities of boards without direct positions.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, as_float, as_list, as_string
from rtf.robot.cartesian.settings import ChainSettings, Settings
from rtf.robot.cartesian.solvers import OwnSolver, Problem
from rtf.robot.control_modes import ControlMode
from rtf.robot.controllers.cartesian import CartesianMotion
from rtf.robot.controllers.task import TaskController
from rtf.robot.errors import RefusedError, RobotError
from rtf.robot.interfaces import ControllerEvent, IControlLimits, IControlMode, IEncoders, IPositionDirect
from rtf.robot.interfaces.cartesian import CartesianPose, CartesianSolution, ICartesianControl
from rtf.robot.kinematics import rotation_of, vector_of
from rtf.robot.kinematics.poses import POSE, POSITION, homogeneous
from rtf.robot.network.request_table import finite

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from rtf.robot.cartesian.solvers import PoseSolver
    from rtf.robot.device import Device
    from rtf.robot.interfaces.axes import FloatArray, Values
    from rtf.robot.kinematics import Chain

#: A trajectory takes at least so many periods.
_SHORTEST = 10
#: Periods between two targets of a streamed velocity, and between two looks at the modes of the joints.
_STREAMED, _LOOK = 4, 10
#: A pose is kept by tracking: it is solved again when another joint of the chain has moved by this (deg, m).
_MOVED = 1.0
_BROKEN = frozenset({ControlMode.HARDWARE_FAULT, ControlMode.IDLE, ControlMode.NOT_CONFIGURED})


class CartesianController(ChainSettings, TaskController[Settings], ICartesianControl):
    """A controller of a board whose axes are the joints of a chain, in its order (see ``controlboardremapper``).

    ``active`` joints take part in motions at first; those ``together`` are only switched together. ``solver`` has the
    postures; None: one of this process. ``publish`` is called every ``period`` (s), with the robot's time; all other
    methods in any thread. Errors of the board are passed on, and end a motion.

    No lock is held while a board is called by ``publish``, nor a lock that ``publish`` takes while one is called by
    others: boards of a simulation wait for its loop, which may be what calls ``publish``.
    """

    def __init__(
        self,
        board: Device,
        chain: Chain,
        *,
        active: Sequence[bool] | None = None,
        together: Collection[str] = (),
        solver: PoseSolver | None = None,
        period: float = 0.01,
        info: Sequence[tuple[str, str]] = (),
    ) -> None:
        self.period = period
        self._encoders = board.view(IEncoders)  # type: ignore[type-abstract]  # it is only looked for
        self._modes = board.view(IControlMode)  # type: ignore[type-abstract]  # it is only looked for
        self._direct = board.view(IPositionDirect)  # type: ignore[type-abstract]  # it is only looked for
        limits = board.view(IControlLimits)  # type: ignore[type-abstract]  # it is only looked for
        lock = threading.RLock()
        within = chain.limited({joint: limits.limits(place) for place, joint in enumerate(chain.joints)})
        ChainSettings.__init__(self, within, active=active, together=together, lock=lock)
        TaskController.__init__(self, self.settings, lock)
        self._solver = solver or OwnSolver()
        self._info = info
        self._commands = threading.RLock()  # one command at a time; ``publish`` does not take it
        self._target: FloatArray | None = None  # the pose, or the position, that is being reached
        self._motion: CartesianMotion | None = None
        self._solution: CartesianSolution | None = None
        self._moving = False
        self._stops = 0  # how often it was stopped: a motion that is being prepared does not begin after a stop
        self._began: FloatArray = np.zeros(len(chain))  # deg, of the active joints
        self._blocked: FloatArray = np.zeros(len(chain))  # deg, when it was solved
        self._velocity: FloatArray | None = None
        self._virtual: FloatArray = np.eye(4)  # the target of a streamed velocity
        self._asked: FloatArray | None = None  # the target whose solution is awaited, while the chain moves
        self._periods = 0

    # Motions ---------------------------------------------------------------------------------------------------------

    def go_to(self, target: Values, duration: float | None = None) -> None:
        with self._commands:
            stops = self._stops
            if duration is not None and duration > 0.0:
                self.set_trajectory_time(duration)
            goal = np.atleast_1d(np.asarray(target, dtype=np.float64))
            places = self.active_places()
            if not places:
                raise RefusedError(f"{self._chain.name}: no joint is active")
            self._check(places)
            measured = self._encoders.encoders()
            found = self._solver.solve(self._problem(goal, self._start(measured), attempts=6))
            self._direct_mode(places)
            with self.lock:
                if self._stops != stops:
                    raise RefusedError(f"{self._chain.name}: it was stopped before the motion began")
                self._velocity = None
                happened = self._begin(goal, found, measured)
        self.notify(happened)

    def stream_target(self, target: Values, duration: float | None = None) -> None:
        self.go_to(target, duration)

    def stream_velocity(self, velocity: Values) -> None:
        values = np.atleast_1d(np.asarray(velocity, dtype=np.float64))
        if values.shape != (POSE,) or not np.isfinite(values).all():
            raise RefusedError(f"a velocity has seven numbers, not {values.tolist()}")
        with self._commands:
            stops = self._stops
            stands = not values[:3].any() and values[6] == 0.0
            pose = self._present_pose()
            if not stands:
                self._direct_mode(self.active_places())
            with self.lock:
                if self._stops != stops:
                    raise RefusedError(f"{self._chain.name}: it was stopped before the motion began")
                if self._velocity is None:
                    self._virtual = pose
                self._velocity = None if stands else values

    def stop(self) -> None:
        with self.lock:  # not that of commands: one that waits for a board does not keep the robot from stopping
            self._stops += 1
            happened = self._end(clock.current().now())
        self.notify(happened)

    def motion_done(self) -> bool:
        with self.lock:
            return not self._moving and self._velocity is None

    def ask(self, target: Values, start: Values | None = None) -> CartesianSolution:
        with self._commands:
            present = self._encoders.encoders()
            if start is not None:
                given = np.atleast_1d(np.asarray(start, dtype=np.float64))
                places = self.active_places()
                if given.size != len(places):
                    raise RefusedError(
                        f"{len(places)} joints are active, so a start has as many values, not {given.size}"
                    )
                present = present.copy()
                present[places] = given
            goal = np.atleast_1d(np.asarray(target, dtype=np.float64))
            return self._solver.ask(self._problem(goal, present, attempts=6))

    def _start(self, measured: FloatArray) -> FloatArray:
        """Return where a solution starts: a motion under way goes on from where it is planned to be."""
        with self.lock:
            start = measured.copy()
            if self._moving and self._motion is not None:
                start[self.active_places()] = self._motion.planned
            return start

    def _begin(self, target: FloatArray, found: CartesianSolution, measured: FloatArray) -> list[ControllerEvent]:
        """Begin a motion, or lead the present one elsewhere; with the lock held."""
        places, events = self.active_places(), []
        if not self._moving:
            self._motion = CartesianMotion(
                self._active_chain(measured),
                period=self.period,
                duration=self.settings.duration,
                straightness=self.settings.straightness,
            )
            self._motion.reset(measured[places])
            self._moving = True
            events.append(ControllerEvent("motion-onset", clock.current().now()))
        assert self._motion is not None
        self._motion.duration = self.settings.duration
        self._motion.begin(found.joints[places], has_orientation=target.size > POSITION)
        self._target, self._solution = target, found
        self._began, self._blocked = self._motion.planned, measured
        self.begin_checkpoints()
        return events

    def _problem(self, target: FloatArray, start: FloatArray, *, attempts: int) -> Problem:
        return Problem(self.limited, self.settings, target, start, attempts)

    def _active_chain(self, measured: FloatArray) -> Chain:
        """The chain of the active joints; the others are where they have been measured."""
        joints = self._chain.joints
        return self.tipped.blocked({joints[place]: float(measured[place]) for place in self.other_places()})

    def _check(self, places: Sequence[int]) -> None:
        """Refuse joints that cannot move."""
        broken = [
            f"{self._chain.joints[place]} is in mode {mode.name}"
            for place, mode in zip(places, self._modes.control_modes(places), strict=True)
            if mode in _BROKEN
        ]
        if broken:
            raise RefusedError(f"{'; '.join(broken)}: the chain is not moved")

    def _direct_mode(self, places: Sequence[int]) -> None:
        modes = self._modes.control_modes(places)
        others = [place for place, mode in zip(places, modes, strict=True) if mode is not ControlMode.POSITION_DIRECT]
        if others:
            self._modes.set_control_modes(ControlMode.POSITION_DIRECT, others)

    # A period --------------------------------------------------------------------------------------------------------

    def publish(self, now: float) -> None:
        """Do what a period needs, at the robot's time. Raises RobotError, and a motion ends, for boards that fail."""
        self._periods += 1
        if not self._at_work():
            return
        try:
            if self._periods % _LOOK == 0 and self._moving:
                self._check(self.active_places())
            measured = self._encoders.encoders()
            with self.lock:
                places = self.active_places()
                events, positions = self._step(now, measured)
            if positions is not None:
                self._direct.set_positions(positions, places)
        except RobotError as error:
            with self.lock:
                happened = self._end(now)
            self.notify(happened)
            raise type(error)(f"the motion was ended: {error}") from error
        self.notify(events)

    def _at_work(self) -> bool:
        with self.lock:
            keeps = self.settings.tracking and self._target is not None
            return self._moving or self._velocity is not None or keeps

    def _step(self, now: float, measured: FloatArray) -> tuple[list[ControllerEvent], FloatArray | None]:
        """Return events, and positions of the active joints to command; with the lock held."""
        events = self._lead(measured)
        if not self._moving or self._motion is None:
            return events, None
        positions = self._motion.step()
        events += self.pass_checkpoints(self._motion.share(self._began), now)
        places = self.active_places()
        if self._velocity is None and self._motion.done(measured[places], self.settings.tolerance):
            events += self.pass_checkpoints(1.0, now)
            events += self._end(now, keep=self.settings.tracking)
        return events, positions

    def _lead(self, measured: FloatArray) -> list[ControllerEvent]:
        """Ask for the solution of a target that moves, or that other joints move away from; take one that is there."""
        if self._velocity is not None and self._periods % _STREAMED == 0:
            self._advance(self._velocity, _STREAMED * self.period)
            self._ask(vector_of(self._virtual), measured)
        elif self.settings.tracking and self._target is not None and self._velocity is None:
            others = self.other_places()
            if others and float(np.linalg.norm(measured[others] - self._blocked[others])) > _MOVED:
                self._moving = False  # a chain with other blocked joints
                self._blocked = measured
                self._ask(self._target, measured)
        found = self._solver.answer() if self._asked is not None else None
        if found is None or self._asked is None:
            return []
        target, self._asked = self._asked, None
        return self._begin(target, found, measured)

    def _advance(self, velocity: FloatArray, seconds: float) -> None:
        """Lead a virtual target with a velocity."""
        turn = rotation_of(velocity[3:6], float(velocity[6]) * seconds) if velocity[6] else np.eye(3)
        place = self._virtual[:3, 3] + velocity[:3] * seconds
        self._virtual = homogeneous(turn @ self._virtual[:3, :3], place)

    def _ask(self, target: FloatArray, measured: FloatArray) -> None:
        self._solver.request(self._problem(target, self._start(measured), attempts=1))
        self._asked = target

    def _end(self, now: float, *, keep: bool = False) -> list[ControllerEvent]:
        """End a motion; the joints hold their last setpoints."""
        self._velocity = self._asked = None
        if not keep:
            self._target = None
        was, self._moving = self._moving, False
        return [ControllerEvent("motion-done", now)] if was else []

    # State -----------------------------------------------------------------------------------------------------------

    def pose(self, link: int | None = None) -> CartesianPose:
        positions, times = self._encoders.encoders(), self._encoders.encoder_times()
        chain = self.tipped
        if link is not None and not 0 <= link < len(chain):
            raise RefusedError(f"{chain.name} has links 0 to {len(chain) - 1}, not {link}")
        pose = chain.pose(positions) if link is None else chain.frames(positions)[link]
        return CartesianPose(vector_of(pose), float(np.max(times)))

    def _present_pose(self) -> FloatArray:
        return self.tipped.pose(self._encoders.encoders())

    def desired(self) -> CartesianSolution:
        with self.lock:
            found = self._solution
        if found is None:
            return CartesianSolution(vector_of(self._present_pose()), self._encoders.encoders())
        return found

    def joint_velocities(self) -> FloatArray:
        with self.lock:
            moving = self._motion is not None and self._moving
            return self._motion.speeds if self._motion is not None and moving else np.zeros(len(self.active_places()))

    def task_velocity(self) -> FloatArray:
        with self.lock:
            if self._motion is None or not self._moving:
                return np.zeros(POSE)
            chain = self._motion.chain
            rates = chain.jacobian(self._motion.planned) @ (self._motion.speeds * chain.internal)
        speed = float(np.linalg.norm(rates[3:]))
        axis = rates[3:] / speed if speed else np.array([0.0, 0.0, 1.0])
        return np.concatenate([rates[:3], axis, [speed]])

    def solver_connected(self) -> bool:
        return self._solver.connected()

    def info(self) -> Bottle:
        events = Bottle(["motion-onset", "motion-done", "motion-ongoing", "closing", "*"])
        return Bottle([*(Bottle([key, value]) for key, value in self._info), Bottle(["events", events])])

    # Settings --------------------------------------------------------------------------------------------------------

    def set_active_joints(self, active: Sequence[bool | None]) -> tuple[bool, ...]:
        with self._commands, self.lock:
            happened = self._end(clock.current().now())
            chosen = super().set_active_joints(active)
        self.notify(happened)
        return chosen

    def trajectory_time(self) -> float:
        return self.settings.duration

    def set_trajectory_time(self, duration: float) -> None:
        self.change(duration=max(finite(duration), _SHORTEST * self.period))

    def tolerance(self) -> float:
        return self.settings.tolerance

    def set_tolerance(self, tolerance: float) -> None:
        self.change(tolerance=finite(tolerance))

    def tracking(self) -> bool:
        return self.settings.tracking

    def set_tracking(self, tracking: bool) -> None:
        self.change(tracking=tracking)

    def reference_feedback(self) -> bool:
        return False

    def set_reference_feedback(self, feedback: bool) -> None:
        if feedback:
            raise RefusedError("the setpoints of the board are not used as feedback")

    def tweaks(self) -> Bottle:
        return Bottle([Bottle(["straightness", self.settings.straightness])])

    def set_tweaks(self, tweaks: Bottle) -> None:
        for one in tweaks:
            pair = as_list(one)
            if pair is None or len(pair) < 2 or as_string(pair[0]) != "straightness":  # noqa: PLR2004 - key, value
                raise RefusedError(f"a tweak is (straightness VALUE), not {Bottle([one]).to_text()}")
            self.change(straightness=max(0.0, finite(as_float(pair[1]))))

    # Contexts --------------------------------------------------------------------------------------------------------

    def context(self) -> Settings:
        return self.settings

    def restore_context(self, context: int) -> None:
        with self._commands, self.lock:
            settings = self.stored(context)
            happened = self._end(clock.current().now())
            self.use(settings)
        self.notify(happened)
