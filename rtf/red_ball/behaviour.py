"""What the robot of the demonstration does: it looks, follows the ball, stands still when it is lost, and goes home.

::

    IDLE --start--> LOOKING --there--> FOLLOWING <--seen/not seen--> LOST
      ^                                     |
      +-- HOMING <-- STOPPING <---stop------+   (from every state)

Hands move softly: one at a time, within a box in front of the robot. Any error of the robot ends in IDLE, with all
motions stopped and the reason reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from rtf.middleware.errors import MiddlewareError
from rtf.red_ball.hand import move_joints
from rtf.robot.errors import RobotError
from rtf.robot.interfaces.gaze import FixationPoint

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.red_ball.hand import Hand, Side
    from rtf.red_ball.target import Ball, Target
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray, IGazeControl
    from rtf.robot.interfaces.gaze import GazeAngles

#: The ball counts as lost when it was not seen for so long (s).
LOST_AFTER = 0.5
#: How far from the middle the ball has to be until the other hand takes over (m), as in the original.
_HYSTERESIS = 0.05
#: A ball that has moved less (m) is not looked at anew.
_SAME = 0.005
#: How long the first look and the torso's way home may take, and the rest after a stop (s).
_LOOK, _REST = 5.0, 1.1
#: Where the head looks at home (m), as in the original, and the speed of the torso (deg/s).
_AHEAD, _TORSO_SPEED = (-1.0, 0.0, 0.3), 10.0


class State(StrEnum):
    """What it does."""

    IDLE = "idle"  # nothing, until it is started
    LOOKING = "looking"  # it turns to where the ball is expected
    FOLLOWING = "following"  # it looks at the ball and reaches for it
    LOST = "lost"  # it does not see the ball, and the hands stand still
    STOPPING = "stopping"  # it rests before it goes home
    HOMING = "homing"  # the torso and the arms go home; then the head


@dataclass(frozen=True, slots=True)
class Parts:
    """What it moves: the gaze, hands with the torso, and the torso on its way home."""

    gaze: IGazeControl
    hands: Mapping[Side, Hand]
    torso: RemoteBoard


class Behaviour:
    """The behaviour. All calls come from one thread; ``report`` gets errors."""

    def __init__(self, parts: Parts, target: Target, report: Callable[[str], None]) -> None:
        self._parts = parts
        self._target = target
        self._report = report
        self._until = 0.0
        self._looked_at: FloatArray | None = None
        self._side: Side | None = None
        self.state = State.IDLE
        #: Why it is in this state; empty after a command.
        self.reason = ""

    def start(self, now: float, angles: GazeAngles | None) -> None:
        """Start: first look at angles, if there are any, then follow the ball. Raises RobotError."""
        self._looked_at = self._side = None
        if angles is None:
            self._follow_from_now()
            return
        self._parts.gaze.look_at(angles)
        self._become(State.LOOKING)
        self._until = now + _LOOK

    def stop(self, now: float) -> None:
        """Stop all motions, and go home after a rest. An error is reported."""
        self._halt()
        self._become(State.STOPPING)
        self._until = now + _REST

    def step(self, now: float) -> None:
        """Do what has to be done at ``now`` (s). Errors of the robot stop it."""
        try:
            self._act(now)
        except (RobotError, MiddlewareError) as error:
            self.give_up(str(error))

    def give_up(self, reason: str) -> None:
        """Stop all motions, and do nothing until it is started again."""
        self._report(f"everything is stopped: {reason}")
        self._halt()
        self._become(State.IDLE, reason)

    def _become(self, state: State, reason: str = "") -> None:
        self.state, self.reason = state, reason

    def _act(self, now: float) -> None:
        if self.state is State.LOOKING and (self._parts.gaze.motion_done() or now >= self._until):
            self._follow_from_now()
        elif self.state in (State.FOLLOWING, State.LOST):
            self._follow(now)
        elif self.state is State.STOPPING and now >= self._until:
            self._go_home(now)
        elif self.state is State.HOMING and (now >= self._until or self._parts.torso.motion_done()):
            self._parts.gaze.look_at(FixationPoint(np.array(_AHEAD)))  # now, as the torso turns the head
            self._become(State.IDLE)

    def _follow_from_now(self) -> None:
        self._target.forget()
        self._become(State.LOST, "the ball was not seen yet")

    def _follow(self, now: float) -> None:
        ball = self._target.look()
        if ball is None or now - ball.time > LOST_AFTER:
            self._lose(ball)
            return
        if self.state is State.LOST:
            self._become(State.FOLLOWING)
        if self._looked_at is None or np.linalg.norm(ball.place - self._looked_at) > _SAME:
            self._parts.gaze.look_at(FixationPoint(ball.place))
            self._looked_at = ball.place
        self._reach(ball.place)

    def _lose(self, ball: Ball | None) -> None:
        if self.state is State.LOST:
            return
        self._become(State.LOST, f"the ball was not seen for {LOST_AFTER:g} s" if ball else "the ball was not seen yet")
        for hand in self._parts.hands.values():
            if hand.moving:
                hand.stop()

    def _reach(self, ball: FloatArray) -> None:
        side = self._chosen(ball)
        if side is None:
            return
        hand = self._parts.hands[side]
        if side != self._side:
            self._change_hands(self._side, hand)
            self._side = side
        if hand.can_reach(ball):
            self.reason = ""
            hand.reach(ball)
        else:
            self.reason = f"the ball is out of reach of the {side} hand"
            if hand.moving:
                hand.stop()

    def _change_hands(self, before: Side | None, hand: Hand) -> None:
        """Let another hand have the torso."""
        if before is not None:
            self._parts.hands[before].stop()
            self._parts.hands[before].release()
            self._parts.hands[before].go_home()
        hand.prepare()

    def _chosen(self, ball: FloatArray) -> Side | None:
        """Return the hand for a ball: the left one to the left (-y), near the middle the one that was used."""
        y, hands = float(ball[1]), self._parts.hands
        near = self._side is not None and abs(y) < _HYSTERESIS
        wanted: Side | None = self._side if near else "left" if y < 0.0 else "right"
        return wanted if wanted in hands else next(iter(hands), None)

    def _go_home(self, now: float) -> None:
        self._become(State.HOMING)
        self._until = now + _LOOK
        move_joints(self._parts.torso, [0.0] * self._parts.torso.axes(), _TORSO_SPEED)
        for hand in self._parts.hands.values():
            hand.release()
            hand.go_home()

    def _halt(self) -> None:
        """Stop all motions. Errors are reported, so that one part does not keep the others from stopping."""
        self._side = None
        for stop in (*(hand.stop for hand in self._parts.hands.values()), self._parts.gaze.stop):
            try:
                stop()
            except (RobotError, MiddlewareError) as error:
                self._report(f"could not be stopped: {error}")
