"""The keys of a campaign's file, with their types: the schema that it is read by.

Every table forbids unknown keys. A campaign crosses tests with robots, faults, seeds and values of parameters; its
design says which of these combinations are run.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta, Struct, field

from rtf.campaigns.errors import CampaignError
from rtf.resources.toml_file import TomlFile

if TYPE_CHECKING:
    from pathlib import Path

Text = Annotated[str, Meta(min_length=1)]
Positive = Annotated[float, Meta(gt=0.0)]
Count = Annotated[int, Meta(ge=1)]
Number = Annotated[int, Meta(ge=0)]
Share = Annotated[float, Meta(gt=0.0, lt=1.0)]
Value = bool | int | float | str

#: Significant digits of a severity, so that the same one is the same run on every machine.
_DIGITS = 6
_NAMES = "a name has letters, digits, dots, hyphens and underscores"


class Table(Struct, frozen=True, forbid_unknown_fields=True):
    """Base class of the tables."""


class Range(Table, frozen=True):
    """Numbers between two; a grid has so many of them, ends included."""

    low: float
    high: float
    levels: Annotated[int, Meta(ge=2, le=10_000)] = 5
    scale: Literal["linear", "log"] = "linear"

    def at(self, share: float) -> float:
        """Return the number at this share of the range, from 0 to 1."""
        if self.scale == "log":
            return rounded(self.low * (self.high / self.low) ** share)
        return rounded(self.low + (self.high - self.low) * share)

    def share(self, value: float) -> float:
        """Return the share of the range at which a number is: the inverse of :meth:`at`."""
        if self.scale == "log":
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def grid(self) -> list[float]:
        """Return the numbers of a grid."""
        return [self.at(float(share)) for share in np.linspace(0.0, 1.0, self.levels)]


class Span(Table, frozen=True):
    """Whole numbers from the first to the last."""

    first: Number
    last: Number


Numbers = list[float] | Range


class TestTable(Table, frozen=True):
    """A test, or a suite. ``parameters`` are those of the test, ``define`` gives values to variables of the suite.

    With ``faults`` it runs with these kinds only.
    """

    __test__ = False

    name: str = ""
    suite: str = ""
    parameters: dict[Text, Value | list[Value]] = {}
    define: dict[Text, Value] = {}
    faults: list[Text] | None = None


class RobotTable(Table, frozen=True):
    """A simulated robot, by its model and units of its population; or a real one, by its address.

    A real one is known to workers by its ``name``. Its name server is at ``server`` (host:port) with the name
    ``namespace``, and the names of its ports begin with ``ports``.
    """

    model: str = ""
    units: list[Number] | Span = field(default_factory=lambda: [0])
    name: Annotated[str, Meta(pattern=r"^[\w.-]*$")] = ""
    server: str = ""
    namespace: Annotated[str, Meta(pattern=r"^/[\w./-]+$")] = "/root"
    ports: str = ""

    @property
    def real(self) -> bool:
        """Whether it is no simulated one."""
        return bool(self.server)

    @property
    def all_units(self) -> list[int]:
        """The numbers of its units; a real robot has one."""
        if isinstance(self.units, Span):
            return [*range(self.units.first, self.units.last + 1)]
        return self.units


class FaultTable(Table, frozen=True):
    """A kind of fault with its targets and severities.

    A severity is how far the first parameter of the kind is from its healthy value, in its unit; ``values`` are other
    parameters, and ``delay`` and ``duration``. ``parts`` adds all joints of these parts to the targets.
    """

    kind: Text
    targets: list[str] = []
    parts: list[Text] = []
    severities: Numbers | None = None
    values: dict[Text, float] = {}


class OverrideTable(Table, frozen=True):
    """A parameter of all tests, with values that are varied."""

    parameter: Text
    values: list[Value] | Range


class DesignTable(Table, frozen=True):
    """Which of the combinations are run.

    A ``grid`` is all of them. ``random`` and ``latin_hypercube`` are so many ``points``, drawn with ``seed``.
    ``sequential`` repeats each one, ``batch`` runs at a time, until the ``confidence`` interval of the share of runs
    in which the test fails is above or below ``rate`` (``alarms`` without a fault), or all units and seeds are used;
    between the ends of a range of severities it bisects for the smallest one that is found, down to ``resolution``, a
    share of the range. ``claims`` runs what the claims of the tests say, as ``rtf proof`` does; with ``fast`` its fast
    subset.
    """

    kind: Literal["grid", "random", "latin_hypercube", "sequential", "claims"] = "grid"
    points: Count = 100
    seed: Number = 0
    batch: Count = 5
    rate: Share = 0.9
    alarms: Share = 0.1
    confidence: Share = 0.95
    resolution: Share = 0.05
    fast: bool = False


class TlsTable(Table, frozen=True):
    """Files of the connections of a cluster: the authority, the certificate and its key."""

    authority: Text
    certificate: Text
    key: Text


class BackendTable(Table, frozen=True):
    """Where the runs are made.

    ``local``: so many ``workers`` on this machine (0: one for each core). ``dask``: those of the scheduler at
    ``address``, or of a cluster object, a class such as ``dask_jobqueue.SLURMCluster`` that is called with ``options``
    and scaled to ``workers``.
    """

    kind: Literal["local", "dask"] = "local"
    workers: Number = 0
    address: str = ""
    cluster: str = ""
    options: dict[str, Value | list[Value]] = {}
    tls: TlsTable | None = None


class CampaignFile(Table, frozen=True):
    """The whole file. Only with a design of ``claims`` it may have no tests, which are all that claim something then.

    ``seeds`` are numbers, or how many there are from 0. ``healthy`` runs everything without a fault, too. A run that
    takes longer than ``timeout`` (s) is ended; one whose worker dies is tried ``attempts`` times. ``files`` are
    patterns of files beside the campaign's that workers need: test plug-ins, suites, robots.
    """

    schema: Literal[1]
    name: Annotated[str, Meta(pattern=r"^[\w.-]+$")]
    tests: list[TestTable] = []
    robots: list[RobotTable] = []
    faults: list[FaultTable] = []
    overrides: list[OverrideTable] = []
    seeds: Count | list[Number] = 1
    healthy: bool = True
    timeout: Positive = 600.0
    attempts: Count = 3
    files: list[Text] = []
    design: DesignTable = DesignTable()
    backend: BackendTable = BackendTable()

    @property
    def all_seeds(self) -> list[int]:
        """The numbers of the seeds."""
        return [*range(self.seeds)] if isinstance(self.seeds, int) else self.seeds


def rounded(value: float) -> float:
    """Return a number with the digits that severities have."""
    return float(f"{value:.{_DIGITS}g}")


def read_file(path: Path) -> tuple[TomlFile[CampaignFile], CampaignFile]:
    """Read a file. Raises CampaignError, with its line, for what the schema does not allow."""
    toml: TomlFile[CampaignFile] = TomlFile(path, CampaignError)
    file = toml.converted(CampaignFile, _NAMES)
    _check_ranges(toml, file)
    _check_claims(toml, file)
    for number, test in enumerate(file.tests):
        if bool(test.name) == bool(test.suite):
            toml.fail(["tests", str(number)], "tests: write the name of a test, or a suite")
        if test.suite and test.parameters:
            toml.fail(["tests", str(number), "parameters"], "tests: a suite gives parameters itself; use [[overrides]]")
        if test.define and not test.suite:
            toml.fail(["tests", str(number), "define"], "tests: define is for the variables of a suite")
    for number, robot in enumerate(file.robots):
        _check_robot(toml, number, robot)
    backend = file.backend
    if backend.kind == "local" and (backend.address or backend.cluster or backend.tls):
        toml.fail(["backend"], 'backend: address, cluster and tls are for kind = "dask"')
    if backend.address and backend.cluster:
        toml.fail(["backend", "cluster"], "backend: write an address or a cluster, not both")
    return toml, file


def _check_ranges(toml: TomlFile[CampaignFile], file: CampaignFile) -> None:
    ranges = [(["faults", str(number), "severities"], one.severities) for number, one in enumerate(file.faults)]
    ranges += [
        (["overrides", str(number), "values"], one.values)  # type: ignore[misc]  # only ranges are looked at
        for number, one in enumerate(file.overrides)
    ]
    for keys, values in ranges:
        if isinstance(values, Range):
            if not -math.inf < values.low < values.high < math.inf:
                toml.fail(keys, f"{keys[0]}: a range goes from low to a greater high")
            if values.scale == "log" and values.low <= 0.0:
                toml.fail(keys, f"{keys[0]}: a range with scale = log begins above 0")
        elif values is not None and not values:
            toml.fail(keys, f"{keys[0]}: there is no value in the list")


def _check_claims(toml: TomlFile[CampaignFile], file: CampaignFile) -> None:
    if file.design.kind != "claims":
        if not file.tests:
            toml.fail([], "tests: a campaign needs one at least")
        return
    for name in ("robots", "faults", "overrides"):
        if getattr(file, name):
            toml.fail([name], f'{name}: with kind = "claims" the claims of the tests say them')
    for number, test in enumerate(file.tests):
        if test.suite or test.parameters or test.faults is not None:
            toml.fail(["tests", str(number)], 'tests: with kind = "claims" a test has a name and nothing else')


def _check_robot(toml: TomlFile[CampaignFile], number: int, robot: RobotTable) -> None:
    keys = ["robots", str(number)]
    if isinstance(robot.units, Span) and robot.units.last < robot.units.first:
        toml.fail([*keys, "units"], "robots: the last unit is before the first")
    if not robot.real:
        if not robot.model or robot.name or robot.ports:
            toml.fail(keys, "robots: a simulated robot has a model and units; a real one name, server and ports")
        return
    host, _, port = robot.server.rpartition(":")
    if not host or not port.isdecimal():
        toml.fail([*keys, "server"], f"robots: {robot.server!r} is no address of a name server; write host:port")
    if not (robot.name and robot.ports):
        toml.fail(keys, "robots: a real robot needs a name, and ports, the beginning of the names of its ports")
    if robot.all_units != [0]:
        toml.fail([*keys, "units"], "robots: a real robot has no other units")
