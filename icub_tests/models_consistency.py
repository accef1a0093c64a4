"""Models consistency: two kinematic models of the robot agree on the poses of its links."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rtf.errors import RtfError
from rtf.robot_testing import likely_causes
from rtf.robot_testing.judging.kinematics import rotation_vector
from rtf.robot_testing.judging.robot_description import read_description
from rtf.robot_testing.judging.simulated_kinematics import SimulatedKinematics
from rtf.robot_testing.robot_name import robot_model
from rtf.testing import Parameter, TestCase

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interfaces import FloatArray


class ModelsConsistency(TestCase):
    """Compares the poses of links in a robot description (URDF) with those of the simulator or of another description.

    The postures are random within the joint limits, several for each seed. It needs no robot.
    """

    aliases = ("iKiniDynConsistencyTest", "models-consistency", "modelsConsistency", "iKinIDynConsistencyTest")
    tags = ("model",)

    model = Parameter(str, "the description, a URDF file; none: the published one", default="")
    other = Parameter(str, "the model to compare with, a URDF file; none: the simulator's model", default="")
    links = Parameter(
        list[str], "the compared links", default=["l_hand", "r_hand", "l_foot", "r_foot", "head", "chest"]
    )
    seeds = Parameter(list[int], "seeds of the random postures", default=[147, 1, 2])
    postures = Parameter(int, "postures of each seed", default=20, low=1)
    tolerance = Parameter(float, "greatest distance of a link in the two models", unit="m", default=1e-3, low=0.0)
    turn_tolerance = Parameter(float, "greatest rotation between the two", unit="deg", default=0.1, low=0.0)

    def setup(self) -> None:
        """Read both models."""
        try:
            robot = robot_model(self)
            self.first = read_description(robot, self.model)
            self.second = read_description(robot, self.other) if self.other else SimulatedKinematics(robot)
        except RtfError as error:
            self.assert_error(f"cannot read a model: {error}")
        for link in self.links:
            for model in (self.first, self.second):
                self.assert_error_if_false(link in model.links, f"{model.place} has no link {link!r}")

    def run(self) -> None:
        """Compare link by link; a failure names the worst posture."""
        self.report(f"{self.first.place} against {self.second.place}")
        postures = [*self._postures()]
        for link in self.links:
            with self.subresult(link):
                self._judge_link(link, postures)

    def _postures(self) -> Iterator[dict[str, float]]:
        joints = sorted({joint for link in self.links for joint in self.first.chain(link)})
        limits = [self.first.limits(joint) for joint in joints]
        # A continuous joint has no limits.
        low = np.array([lower if math.isfinite(lower) else -math.pi for lower, _ in limits])
        high = np.array([upper if math.isfinite(upper) else math.pi for _, upper in limits])
        for seed in self.seeds:
            random = np.random.default_rng(seed)
            for _ in range(self.postures):
                yield dict(zip(joints, (low + (high - low) * random.random(len(joints))).tolist(), strict=True))

    def _judge_link(self, link: str, postures: list[dict[str, float]]) -> None:
        pairs = [(self.first.transform(link, one), self.second.transform(link, one)) for one in postures]
        apart = np.array([np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in pairs])
        turned = np.degrees([np.linalg.norm(rotation_vector(a[:3, :3].T @ b[:3, :3])) for a, b in pairs])
        numbers = np.arange(len(postures))
        self.record("differences", posture=(numbers, "count"), apart=(apart * 1e3, "mm"), turned=(turned, "deg"))
        self._judge(link, "greatest distance", apart, "m", self.tolerance, postures)
        self._judge(link, "greatest turn", turned, "deg", self.turn_tolerance, postures)

    def _judge(
        self, link: str, name: str, values: FloatArray, symbol: str, high: float, postures: list[dict[str, float]]
    ) -> None:
        worst = int(np.argmax(values))
        chain = self.first.chain(link)
        posture = ", ".join(f"{joint} {math.degrees(postures[worst][joint]):.1f}" for joint in chain)
        hint = f"{link} differs most at (deg) {posture}; {likely_causes('model')}"
        self.measure(name, float(values[worst]), symbol, high=high, hint=hint)
