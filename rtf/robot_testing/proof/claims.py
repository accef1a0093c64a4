"""What tests claim, read from ``claims/<file>.toml`` beside them: ``joint_limits.toml`` for ``joint_limits.py``.

::

    parameters = { part = "left_arm" }    # what the test is given in all cases, beside what a case says

    [[finds]]                             # the test must fail, and name what is broken
    fault = "jam"
    target = "l_elbow"
    values = { torque = 400 }             # or a list of such tables: one case for each severity
    parameters = { part = "left_arm" }    # for this case; without it the part of the joint that is broken
    names = "l_elbow"                     # what a failure must mention; without it the target
    fast = true                           # belongs to the fast subset

    [[silent]]                            # the test must pass all the same
    fault = "ft_bias"
    target = "left_arm"

    [[expected]]                          # outside of the claim, and yet the test does not pass
    fault = "motor_dead"
    target = "l_elbow"
    reason = "a joint that does not move reaches no limit"
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rtf.robot.errors import RobotError
from rtf.simulator.axes import AXES, INDEX
from rtf.simulator.faults import find_kind
from rtf.testing import Parameter
from rtf.testing.plugins import PluginError, find, load_test

if TYPE_CHECKING:
    from pathlib import Path

_KINDS = ("finds", "silent", "expected")
_TOP = {"parameters", "timeout", *_KINDS}
_ENTRY = {"fault", "target", "values", "names", "parameters", "reason", "fast", "delay", "duration"}


class ClaimsError(RobotError, ValueError):
    """A file of claims that says what cannot be; the sentence begins with the file."""


@dataclass(frozen=True, slots=True)
class Claim:
    """One entry: a fault, with one or several severities, and what is to come of it."""

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


def read_claims(path: Path) -> Claims:
    """Read one file. Raises ClaimsError for what is unknown, for faults that do not exist, and for missing reasons."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ClaimsError(f"{path}: {error}") from None
    _known(path, data, _TOP, "the file")
    try:
        test = load_test(find("test", path.stem, beside=path.parent.parent))
    except PluginError as error:
        raise ClaimsError(f"{path}: there is no test {path.stem}.py whose claims these are: {error}") from None
    claims = [_claim(path, kind, entry) for kind in _KINDS for entry in data.get(kind, [])]
    if isinstance(getattr(type(test), "part", None), Parameter):
        claims = [_with_part(claim) for claim in claims]
    timeout = float(data.get("timeout", 300.0))
    return Claims(type(test).__name__, path, dict(data.get("parameters", {})), tuple(claims), timeout)


def _with_part(claim: Claim) -> Claim:
    """A test of one part works with the one whose joint is broken, unless the claim says another."""
    if "part" in claim.parameters or claim.target not in INDEX:
        return claim
    return replace(claim, parameters={"part": AXES[INDEX[claim.target]].part, **claim.parameters})


def _claim(path: Path, kind: str, entry: dict[str, Any]) -> Claim:
    _known(path, entry, _ENTRY, f"[[{kind}]]")
    fault = entry.get("fault", "")
    try:
        find_kind(str(fault))
    except RobotError as error:
        raise ClaimsError(f"{path}: [[{kind}]]: {error}") from None
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


def _known(path: Path, table: dict[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    if unknown:
        raise ClaimsError(f"{path}: {where} has {', '.join(unknown)}; there are {', '.join(sorted(known))}")
