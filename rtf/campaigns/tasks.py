"""Tasks: the single runs of a campaign, as plain data.

A :class:`Task` says all that decides what a run measures, so its digest, ``key``, is its identity: a file that is
edited keeps the results of the runs that it still has.
"""

from __future__ import annotations

import hashlib

import msgspec
from msgspec import Struct

from rtf.bottle import Bottle

#: Bytes of a digest: a million tasks have two equal ones with a probability of 1e-12.
_KEY_BYTES = 10


class FaultValues(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A fault: its kind, its target, its parameters, and how large the first of them is (None: it has no size)."""

    kind: str
    target: str = ""
    values: tuple[tuple[str, float], ...] = ()
    severity: float | None = None

    @property
    def injection(self) -> str:
        """The fault in the syntax of the parameter ``inject`` of robot tests."""
        return " ".join([self.kind, self.target or "-", *(f"{name}={value!r}" for name, value in self.values)])


class RealRobot(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A real robot: the name by which workers have it, its name server, and the beginning of its ports' names."""

    name: str
    host: str
    port: int
    namespace: str
    ports: str


class Task(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One run. ``test`` or ``suite`` is given; ``model`` is the simulated robot, if there is one.

    ``parameters`` are those of the test, ``define`` the variables of the suite, ``overrides`` parameters of all tests.
    ``cameras``: the simulated robot needs its cameras; ``simulator`` are other parameters of the fixture that it is.
    ``configuration`` is a robot of ``suites/robots`` that is started by its configuration instead.
    """

    test: str = ""
    suite: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    define: tuple[tuple[str, str], ...] = ()
    model: str = ""
    unit: int = 0
    real: RealRobot | None = None
    seed: int = 0
    fault: FaultValues | None = None
    overrides: tuple[tuple[str, str], ...] = ()
    cameras: bool = False
    simulator: tuple[tuple[str, str], ...] = ()
    configuration: str = ""

    @property
    def key(self) -> str:
        """The digest of the task."""
        return hashlib.sha256(to_json(self)).hexdigest()[: 2 * _KEY_BYTES]

    @property
    def robot(self) -> str:
        """The name of the robot: of its model, or its own; empty without one."""
        return self.real.name if self.real else self.model

    @property
    def described(self) -> str:
        """The task in words, for people."""
        words = [self.test or self.suite]
        if self.robot:
            words += ["on", self.robot, *([f"unit {self.unit}"] if self.unit else [])]
        words += ["with", self.fault.injection] if self.fault else []
        return " ".join([*words, *(f"{name}={value}" for name, value in self.overrides), f"seed {self.seed}"])


def to_json(task: Task) -> bytes:
    """Return a task as JSON: equal tasks give equal bytes."""
    return msgspec.json.encode(task)


def from_json(text: bytes | str) -> Task:
    """Return the task of :func:`to_json`. Raises msgspec.ValidationError."""
    return msgspec.json.decode(text, type=Task)


def text_of(value: object) -> str:
    """Return the value of a parameter as text, as a suite has it."""
    if isinstance(value, list):
        return f"({Bottle(value).to_text()})"
    return str(value).lower() if isinstance(value, bool) else str(value)
