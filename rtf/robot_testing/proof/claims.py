"""Claims of tests, read from ``claims/<file>.toml`` beside the test: ``joint_limits.toml`` for ``joint_limits.py``.

::

    robot = "bench"                       # the robot of all cases; default: icub
    simulator = { can = true }            # parameters of the fixture that simulates it
    configuration = "icubSim"             # or a robot of suites/robots that is started by its configuration, with
                                          # devices such as Cartesian controllers
    parameters = { part = "left_arm" }    # of the test in all cases, besides those of a case
    fast_parameters = { joints = [1, 3] } # in the fast subset, for the healthy robot and for faults without a claim

    [[finds]]                             # the test must fail, and name the faulty component
    fault = "jam"
    target = "l_elbow"
    values = { torque = 400 }             # or a list of such tables: one case for each severity
    parameters = { part = "left_arm" }    # for this case; default: the part of the faulty joint
    names = "l_elbow"                     # what a failure must mention; default: the target
    fast = true                           # belongs to the fast subset

    [[silent]]                            # the test must pass
    fault = "ft_bias"
    target = "left_arm"

    [[expected]]                          # not a claim, and yet the test does not pass
    fault = "motor_dead"
    target = "l_elbow"
    reason = "a joint that does not move reaches no limit"

With a fault that no claim of a test covers, the test must pass, or a reason in ``claims/others/reasons.toml`` must
apply.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rtf.robot.errors import RobotError
from rtf.robot.model import default_robot, load_robot
from rtf.simulator.faults import find_kind
from rtf.testing import Parameter
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import PluginError, find

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.robot.model import RobotModel

_KINDS = ("finds", "silent", "expected")
_TOP = {"robot", "simulator", "configuration", "parameters", "fast_parameters", "timeout", *_KINDS}
_ENTRY = {"fault", "target", "values", "names", "parameters", "reason", "fast", "delay", "duration"}


class ClaimsError(RobotError, ValueError):
    """An invalid file of claims; the message begins with the file name."""


@dataclass(frozen=True, slots=True)
class Claim:
    """An entry: a fault with one or several severities, and the expected result."""

    kind: str  # finds, silent, expected
    fault: str
    target: str = ""
    severities: tuple[dict[str, float], ...] = ({},)
    names: str = ""
    parameters: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    fast: bool = False
    delay: float = 0.0
    duration: float | None = None


@dataclass(frozen=True, slots=True)
class Claims:
    """All claims of one test."""

    test: str
    file: Path
    parameters: dict[str, Any]
    claims: tuple[Claim, ...]
    timeout: float = 300.0
    of_a_part: bool = False  # whether the test has the parameter ``part``
    fast_parameters: dict[str, Any] = field(default_factory=dict)
    robot: str = ""  # the name of the robot of all cases; none: the default robot
    simulator: dict[str, Any] = field(default_factory=dict)
    configuration: str = ""  # the robot of suites/robots whose configuration is started, instead of the simulator


@dataclass(frozen=True, slots=True)
class Reason:
    """A reason why tests without a claim on some faults do not pass with one of them; no ``tests``: all tests."""

    faults: frozenset[str]
    tests: frozenset[str]
    text: str

    def holds_for(self, test: str, fault: str) -> bool:
        """Return whether the reason applies to this test and this fault."""
        return fault in self.faults and (not self.tests or test in self.tests)


def read_reasons(path: Path) -> tuple[Reason, ...]:
    """Read a file of ``[[reason]]`` with ``faults``, ``tests`` and ``text``. Raises ClaimsError as ``read_claims``."""
    data = _read(path)
    _known(path, data, {"reason"}, "the file")
    reasons = []
    for entry in data.get("reason", []):
        _known(path, entry, {"faults", "tests", "text"}, "[[reason]]")
        if not entry.get("text") or not entry.get("faults"):
            raise ClaimsError(f"{path}: [[reason]] needs faults and a text")
        for fault in entry["faults"]:
            _check_kind(path, "reason", str(fault))
        reasons.append(Reason(frozenset(entry["faults"]), frozenset(entry.get("tests", ())), str(entry["text"])))
    return tuple(reasons)


def read_claims(path: Path) -> Claims:
    """Read a file of claims. Raises ClaimsError for unknown keys and faults, and for missing reasons."""
    data = _read(path)
    _known(path, data, _TOP, "the file")
    try:
        test = load_test(find("test", path.stem, beside=path.parent.parent))
    except PluginError as error:
        raise ClaimsError(f"{path}: there is no test {path.stem}.py for these claims: {error}") from None
    claims = [_claim(path, kind, entry) for kind in _KINDS for entry in data.get(kind, [])]
    of_a_part = isinstance(getattr(type(test), "part", None), Parameter)
    robot = str(data.get("robot", ""))
    if of_a_part:
        claims = [_with_part(claim, robot) for claim in claims]
    parameters, fast, simulator = (dict(data.get(key, {})) for key in ("parameters", "fast_parameters", "simulator"))
    timeout = float(data.get("timeout", 300.0))
    configuration = str(data.get("configuration", ""))
    if configuration and simulator:
        raise ClaimsError(f"{path}: simulator and configuration exclude each other")
    name = type(test).__name__
    return Claims(name, path, parameters, tuple(claims), timeout, of_a_part, fast, robot, simulator, configuration)


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ClaimsError(f"{path}: {error}") from None


def robot_of(name: str) -> RobotModel:
    """Return the robot of this name; none: the default robot. Raises RobotModelError."""
    return load_robot(name) if name else default_robot()


def _with_part(claim: Claim, robot_name: str) -> Claim:
    """Return the claim with the part of the faulty joint as the part under test, unless the claim names one."""
    robot = robot_of(robot_name)
    if "part" in claim.parameters or claim.target not in robot.index:
        return claim
    return replace(claim, parameters={"part": robot.axis(claim.target).part, **claim.parameters})


def _claim(path: Path, kind: str, entry: dict[str, Any]) -> Claim:
    _known(path, entry, _ENTRY, f"[[{kind}]]")
    fault = entry.get("fault", "")
    _check_kind(path, kind, str(fault))
    if kind == "expected" and not entry.get("reason"):
        raise ClaimsError(f"{path}: [[expected]] {fault}: a reason is missing: why does the test not pass?")
    values = entry.get("values", {})
    target = str(entry.get("target", ""))
    return Claim(
        kind,
        fault,
        target,
        tuple(dict(one) for one in values) if isinstance(values, list) else (dict(values),),
        str(entry.get("names", target)),
        dict(entry.get("parameters", {})),
        str(entry.get("reason", "")),
        bool(entry.get("fast", False)),
        float(entry.get("delay", 0.0)),
        None if entry.get("duration") is None else float(entry["duration"]),
    )


def _check_kind(path: Path, table: str, fault: str) -> None:
    try:
        find_kind(fault)
    except RobotError as error:
        raise ClaimsError(f"{path}: [[{table}]]: {error}") from None


def _known(path: Path, table: dict[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    if unknown:
        raise ClaimsError(f"{path}: {where} has unknown keys {', '.join(unknown)}; known: {', '.join(sorted(known))}")
