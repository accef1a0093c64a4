"""Cases: one test, one fault or none, one severity, and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from rtf.simulator.axes import AXES, INDEX, PARTS
from rtf.simulator.faults import KINDS, Layer, Target, find_kind

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.robot_testing.proof.claims import Claim, Claims, Reason

#: These end the program that every other case stands on; the fixture's own tests prove what becomes of them.
_NOT_IN_SUITES = frozenset({Layer.PROCESS})


class Expectation(Enum):
    """What is to come of a case."""

    FOUND = "found"  # the test fails, and names what is broken
    SILENT = "silent"  # it passes
    EXPECTED = "expected"  # it does not pass, for a reason that is documented
    HEALTHY = "healthy"  # it passes on a robot without a fault
    OTHER = "other"  # no claim speaks of the fault: it passes, or there is a reason that holds for many tests


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
    parameters = claims.parameters | (claims.fast_parameters if fast else {})
    yield Case(claims.test, Expectation.HEALTHY, parameters=parameters, fast=True, timeout=claims.timeout)
    for claim in claims.claims:
        if find_kind(claim.fault).layer in _NOT_IN_SUITES or (fast and not claim.fast):
            continue
        for values in claim.severities:
            yield _case(claims, claim, values)


def others_of(claims: Claims, reasons: Sequence[Reason]) -> Iterator[Case]:
    """The test on every fault of which it claims nothing, at its usual severity, in the part that it tests."""
    claimed = {claim.fault for claim in claims.claims}
    parameters = {**({"part": AXES[INDEX[_AXIS]].part} if claims.of_a_part else {}), **claims.parameters}
    for name in provable_kinds():
        if name not in claimed:
            reason = next((one.text for one in reasons if one.holds_for(claims.test, name)), "")
            yield Case(
                claims.test,
                Expectation.OTHER,
                name,
                _target(name, str(parameters.get("part", ""))),
                parameters=parameters,
                reason=reason,
                timeout=claims.timeout,
            )


def provable_kinds() -> list[str]:
    """The kinds of faults that a test can be asked to find while its robot lives."""
    return [name for name, kind in KINDS.items() if kind.layer not in _NOT_IN_SUITES and not kind.stimulus]


def _target(fault: str, part: str) -> str:
    """What a fault strikes where nothing is said: the usual one of its kind, or the first joint of another part."""
    kind = KINDS[fault].target_kind
    if kind is Target.AXIS and part in PARTS and part != AXES[INDEX[_AXIS]].part:
        return PARTS[part][0].name
    return _TARGETS[kind]


#: What is struck where nothing else is said.
_AXIS = "l_elbow"
_TARGETS = {
    Target.AXIS: _AXIS,
    Target.FORCE_TORQUE: "left_arm",
    Target.IMU: "imu",
    Target.CAMERA: "left",
    Target.PORT: "/icubSim/left_arm/stateExt:o",
    Target.ROBOT: "",
}


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
