"""Arbitration: two programs command one joint, and a reflex takes it from a reach for two seconds.

Both send positions to one port. The reflex' connection sets an event with each message, and that of the reach passes
messages only while the event is not set; nobody else has to know of the other. What the port gets moves the joint.
"""

from __future__ import annotations

import math
from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle
from rtf.middleware.ports.port import Port
from rtf.robot.control_modes import ControlMode
from rtf.robot_testing import GuardError, Part, RobotTest
from rtf.robot_testing.guard.safety import Safety
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.middleware.wire.incoming_message import IncomingMessage

_PERIOD = 0.02
_REFLEX = "tcp+recv.portmonitor+type.py+file.event+name.e_reflex+ms.{:.0f}"
_REACH = "tcp+recv.portmonitor+type.py+file.only+constraint.not.e_reflex"


class ReflexWins(RobotTest):
    """Has a slow reach and a reflex command a joint, and records who does."""

    safety = Safety.MOTION

    part = Parameter(str, "the part of the joint", default="left_arm")
    joint = Parameter(str, "the joint", default="l_elbow")
    lifetime = Parameter(float, "for how long the reflex has the joint", unit="s", default=2.0, low=0.1)
    speed = Parameter(float, "of the joint at most", unit="deg/s", default=30.0, low=1.0, high=60.0)

    def setup(self) -> None:
        """Open the part, and the ports of the two programs."""
        super().setup()
        self.limb = self.open_part(self.part)
        self.number = self.limb.joint(self.joint)
        self.messages: list[tuple[float, str, float]] = []
        opened = ExitStack()
        self.add_cleanup(opened.close)
        self.arbiter = opened.enter_context(Port("/arbiter", self._take, network=self.network, outputs=False))
        self.reach = opened.enter_context(Port("/reach", network=self.network, inputs=False))
        self.reflex = opened.enter_context(Port("/reflex", network=self.network, inputs=False))
        self.reach.add_output("/arbiter", _REACH)
        self.reflex.add_output("/arbiter", _REFLEX.format(1000 * self.lifetime))

    def _take(self, message: IncomingMessage) -> None:
        """Keep what has passed, and who has sent it."""
        self.messages.append((self.now(), message.sender, float(message.read()[0])))

    def run(self) -> None:
        """Reach, be interrupted by the reflex, and reach on."""
        limb, joint = self.limb, self.number
        middle = limb.within(joint, 0.5)
        limb.move([middle], [joint])
        limb.set_mode(ControlMode.POSITION_DIRECT, [joint])
        try:
            self._command(limb, joint, middle)
        except GuardError as error:
            self.blame(limb, error, "runs away", joints=[joint], during="arbitration")
        finally:
            limb.set_mode(ControlMode.POSITION, [joint])
        self._judge()

    def _command(self, limb: Part, joint: int, middle: float) -> None:
        times, targets, positions = [], [], []
        begin, target, struck = self.now(), middle, False
        while (elapsed := self.now() - begin) < 2.0 + 2 * self.lifetime:
            self.reach.write(Bottle([middle + 10.0 * math.sin(elapsed)]))
            if elapsed >= 1.0 and not struck:
                self.reflex.write(Bottle([middle - 15.0]))
                struck, self.struck = True, self.now()
            step = self.speed * _PERIOD
            target += min(max(self.messages[-1][2] - target, -step), step)
            limb.board.set_positions(target, joint)
            limb.wait(_PERIOD, pace=_PERIOD)
            times.append(self.now() - begin)
            targets.append(target)
            positions.append(limb.board.encoder(joint))
        self.begin = begin
        self.record("elbow", time=(np.array(times), "s"), target=(targets, "deg"), position=(positions, "deg"))

    def _judge(self) -> None:
        """Check who has commanded when, and draw it."""
        when = np.array([time for time, _, _ in self.messages])
        reflexes = np.array([sender == "/reflex" for _, sender, _ in self.messages])
        grid = np.arange(self.begin, when[-1], _PERIOD / 2)
        has = reflexes[np.clip(np.searchsorted(when, grid, side="right") - 1, 0, None)]
        self.record(
            "who commands", time=(grid - self.begin, "s"), reflex=(has.astype(float), ""), reach=(1.0 - has, "")
        )
        back = float(when[~reflexes & (when > self.struck)][0]) - self.struck
        self.measure("the reflex has the joint", back, "s", self.lifetime - _PERIOD, self.lifetime + 2 * _PERIOD)
        self.measure(
            "commands of the reach meanwhile",
            float(np.count_nonzero(~reflexes & (when > self.struck) & (when < self.struck + self.lifetime - _PERIOD))),
            "",
            high=0.0,
        )
