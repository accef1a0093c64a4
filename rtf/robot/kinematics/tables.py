"""Chains from tables of Denavit and Hartenberg: the file ``chains.toml`` beside a ``robot.toml``.

A link is a rotation about z by the joint and ``offset``, a translation along z by ``d`` and along x by ``a`` (m), and a
rotation about x by ``alpha`` (deg). A chain has versions, of which some have tables; the shipped iCub's file is an
example.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, Struct

from rtf.errors import did_you_mean
from rtf.resources.toml_file import TomlFile
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.chain import Chain, LinearConstraint, Link
from rtf.robot.kinematics.poses import checked_pose, homogeneous
from rtf.robot.model import RobotModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from rtf.robot.model import RobotModel

#: The name of the file.
CHAINS_FILE = "chains.toml"
Text = Annotated[str, Meta(min_length=1)]
Version = Annotated[str, Meta(pattern=r"^\d+\.\d+$")]
T = TypeVar("T")
Row = tuple[float, float, float, float]
_NAMES = 'a version is two numbers, such as "2.5"'


class Table(Struct, frozen=True, forbid_unknown_fields=True):
    """Base class of the tables."""


class LinkTable(Table, frozen=True):
    """A link, in metres and degrees."""

    limits: tuple[float, float]
    joint: str = ""  # default: of the link's name
    a: float = 0.0
    d: float = 0.0
    alpha: float = 0.0
    offset: float = 0.0


class ConstraintTable(Table, frozen=True):
    """A sum of joints in degrees that stays between two values."""

    joints: dict[Text, float]
    lower: float | None = None
    upper: float | None = None


class ChainTable(Table, frozen=True):
    """A version of a chain; all by their names."""

    base: Text
    links: list[Text]
    tip: list[Text] = []  # frames, one after another
    blocked: dict[Text, float] = {}  # positions (deg) of joints that it does not move
    constraints: list[Text] = []


class ChainsTable(Table, frozen=True):
    """The whole file."""

    schema: Literal[1]
    frames: dict[Text, tuple[Row, Row, Row]]  # rotation and translation (m)
    links: dict[Text, LinkTable]
    chains: dict[Text, dict[Version, ChainTable]]
    constraints: dict[Text, ConstraintTable] = {}


class ChainTables:
    """The chains of a file, all checked when it is read.

    Raises RobotModelError, with file and line, for what is wrong with it.
    """

    def __init__(self, path: Path) -> None:
        self._toml: TomlFile[ChainsTable] = TomlFile(path, RobotModelError)
        self._file = self._toml.converted(ChainsTable, _NAMES)
        self._frames = {name: self._frame(name, rows) for name, rows in self._file.frames.items()}
        self._links = {name: self._link(name, table) for name, table in self._file.links.items()}
        self._constraints = {name: self._constraint(name, one) for name, one in self._file.constraints.items()}
        self._chains = {
            name: {_parsed(version): self._chain(name, version, table) for version, table in versions.items()}
            for name, versions in self._file.chains.items()
        }

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its chains."""
        return tuple(self._chains)

    def versions(self, name: str) -> tuple[str, ...]:
        """Return the versions of a chain that have tables, from the lowest. Raises RefusedError for an unknown one."""
        return tuple(f"{major}.{minor}" for major, minor in sorted(self._versions(name)))

    def chain(self, name: str, version: str = "1.0") -> Chain:
        """Return a chain: that of the highest version up to the given one, or of the lowest if all are higher.

        A number after the dot counts as a whole: 2.10 is above 2.8. A ``v`` in front is ignored. Raises RefusedError
        for an unknown chain, and for what is no version.
        """
        versions = self._versions(name)
        try:
            wanted = _parsed(version.removeprefix("v"))
        except ValueError:
            raise RefusedError(f"{version!r} is no version; {_NAMES}") from None
        return versions[max((one for one in versions if one <= wanted), default=min(versions))]

    def _versions(self, name: str) -> dict[tuple[int, int], Chain]:
        if name not in self._chains:
            known = ", ".join(self._chains)
            raise RefusedError(
                f"{self._toml.path} has no chain {name!r}; its chains are {known}{did_you_mean(name, self._chains)}"
            )
        return self._chains[name]

    # Reading ---------------------------------------------------------------------------------------------------------

    def _frame(self, name: str, rows: Sequence[Row]) -> NDArray[np.float64]:
        try:
            return checked_pose([*rows, (0.0, 0.0, 0.0, 1.0)])
        except RefusedError:
            self._toml.fail(["frames", name], f"{name}: its rows are no rotation with a translation")

    def _link(self, name: str, table: LinkTable) -> Link:
        low, high = table.limits
        if not all(map(math.isfinite, msgspec.structs.astuple(table)[2:])):
            self._toml.fail(["links", name], f"{name}: a, d, alpha and offset are finite numbers")
        if not low <= high:
            self._toml.fail(["links", name], f"{name}: limits are a smaller and a greater number, not {low} and {high}")
        frame = dh_frame(table.a, table.d, table.alpha, table.offset)
        return Link(table.joint or name, low, high, frame)

    def _constraint(self, name: str, table: ConstraintTable) -> LinearConstraint:
        lower = -math.inf if table.lower is None else table.lower
        upper = math.inf if table.upper is None else table.upper
        if not (lower <= upper and all(map(math.isfinite, table.joints.values()))):
            self._toml.fail(["constraints", name], f"{name}: factors are finite, and lower is below upper")
        return LinearConstraint(name, dict(table.joints), lower, upper)

    def _chain(self, name: str, version: str, table: ChainTable) -> Chain:
        keys = ["chains", name, version]

        def named(kind: str, known: Mapping[str, T], one: str) -> T:
            if one not in known:
                self._toml.fail(keys, f"{name} {version}: there is no {kind} {one!r}{did_you_mean(one, known)}")
            return known[one]

        links = tuple(named("link", self._links, link) for link in table.links)
        joints = [link.joint for link in links]
        if len(set(joints)) < len(joints):
            self._toml.fail(keys, f"{name} {version}: two of its links have one joint: {', '.join(joints)}")
        tip = np.eye(4)
        for frame in table.tip:
            tip = tip @ named("frame", self._frames, frame)
        chain = Chain(
            f"{name} {version}",
            links,
            named("frame", self._frames, table.base),
            tip,
            tuple(named("constraint", self._constraints, one) for one in table.constraints),
        )
        unknown = {joint for one in chain.constraints for joint in one.factors} - set(joints)
        if unknown:
            self._toml.fail(keys, f"{name} {version}: its constraints have joints that it has not: {sorted(unknown)}")
        try:
            return chain.blocked(table.blocked)
        except RefusedError as error:
            self._toml.fail(keys, str(error))


def robot_chains(robot: RobotModel) -> ChainTables:
    """Return the tables of a robot. Raises RobotModelError if it has none, or what is wrong with them."""
    path = robot.folder / CHAINS_FILE
    if not path.is_file():
        raise RobotModelError(f"{path}: there is no such file; {robot.name} has no tables of chains")
    return ChainTables(path)


def dh_frame(a: float, d: float, alpha: float, offset: float) -> NDArray[np.float64]:
    """Return the constant transform of a link of Denavit and Hartenberg; ``a`` and ``d`` in m, angles in deg."""
    turn, twist = math.radians(offset), math.radians(alpha)
    about_z = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, math.cos(twist), -math.sin(twist)], [0, math.sin(twist), math.cos(twist)]])
    return homogeneous(about_z @ about_x, about_z @ (a, 0.0, d))


def _parsed(version: str) -> tuple[int, int]:
    major, minor = version.split(".")
    return int(major), int(minor)
