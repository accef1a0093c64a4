"""Cases: one test, one fault or none, one severity, and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.simulator.faults import Layer, Target, find_kind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot_testing.proof.claims import Claim, Claims

#: These end the program that every other case stands on; the fixture's own tests prove what becomes of them.
_NOT_IN_SUITES = frozenset({Layer.PROCESS})


class Expectation(Enum):
    """What is to come of a case."""

    FOUND = "found"  # the test fails, and names what is broken
    SILENT = "silent"  # it passes
    EXPECTED = "expected"  # it does not pass, for a reason that is documented
    HEALTHY = "healthy"  # it passes on a robot without a fault


@dataclass(frozen=True, slots=True)
class Case:
    """One run of a test. ``name`` is unique among the cases of a proof."""

    test: str
    expectation: Expectation
    fault: str = ""
    target: str = ""
    values: dict[str, float] = field(default_factory=dict)
    names: str = ""
    parameters: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    fast: bool = False
    timeout: float = 300.0
    delay: float = 0.0
    duration: float | None = None

    @property
    def name(self) -> str:
        """For people, and for the file that a case is in."""
        severity = " ".join(f"{name}={value:g}" for name, value in self.values.items())
        when = " ".join(
            [f"delay={self.delay:g}"] * (self.delay > 0) + [f"duration={self.duration}"] * bool(self.duration)
        )
        words = [self.test, "on", self.fault or "the healthy robot", self.target, severity, when]
        given = " ".join(f"{key}={value}" for key, value in sorted(self.parameters.items()))
        return " ".join(word for word in [*words, given] if word)

    @property
    def injection(self) -> str:
        """The fault as the parameter ``inject`` of a robot test has it."""
        if not self.fault:
            return ""
        words = [self.fault, self.target or "-", *(f"{name}={value!r}" for name, value in self.values.items())]
        if self.delay:
            words.append(f"delay={self.delay!r}")
        if self.duration is not None:
            words.append(f"duration={self.duration!r}")
        return " ".join(words)

    @property
    def needs_cameras(self) -> bool:
        """Whether the robot must have its eyes open."""
        return self.test == "CameraTest" or (bool(self.fault) and find_kind(self.fault).target_kind is Target.CAMERA)


def cases_of(claims: Claims, *, fast: bool = False) -> Iterator[Case]:
    """The cases of one test: the healthy robot, and each severity of each claim. ``fast``: only what is marked so."""
    yield Case(claims.test, Expectation.HEALTHY, parameters=claims.parameters, fast=True, timeout=claims.timeout)
    for claim in claims.claims:
        if find_kind(claim.fault).layer in _NOT_IN_SUITES or (fast and not claim.fast):
            continue
        for values in claim.severities:
            yield _case(claims, claim, values)


def _case(claims: Claims, claim: Claim, values: dict[str, float]) -> Case:
    kinds = {"finds": Expectation.FOUND, "silent": Expectation.SILENT, "expected": Expectation.EXPECTED}
    return Case(
        claims.test,
        kinds[claim.kind],
        claim.fault,
        claim.target,
        values,
        claim.names,
        {**claims.parameters, **claim.parameters},
        claim.reason,
        claim.fast,
        claims.timeout,
        claim.delay,
        claim.duration,
    )
