"""Agreement of the encoders of joints and motors through the couplings: which of them is wrong, or exchanged.

Motor encoders and joint encoders measure the same motion twice: the turns of all rotors, by their gearbox ratios, are
``coupling @ joints``. Where they disagree, the simplest hypothesis that makes all of them agree names the culprit: a
single wrong encoder first, then two exchanged ones, each with the right or the wrong sign. Positions count relative to
the first state, so that zeros do not matter.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot_testing.judging.blame import Evidence
from rtf.robot_testing.judging.robust_line import slopes_between

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.robot.interfaces import FloatArray

#: An encoder stands still if it shows less than this share of the motion of the other one.
_STILL = 0.2
#: Encoders disagree without an outlier if their difference is explained by a ratio: less than this share is left.
_LEFT = 0.35


class Tolerance(NamedTuple):
    """The greatest difference of agreeing encoders: ``least`` (deg of the joint) and a share of the motion."""

    least: float = 2.0
    share: float = 0.25


class Motion(NamedTuple):
    """The motion of a part, all in deg: arrays (states, axes).

    ``turns`` are those of the rotors by their gearbox ratios, ``joints`` those of the joints, both from the first state
    on. ``coupling`` has a row for each motor, ``gearbox`` the ratios.
    """

    turns: FloatArray
    joints: FloatArray
    coupling: FloatArray
    gearbox: FloatArray

    @classmethod
    def of(cls, positions: FloatArray, motors: FloatArray, gearbox: FloatArray, coupling: FloatArray) -> Motion:
        """Return the motion by encoder readings (deg)."""
        return cls((motors - motors[0]) / gearbox, positions - positions[0], coupling, gearbox)

    @property
    def sizes(self) -> FloatArray:
        """The turn of each rotor for a degree of the joint that it moves most."""
        sizes: FloatArray = np.abs(self.coupling).max(axis=1)
        return sizes

    def differences(self, tolerance: Tolerance) -> FloatArray:
        """Return the differences of each motor's encoder and those of the joints, as shares of what is tolerated."""
        expected = self.joints @ self.coupling.T
        apart = np.ptp(self.turns - expected, axis=0) / self.sizes
        way = np.maximum(np.ptp(self.turns, axis=0), np.ptp(expected, axis=0)) / self.sizes
        shares: FloatArray = apart / (tolerance.least + tolerance.share * way)
        return shares

    def disagreeing(self, tolerance: Tolerance) -> list[int]:
        """Return the motors whose encoders disagree with those of the joints; NaN is no disagreement."""
        return [int(motor) for motor in np.flatnonzero(self.differences(tolerance) > 1.0)]

    def shown_as(self, joints: FloatArray | None = None, turns: FloatArray | None = None) -> Motion:
        """Return the motion with other readings."""
        return self._replace(
            joints=self.joints if joints is None else joints, turns=self.turns if turns is None else turns
        )


def encoder_evidence(
    motion: Motion, names: Sequence[str], tolerance: Tolerance | None = None, *, obeyed: bool = False
) -> list[Evidence]:
    """Return the evidence on wrong and exchanged encoders; none if all agree.

    Joint encoders are suspected first: controllers follow them, so that they explain a motion that went wrong. Joints
    that ``obeyed`` did go where they should: their encoders are not exchanged, for two controllers that see the joint
    of each other drive both away; and none counts the wrong way, so that motor encoders are suspected first. Where no
    hypothesis explains all disagreements, each motor is evidence by itself.
    """
    bounds = Tolerance() if tolerance is None else tolerance
    wrong = motion.disagreeing(bounds)
    if not wrong:
        return []
    disturbed, calm = (_wrong_joint, _exchanged_joints, _exchanged_motors), (_exchanged_motors, _wrong_joint)
    for explain in calm if obeyed else disturbed:
        for evidence in explain(motion, wrong, names, bounds):
            return [evidence]
    return [_wrong_motor(motion, motor, names) for motor in wrong]


def _wrong_joint(motion: Motion, wrong: list[int], names: Sequence[str], bounds: Tolerance) -> Iterator[Evidence]:
    """Explain the disagreement by the encoder of one joint, which may show anything.

    Of several that could be wrong it is the one that leaves the smallest differences. A single motor's encoder may
    leave less than any: a joint that turns another motor as well, which agrees, is not accused for it.
    """
    found: list[tuple[float, Evidence]] = []
    for joint in _joints_of(motion, wrong):
        rows = np.flatnonzero(motion.coupling[:, joint])
        if not {*wrong} <= {*rows.tolist()}:
            continue
        column = motion.coupling[rows, joint]
        others, joints = motion.coupling[rows].copy(), motion.joints.copy()
        others[:, joint] = 0.0
        joints[:, joint] = (motion.turns[:, rows] - motion.joints @ others.T) @ column / float(column @ column)
        if not (shown := motion.shown_as(joints=joints)).disagreeing(bounds):
            evidence = _disagreement(joint, names[joint], motion.joints[:, joint], joints[:, joint])
            found.append((_left_by(shown, bounds), evidence))
    if found and len(wrong) == 1:
        (motor,) = wrong
        turns = motion.turns.copy()
        turns[:, motor] = motion.joints @ motion.coupling[motor]
        found.append((_left_by(motion.shown_as(turns=turns), bounds), _wrong_motor(motion, motor, names)))
    if found:
        yield min(found, key=lambda one: one[0])[1]


def _left_by(explained: Motion, bounds: Tolerance) -> float:
    """Return the differences that an explanation leaves, without those of rounding."""
    return round(float(np.nansum(explained.differences(bounds))), 6)


def _wrong_motor(motion: Motion, motor: int, names: Sequence[str]) -> Evidence:
    """Accuse the encoder of one motor."""
    expected = (motion.joints @ motion.coupling[motor]) / motion.sizes[motor]
    return _disagreement(motor, names[motor], expected, motion.turns[:, motor] / motion.sizes[motor])


def _disagreement(joint: int, name: str, shown: FloatArray, true: FloatArray) -> Evidence:
    """Describe what a joint's encoder shows, and what that of its motor does."""
    joint_way, motor_way = float(np.ptp(shown)), float(np.ptp(true))
    seen = f"its motor moves it by {motor_way:.1f} deg by its encoder, and the joint's encoder shows {joint_way:.1f}"
    accused = frozenset({joint})
    if joint_way < _STILL * motor_way:
        return Evidence(accused, f"{name}: {seen}", ("frozen",))
    if motor_way < _STILL * joint_way:
        text = f"{name} moves by {joint_way:.1f} deg by its encoder, and its motor's encoder shows {motor_way:.1f}"
        return Evidence(accused, text, ("frozen", "drift"))
    slopes = slopes_between(true, shown)
    ratio = slopes.nearest(1.0)
    left = np.ptp(shown - ratio * true) / joint_way
    if left < _LEFT:
        if ratio < 0:
            return Evidence(accused, f"{name}: joint and motor encoder count in opposite directions", ("sign",))
        text = f"{name}: the joint's encoder shows {ratio:.2f} times the motion of the motor's"
        return Evidence(accused, text, ("ratio",))
    return Evidence(accused, f"{name}: joint and motor encoder disagree: {seen}", ("noise", "drift", "backlash"))


def _exchanged_joints(motion: Motion, wrong: list[int], names: Sequence[str], bounds: Tolerance) -> Iterator[Evidence]:
    """Explain the disagreement by two joint encoders that are exchanged."""
    turned = _joints_of(motion, wrong)
    motors = [int(motor) for motor in np.flatnonzero((motion.coupling[:, turned] != 0).any(axis=1))]
    for pair, signs in _pairs(_joints_of(motion, motors)):
        joints = motion.joints.copy()
        joints[:, pair] = joints[:, pair[::-1]] * signs
        if not motion.shown_as(joints=joints).disagreeing(bounds):
            yield _exchanged(pair, signs, names, "encoders")
            return


def _exchanged_motors(motion: Motion, wrong: list[int], names: Sequence[str], bounds: Tolerance) -> Iterator[Evidence]:
    """Explain the disagreement by two motor encoders that are exchanged."""
    for pair, signs in _pairs(wrong):
        turns = motion.turns.copy()
        other = pair[::-1]
        turns[:, pair] = turns[:, other] * signs * motion.gearbox[other] / motion.gearbox[pair]
        if not motion.shown_as(turns=turns).disagreeing(bounds):
            yield _exchanged(pair, signs, names, "motor encoders")
            return


def _pairs(axes: Sequence[int]) -> Iterator[tuple[list[int], FloatArray]]:
    """Yield all pairs with the signs of their encoders, those with the right signs first."""
    for signs in product((1.0, -1.0), repeat=2):
        for pair in combinations(axes, 2):
            yield [*pair], np.array(signs)


def _exchanged(pair: list[int], signs: FloatArray, names: Sequence[str], what: str) -> Evidence:
    turned = [names[axis] for axis, sign in zip(pair, signs, strict=True) if sign < 0]
    text = f"the {what} of {names[pair[0]]} and {names[pair[1]]} are swapped"
    if turned:
        text += f", and {' and '.join(turned)} {'counts' if len(turned) == 1 else 'count'} the wrong way"
    return Evidence(frozenset(pair), text, ("swapped encoders",))


def _joints_of(motion: Motion, motors: list[int]) -> list[int]:
    """Return the joints that some motors turn."""
    return [int(joint) for joint in np.flatnonzero((motion.coupling[motors] != 0).any(axis=0))]
