"""Cases of the proof: a test, a fault or none, a severity, and the expected result."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import cycle
from typing import TYPE_CHECKING, Any

from rtf.robot_testing.proof.claims import robot_of
from rtf.simulator.faults import KINDS, Layer, Target, find_kind

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rtf.robot.model import RobotModel
    from rtf.robot_testing.proof.claims import Claim, Claims, Reason

#: Faults of this layer end the simulator, which the other cases share; the tests of the fixture cover them.
_NOT_IN_SUITES = frozenset({Layer.PROCESS})

#: The tests that need a simulator with cameras.
_WITH_CAMERAS = ("CameraMotion", "CameraTest", "RgbdTest")
_CAMERAS = (Target.CAMERA, Target.DEPTH_CAMERA)


class Expectation(Enum):
    """The expected result of a case."""

    FOUND = "found"  # the test fails, and names the faulty component
    SILENT = "silent"  # the test passes
    EXPECTED = "expected"  # the test does not pass, for a documented reason
    HEALTHY = "healthy"  # the test passes on a robot without a fault
    LIMIT = "limit"  # a smaller fault than the test claims to find: it finds it, or passes
    OTHER = "other"  # no claim covers the fault: the test passes, names it, or there is a general reason why not


@dataclass(frozen=True, slots=True)
class Case:
    """A run of a test. ``name`` is unique among the cases of a proof."""

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
    robot: str = ""
    simulator: dict[str, Any] = field(default_factory=dict)  # parameters of the fixture
    configuration: str = ""  # the robot whose configuration is started instead

    @property
    def name(self) -> str:
        """A readable name, also used in the suite file."""
        severity = " ".join(f"{name}={value:g}" for name, value in self.values.items())
        when = " ".join(
            [f"delay={self.delay:g}"] * (self.delay > 0) + [f"duration={self.duration}"] * bool(self.duration)
        )
        words = [self.test, "on", self.fault or "the healthy robot", self.target, severity, when]
        given = " ".join(f"{key}={value}" for key, value in sorted(self.parameters.items()))
        return " ".join(word for word in [*words, given] if word)

    @property
    def injection(self) -> str:
        """The fault in the syntax of the parameter ``inject`` of robot tests."""
        if not self.fault:
            return ""
        words = [self.fault, self.target or "-", *(f"{name}={value!r}" for name, value in self.values.items())]
        if self.delay:
            words.append(f"delay={self.delay!r}")
        if self.duration is not None:
            words.append(f"duration={self.duration!r}")
        return " ".join(words)

    @property
    def unit(self) -> int:
        """The robot of the population that is simulated."""
        return int(self.simulator.get("unit", 0))

    @property
    def on_unit(self) -> str:
        """On which unit it is run, as text after a name; empty for the nominal one."""
        return f" on unit {self.unit}" if self.unit else ""

    @property
    def needs_cameras(self) -> bool:
        """Whether the simulator must be started with cameras."""
        return self.test in _WITH_CAMERAS or (bool(self.fault) and find_kind(self.fault).target_kind in _CAMERAS)


def cases_of(claims: Claims, *, fast: bool = False) -> Iterator[Case]:
    """Yield the cases of a test: the healthy robot, and each severity of each claim. ``fast``: marked claims only."""
    parameters = claims.parameters | (claims.fast_parameters if fast else {})
    yield Case(
        claims.test,
        Expectation.HEALTHY,
        parameters=parameters,
        fast=True,
        timeout=claims.timeout,
        robot=claims.robot,
        simulator=claims.simulator,
        configuration=claims.configuration,
    )
    for claim in claims.claims:
        if find_kind(claim.fault).layer in _NOT_IN_SUITES or (fast and not claim.fast):
            continue
        for values in claim.severities:
            yield _case(claims, claim, values)


def on_units(cases: Iterable[Case], units: Sequence[int]) -> list[Case]:
    """Return the cases, each on the next one of these robots of the population, in turn.

    A robot that is started by its configuration, and all if no unit is given, is the nominal one.
    """
    given = zip(cases, cycle(units or (None,)), strict=False)
    return [
        case if unit is None or case.configuration else replace(case, simulator={**case.simulator, "unit": unit})
        for case, unit in given
    ]


#: Severities below the smallest claimed one, as shares of it.
_SMALLER = (0.5, 0.25)


def limits_of(claims: Claims) -> Iterator[Case]:
    """Yield cases with smaller faults than those that a test claims to find, down to a quarter of the smallest one."""
    for claim in claims.claims:
        kind = find_kind(claim.fault)
        severities = {kind.severity(values): values for values in claim.severities}
        graded = [severity for severity in severities if severity]
        if claim.kind != "finds" or None in severities or not graded:
            continue
        smallest = min(graded, key=abs)
        first = kind.parameters[0]
        for share in _SMALLER:
            value = float(severities[smallest].get(first.name, first.default)) - (1.0 - share) * smallest
            smaller = {**severities[smallest], first.name: value}
            yield replace(_case(claims, claim, smaller), expectation=Expectation.LIMIT)


def others_of(claims: Claims, reasons: Sequence[Reason], *, fast: bool = False) -> Iterator[Case]:
    """Yield the cases of a test with each fault that no claim covers, at default severity, in the tested part.

    ``fast``: with the parameters of the fast subset, such as two joints instead of sixteen.
    """
    claimed = {claim.fault for claim in claims.claims}
    robot = robot_of(claims.robot)
    part = robot.axis(_targets(robot)[Target.AXIS]).part
    parameters = {**({"part": part} if claims.of_a_part else {}), **claims.parameters}
    parameters |= claims.fast_parameters if fast else {}
    for name in provable_kinds(robot):
        # A robot that a configuration starts has the devices of that file, and few of these have cameras.
        served = not claims.configuration or KINDS[name].target_kind not in _CAMERAS
        if served and name not in claimed:
            reason = next((one.text for one in reasons if one.holds_for(claims.test, name)), "")
            target = _target(robot, name, str(parameters.get("part", "")))
            yield Case(
                claims.test,
                Expectation.OTHER,
                name,
                target,
                names=target,
                parameters=parameters,
                reason=reason,
                timeout=claims.timeout,
                robot=claims.robot,
                simulator=claims.simulator,
                configuration=claims.configuration,
            )


def provable_kinds(robot: RobotModel | None = None) -> list[str]:
    """Return the kinds of faults that a test can find: the robot keeps running, and something is broken.

    With ``robot`` these are the faults of what this robot has.
    """
    targets = [*Target] if robot is None else _targets(robot)
    return [
        name
        for name, kind in KINDS.items()
        if kind.layer not in _NOT_IN_SUITES and not kind.stimulus and kind.target_kind in targets
    ]


def _target(robot: RobotModel, fault: str, part: str) -> str:
    """Return the default target of a fault: that of its kind, or in another part its first joint or its state."""
    kind, targets = KINDS[fault].target_kind, _targets(robot)
    if kind is Target.PORT and part in robot.parts:
        return f"/{robot.simulated_name}/{part}/stateExt:o"
    if kind is Target.AXIS and part in robot.parts and part != robot.axis(targets[kind]).part:
        return robot.parts[part].axes[0].name
    return targets[kind]


#: The joint that is broken by default, if the robot has it.
_AXIS = "l_elbow"


def _targets(robot: RobotModel) -> dict[Target, str]:
    """Return the default target of each type that a robot has."""
    sensors = robot.sensors
    axis = _AXIS if _AXIS in robot.index else robot.axes[0].name
    targets = {
        Target.AXIS: axis,
        Target.PORT: f"/{robot.simulated_name}/{robot.axis(axis).part}/stateExt:o",
        Target.ROBOT: "",
    }
    if sensors.force_torque:
        targets[Target.FORCE_TORQUE] = next(iter(sensors.force_torque.values())).port
    if sensors.inertial:
        targets[Target.IMU] = next(iter(sensors.inertial))
    if sensors.cameras:
        targets[Target.CAMERA] = next(iter(sensors.cameras))
    if sensors.skin:
        targets[Target.SKIN] = next(iter(sensors.skin))
    if sensors.depth_cameras:
        targets[Target.DEPTH_CAMERA] = next(iter(sensors.depth_cameras))
    if sensors.battery is not None:
        targets[Target.BATTERY] = "battery"
    return targets


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
        claims.robot,
        claims.simulator,
        claims.configuration,
    )
