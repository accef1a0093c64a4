"""Torque control gravity consistency: at rest the measured torques are those of the gravity model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.model.errors import MissingPackageError
from rtf.robot_testing import RobotTest, Safety, fit_line, likely_causes
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.gravity import GravityModel
from rtf.robot_testing.motion.start_position import bring, hold
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.torque_control import greatest_torque, mean_torques, torque_joints
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Part
    from rtf.robot_testing.judging.statistics import Fit

#: The parts of an iCub: the postures of all parts determine the torques.
_PARTS = ("head", "torso", "left_arm", "right_arm", "left_leg", "right_leg")
#: All joints approach each posture from both sides, so that friction cancels out: the distance (deg) and the speed
#: (deg/s). At 40 deg/s the acceleration at both ends disturbs the whole limb; at 10 deg/s the integrals of the
#: controllers change too much, and 0.8 Nm of friction remain.
_APPROACH, _APPROACH_SPEED = 2.0, 20.0
#: The least duration of a move to a posture, s.
_SHORTEST = 0.2
#: Time for joints to come to rest, and time of measurement, s. The integral of a controller takes about a second to
#: compensate friction: measured earlier, friction does not cancel out.
_REST, _MEASURING = 1.0, 0.2
#: Least standard deviation of the model's torques (Nm), and least number of postures, to determine a gain.
_SPREAD, _FEWEST = 0.3, 4
#: The error of a gain with the wrong sign.
_INVERTED = 2.0
#: The widest interval of a gain that is judged; errors by factors of 3 and 2 are then found in any case.
_KNOWN = 0.4
#: The least variation of measured torques between postures, Nm; below it they are constant up to rounding.
_STILL = 1e-9


class TorqueControlGravityConsistency(RobotTest):
    """Moves each joint of a part to several static postures, and compares measured torques with the gravity model.

    The line through measured over model torques has a slope, the gain, and an offset; both have limits, and so have the
    residuals. The gain has a sub-result of its own: skipped if gravity varies too little to determine it, as for an
    upright axis, except for a wrong sign; and inconclusive if the measurements scatter too much.
    """

    aliases = ("torqueControl-gravityConsistency", "torqueControlGravityConsistency")
    ignored_keys = ("wbi_conf_file", "local")  # of the C++ test, which used a model server
    tags = ("motion", "torque", "sensors", "model")
    safety = Safety.MOTION
    torque_control = True

    part = Parameter(str, "the part whose torques are compared", default="left_arm")
    joints = Parameter(list[int], "its joints; none: all with torque control", default=[])
    model = Parameter(str, "description of the robot (URDF); none: the iCub of the simulator", default="")
    postures = Parameter(int, "positions of each joint", default=5, low=2, high=50)
    swing = Parameter(float, "distance from home to both sides", unit="deg", default=35.0, low=1.0, high=90.0)
    speed = Parameter(float, "speed of all moves", unit="deg/s", default=40.0, low=0.1)
    offset = Parameter(float, "greatest offset of the line", unit="Nm", default=1.0, low=0.0)
    gain = Parameter(float, "greatest difference of its slope from 1", default=0.25, low=0.0)
    error = Parameter(
        float, "greatest difference of measurement and model in a posture", unit="Nm", default=1.5, low=0.0
    )

    friction = Parameter(
        float, "share of the reported torque range that friction may hide; the least value of these limits",
        unit="%",
        default=2.5, low=0.0,
    )  # fmt: skip

    def setup(self) -> None:
        """Open the part, and the other parts to read their positions."""
        super().setup()
        try:
            self.gravity = GravityModel(robot_model(self), self.model)
        except MissingPackageError as error:
            self.skip(f"there is no model to compare with: {error}")
        self.robot_part = part = self.open_part(self.part)
        self.chosen = torque_joints(self, part, self.joints)
        unknown = [part.names[joint] for joint in self.chosen if part.names[joint] not in self.gravity]
        self.assert_error_if_true(unknown, f"the model has no joint {', '.join(unknown)}")
        self.others = [self.open_part(name) for name in _PARTS if name != self.part and self.has_part(name)]

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
                    try:
                        for position in self._positions(part, joint):
                            # Friction has opposite signs on the two sides, so a posture needs both.
                            sides = [self._measure(part, joint, position, side) for side in (-1.0, 1.0)]
                            torques, models = np.mean(sides, axis=0)
                            measured.append(torques)
                            wanted.append(models)
                    finally:
                        hold(part, [joint])
                        part.move([part.home[joint]], [joint], speed=self.speed)
                except GuardError as error:
                    self.blame(part, error, "runs away", joints=[joint])
                self.check(True, f"{part.names[joint]}: {self.postures} postures")
        self.assert_error_if_true(len(measured) < _FEWEST, "too few postures could be measured")
        self._judge_all(part, np.array(measured), np.array(wanted))

    def _positions(self, part: Part, joint: int) -> FloatArray:
        margin = _APPROACH + 1.0
        low = max(part.low[joint] + margin, part.home[joint] - self.swing)
        high = min(part.high[joint] - margin, part.home[joint] + self.swing)
        return np.linspace(low, max(low, high), self.postures)

    def _measure(self, part: Part, joint: int, position: float, side: float) -> tuple[FloatArray, FloatArray]:
        """Approach a position from one side; return the measured torques of the chosen joints, and the model's."""
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
        """Move the other chosen joints by ``away`` deg from home, as friction cancels only in motion; do not wait."""
        others = [one for one in self.chosen if one != joint]
        places = np.clip(part.home[others] + away, part.low[others], part.high[others])
        part.board.set_reference_speeds([_APPROACH_SPEED] * len(others), others)
        part.command_move(places, others)

    def _judge_all(self, part: Part, measured: FloatArray, wanted: FloatArray) -> None:
        for place, joint in enumerate(self.chosen):
            with self.subresult(part.names[joint]):
                most = greatest_torque(part.board, joint)
                if most is None:
                    self.report(
                        f"{part.names[joint]}: the board does not report its torque range: no tolerance for friction"
                    )
                hidden = self.friction / 100.0 * (most or 0.0)
                self._judge(part.names[joint], measured[:, place], wanted[:, place], hidden)

    def _judge_gain(self, name: str, line: Fit, spread: float, hides: float) -> None:
        """Judge the gain. The tolerance includes its confidence interval, whose width is limited.

        It also includes the torque that friction ``hides`` (Nm), unless gravity varies by more.
        """
        little = f"{name}: gravity varies by {self.as_text(spread, 'Nm')} in these postures, too little to determine"
        if hides >= _INVERTED * spread:
            self.skip(f"{little} a gain")
        known = spread > hides
        allowed = self.gain + line.slope_interval + (0.0 if known else hides / spread)
        hint = f"{name} measures {line.slope:.2f} times the load of gravity; {likely_causes('torque gain')}"
        self.measure("gain", line.slope, "", low=1.0 - allowed, high=1.0 + allowed, hint=hint)
        if not known:
            self.skip(f"{little} more than a wrong sign of the gain")
        if not line.slope_interval <= max(_KNOWN, self.gain):
            self.inconclusive(
                f"{name}: the torques scatter too much: the interval of the gain is {line.slope_interval:.2f}; use "
                "more postures, or a larger swing"
            )

    def _judge(self, name: str, measured: FloatArray, model: FloatArray, hidden: float) -> None:
        order = np.argsort(model)
        self.record("against the model", model=(model[order], "Nm"), measured=(measured[order], "Nm"))
        self.assert_fail_if_true(
            float(np.ptp(measured)) <= _STILL,
            f"{name} measures {self.as_text(measured[0], 'Nm', 'g')} in all postures; {likely_causes('torque dead')}",
        )
        line, spread = fit_line(model, measured), float(np.std(model))
        hides = max(_SPREAD, hidden / 2)
        with self.subresult("gain"):
            self._judge_gain(name, line, spread, hides)
        # The offset is that of the line if the gain is known, otherwise the mean difference.
        offset = line.offset if spread > hides else float(np.mean(measured - model))
        most = max(self.offset, hidden)
        hint = f"{name} measures {self.as_text(offset, 'Nm', '+.2f')} beyond gravity; {likely_causes('torque offset')}"
        self.measure("offset", offset, "Nm", low=-most, high=most, hint=hint)
        worst = float(np.abs(measured - model).max())
        hint = (
            f"{name} measures up to {self.as_text(worst, 'Nm')} apart from gravity; "
            f"{likely_causes('torque offset', 'torque gain')}"
        )
        self.measure("greatest error", worst, "Nm", high=max(self.error, 2 * hidden), hint=hint)
        self.measure("left over, root mean square", line.rms, "Nm")
