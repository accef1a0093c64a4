"""Torque control gravity consistency: at rest the measured torques are those that the model needs against gravity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot_testing import RobotTest, Safety, fit_line, likely_causes
from rtf.robot_testing.gravity import GravityModel
from rtf.robot_testing.start_position import bring, hold
from rtf.robot_testing.torque_control import greatest_torque, mean_torques, torque_joints
from rtf.simulator.errors import MissingPackageError
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part
    from rtf.robot_testing.statistics import Fit

#: The parts of an iCub, all of which decide what hangs where.
_PARTS = ("head", "torso", "left_arm", "right_arm", "left_leg", "right_leg")
#: All joints come to each posture from both sides, from so far (deg), so that friction cancels out; how fast (deg/s).
#: Of so short a way at 40 deg/s the whole limb feels nothing but beginning and end; at 10 its controllers gather on the
#: way there what they have to lose again on the way back, and 0.8 Nm of friction are left.
_APPROACH, _APPROACH_SPEED = 2.0, 20.0
#: No way to a posture is gone in less, s.
_SHORTEST = 0.2
#: How long joints come to rest, and for how long they are measured then, s. A controller takes about a second to gather
#: on either side what friction takes: measured sooner, it does not cancel out.
_REST, _MEASURING = 1.0, 0.2
#: A gain can be told when the model's torques spread by so much about their mean, Nm, in so many postures.
_SPREAD, _FEWEST = 0.3, 4
#: By so much a gain is off whose sign is wrong.
_INVERTED = 2.0
#: A gain is judged that is known so well; then a third of it and the double are found in any case.
_KNOWN = 0.4
#: What measures something differs by more from posture to posture, Nm: a mean of the same values is rounded.
_STILL = 1e-9


class TorqueControlGravityConsistency(RobotTest):
    """Puts each joint of a part into several static postures and compares what is measured with the model.

    The line through measured against model torques has a slope, the gain, and an offset; both have limits, and so has
    what is left. A gain is a sub-result of its own: skipped where gravity varies too little to tell it, as about an
    axis that is upright, but for a wrong sign; and inconclusive where what is measured scatters too much.
    """

    aliases = ("torqueControl-gravityConsistency", "torqueControlGravityConsistency")
    ignored_keys = ("wbi_conf_file", "local")  # of the original, which asked a server of models
    tags = ("motion", "torque", "sensors", "model")
    safety = Safety.MOTION

    part = Parameter(str, "the part whose torques are compared", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all with torque control", default=[])
    model = Parameter(str, "description of the robot (URDF); none: the iCub of the simulator", default="")
    postures = Parameter(int, "positions of each joint", default=5, low=2, high=50)
    swing = Parameter(float, "how far from home to both sides", unit="deg", default=35.0, low=1.0, high=90.0)
    speed = Parameter(float, "speed of all moves", unit="deg/s", default=40.0, low=0.1)
    offset = Parameter(float, "of the line, at most", unit="Nm", default=1.0, low=0.0)
    gain = Parameter(float, "by which its slope may differ from 1", default=0.25, low=0.0)
    error = Parameter(float, "measured minus model in a single posture, at most", unit="Nm", default=1.5, low=0.0)

    friction = Parameter(
        float, "of the torque range, where it is told, that friction may hide: these limits are not below it",
        unit="%",
        default=2.5, low=0.0,
    )  # fmt: skip

    def setup(self) -> None:
        """Open the part, and look where the others are."""
        super().setup()
        try:
            self.gravity = GravityModel(self.model)
        except MissingPackageError as error:
            self.skip(f"there is no model to compare with: {error}")
        self.robot_part = part = self.open_part(self.part)
        self.chosen = torque_joints(self, part, self.joints)
        unknown = [part.names[joint] for joint in self.chosen if part.names[joint] not in self.gravity]
        self.assert_error_if_true(unknown, f"the model has no joint {', '.join(unknown)}")
        self.others = [self.open_part(name) for name in _PARTS if name != self.part and self._is_there(name)]

    def _is_there(self, name: str) -> bool:
        return self.network.names.query(f"/{self.robot_name}/{name}/rpc:i") is not None

    def run(self) -> None:
        """Measure all postures; then judge joint by joint."""
        part = self.robot_part
        measured: list[FloatArray] = []
        wanted: list[FloatArray] = []
        hold(part, self.chosen)
        for place, joint in enumerate(self.chosen):
            self.progress(place / len(self.chosen), part.names[joint])
            with self.subresult(f"{part.names[joint]} in all postures"):
                try:
                    for position in self._positions(part, joint):
                        # Friction is opposite on the two sides: one alone says nothing, should the other fail.
                        sides = [self._measure(part, joint, position, side) for side in (-1.0, 1.0)]
                        torques, models = np.mean(sides, axis=0)
                        measured.append(torques)
                        wanted.append(models)
                    self.check(True, f"{part.names[joint]}: {self.postures} postures")
                finally:
                    hold(part, [joint])
                    part.move([part.home[joint]], [joint], speed=self.speed)
        self.assert_error_if_true(len(measured) < _FEWEST, "too few postures could be measured")
        self._judge_all(part, np.array(measured), np.array(wanted))

    def _positions(self, part: Part, joint: int) -> FloatArray:
        margin = _APPROACH + 1.0
        low = max(part.low[joint] + margin, part.home[joint] - self.swing)
        high = min(part.high[joint] - margin, part.home[joint] + self.swing)
        return np.linspace(low, max(low, high), self.postures)

    def _measure(self, part: Part, joint: int, position: float, side: float) -> tuple[FloatArray, FloatArray]:
        """Come to a position from one side; the measured torques of the chosen joints, and the model's."""
        for away, fastest in ((side * _APPROACH, self.speed), (0.0, _APPROACH_SPEED)):
            self._move_others(part, joint, away)
            target = position + away
            speed = min(fastest, max(_APPROACH_SPEED, abs(target - part.board.encoder(joint)) / _SHORTEST))
            bring(self, part, [joint], [target], speed=speed, tolerance=0.5 if away else 1.0)
        part.wait(_REST)
        torques = mean_torques(part, _MEASURING)
        here: dict[str, float] = {}
        for one in (part, *self.others):
            here.update(zip(one.names, one.board.encoders().tolist(), strict=True))
        model = self.gravity.torques(here)
        return torques[self.chosen], np.array([model[part.names[chosen]] for chosen in self.chosen])

    def _move_others(self, part: Part, joint: int, away: float) -> None:
        """Send the other chosen joints so far from home, for friction hides in what rests; nobody waits for them."""
        others = [one for one in self.chosen if one != joint]
        places = np.clip(part.home[others] + away, part.low[others], part.high[others])
        part.board.set_reference_speeds([_APPROACH_SPEED] * len(others), others)
        part.board.position_move(places, others)

    def _judge_all(self, part: Part, measured: FloatArray, wanted: FloatArray) -> None:
        for place, joint in enumerate(self.chosen):
            with self.subresult(part.names[joint]):
                most = greatest_torque(part.board, joint)
                if most is None:
                    self.report(
                        f"{part.names[joint]}: its torque range is not told, so that nothing is left to friction"
                    )
                hidden = self.friction / 100.0 * (most or 0.0)
                self._judge(part.names[joint], measured[:, place], wanted[:, place], hidden)

    def _judge_gain(self, name: str, line: Fit, spread: float, hides: float) -> None:
        """A gain is wrong when it surely is: on the robot's side is the statistics' own doubt, which may not be large.

        So is what friction ``hides`` (Nm), unless gravity varies by more.
        """
        little = f"{name}: gravity varies by {spread:.2f} Nm in these postures, too little to tell"
        if hides >= _INVERTED * spread:
            self.skip(f"{little} a gain")
        known = spread > hides
        allowed = self.gain + line.slope_interval + (0.0 if known else hides / spread)
        hint = f"{name} measures {line.slope:.2f} Nm for each Nm of gravity; {likely_causes('torque gain')}"
        self.measure("gain", line.slope, "", low=1.0 - allowed, high=1.0 + allowed, hint=hint)
        if not known:
            self.skip(f"{little} more of a gain than whether its sign is surely wrong")
        if not line.slope_interval <= max(_KNOWN, self.gain):
            self.inconclusive(
                f"{name}: what is measured scatters so much that its gain is only known to {line.slope_interval:.2f}: "
                "more postures, or a larger swing"
            )

    def _judge(self, name: str, measured: FloatArray, model: FloatArray, hidden: float) -> None:
        order = np.argsort(model)
        self.record("against the model", model=(model[order], "Nm"), measured=(measured[order], "Nm"))
        self.assert_fail_if_true(
            float(np.ptp(measured)) <= _STILL,
            f"{name} measures {measured[0]:g} Nm in all postures; {likely_causes('torque dead')}",
        )
        line, spread = fit_line(model, measured), float(np.std(model))
        hides = max(_SPREAD, hidden / 2)
        with self.subresult("gain"):
            self._judge_gain(name, line, spread, hides)
        # Where the gain can be told the offset is that of the line; elsewhere the mean difference.
        offset = line.offset if spread > hides else float(np.mean(measured - model))
        most = max(self.offset, hidden)
        hint = f"{name} measures {offset:+.2f} Nm beyond gravity; {likely_causes('torque offset')}"
        self.measure("offset", offset, "Nm", low=-most, high=most, hint=hint)
        worst = float(np.abs(measured - model).max())
        hint = (
            f"{name} measures up to {worst:.2f} Nm else than gravity; {likely_causes('torque offset', 'torque gain')}"
        )
        self.measure("greatest error", worst, "Nm", high=max(self.error, 2 * hidden), hint=hint)
        self.measure("left over, root mean square", line.rms, "Nm")
