"""A campaign: its file, checked against tests, robots and faults, and the cells that its design fills with runs.

A :class:`Cell` is a test on a robot, healthy or with a fault at a target. What else decides a run is a unit of the
robot, the severity of the fault, a seed and the values of overrides; :meth:`Campaign.task` puts them together.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

from rtf.campaigns.errors import CampaignError
from rtf.campaigns.file import FaultTable, Range, RobotTable, TestTable, read_file, rounded
from rtf.campaigns.tasks import FaultValues, RealRobot, Task, text_of
from rtf.errors import RtfError, did_you_mean
from rtf.testing.parameters import Parameter
from rtf.testing.plan import load_files
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import find, shipped_folder
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from rtf.campaigns.file import Value
    from rtf.robot.model import RobotModel
    from rtf.simulator.faults.base import Fault

#: Parameters of every fault, which say when it is there.
_TIMES = ("delay", "duration")
#: The variables of a suite for any robot, which a task defines if the suite has them; those of the robot test command.
_OF_ROBOT = ("model", "unit", "seed", "parts", "torque_parts")
#: The largest file that is sent to workers, and all of them together (bytes): plug-ins, suites and robots are small.
_MOST_BYTES = 32 << 20


@dataclass(frozen=True, slots=True)
class Cell:
    """A test on a robot (None: without one), healthy or with a fault at a target.

    ``part`` is the part of the robot that is tested, if the test has one and the campaign's file does not say it.
    """

    test: TestTable
    robot: RobotTable | None = None
    fault: FaultTable | None = None
    target: str = ""
    part: str = ""

    @property
    def units(self) -> list[int]:
        """The numbers of the units of its robot."""
        return [0] if self.robot is None else self.robot.all_units


class Campaign:
    """A campaign that can be run. Raises CampaignError, with file and line, for what is wrong in its file."""

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()
        self.folder = self.path.parent
        self._toml, self.file = read_file(path)
        self._fail = self._toml.fail
        self._robots = {robot.model: self._load_robot(n, robot) for n, robot in enumerate(self.file.robots)}
        self._kinds = {fault.kind: self._find_kind(n, fault) for n, fault in enumerate(self.file.faults)}
        self._variables = [self._check_test(number, test) for number, test in enumerate(self.file.tests)]
        self._of_a_part = {test.name: self._has_part(n, test) for n, test in enumerate(self.file.tests) if test.name}
        self.cells = [*self._cells()]
        if not self.cells and self.file.design.kind != "claims":
            self._fail([], "no run is left: healthy = false, and no fault is on one of the robots")
        self.overrides = [self._values(one.values) for one in self.file.overrides]
        self.files = self._read_files()

    @property
    def real_robots(self) -> list[str]:
        """The names of its real robots."""
        return [robot.name for robot in self.file.robots if robot.real]

    # Checks ------------------------------------------------------------------------------------------------------

    def _load_robot(self, number: int, robot: RobotTable) -> RobotModel | None:
        if robot.real:
            return None
        from rtf.robot.model import load_robot

        beside = self.folder / robot.model
        try:
            return load_robot(str(beside) if "/" in robot.model and beside.exists() else robot.model)
        except RtfError as error:
            self._fail(["robots", str(number), "model"], f"robots: {error}")

    def _find_kind(self, number: int, fault: FaultTable) -> type[Fault]:
        from rtf.simulator.faults import Target, find_kind

        keys = ["faults", str(number)]
        try:
            kind = find_kind(fault.kind)
        except RtfError as error:
            self._fail([*keys, "kind"], f"faults: {error}")
        if fault.parts and kind.target_kind is not Target.AXIS:
            self._fail(
                [*keys, "parts"], f"faults: {fault.kind} is not of a joint; its target is {kind.target_kind.value}"
            )
        if not (fault.parts or fault.targets or kind.target_kind is Target.ROBOT):
            self._fail(keys, f"faults: {fault.kind} needs targets, each {kind.target_kind.value}")
        self._check_values(keys, fault, kind)
        return kind

    def _check_values(self, keys: list[str], fault: FaultTable, kind: type[Fault]) -> None:
        sized = kind.severity({}) is not None
        if fault.severities is not None and not sized:
            self._fail([*keys, "severities"], f"faults: {fault.kind} has no size; leave severities out")
        known = [one.name for one in kind.parameters[fault.severities is not None :]]
        for name in fault.values:
            if name not in (*known, *_TIMES):
                self._fail(
                    [*keys, "values"],
                    f"faults: {fault.kind} has no other parameter {name!r}{did_you_mean(name, known)}",
                )
        if fault.severities is None:
            return
        first = kind.parameters[0]
        ends = fault.severities if isinstance(fault.severities, list) else [fault.severities.low, fault.severities.high]
        for severity in ends:
            value = (first.healthy or 0.0) + severity
            if not first.minimum <= value <= first.maximum:
                self._fail(
                    [*keys, "severities"],
                    f"faults: a severity of {severity:g} makes {first.name} of {fault.kind} {value:g} {first.unit}, "
                    f"and it is from {first.minimum:g} to {first.maximum:g}",
                )

    def _check_test(self, number: int, test: TestTable) -> frozenset[str]:
        """Check that a test or suite can be read; return the variables of the suite."""
        keys = ["tests", str(number)]
        kinds = [fault.kind for fault in self.file.faults]
        for kind in test.faults or ():
            if kind not in kinds:
                self._fail([*keys, "faults"], f"tests: there is no [[faults]] with {kind!r}{did_you_mean(kind, kinds)}")
        if not test.suite:
            try:
                find("test", test.name, beside=self.folder)
            except RtfError as error:
                self._fail([*keys, "name"], f"tests: {error}")
            return frozenset()
        path = suite_path(test.suite, self.folder)
        if not path.is_file():
            self._fail([*keys, "suite"], f"tests: there is no suite {test.suite}, beside this file or shipped")
        needed = dict.fromkeys((*_OF_ROBOT, *test.define), "x")
        loaded = load_files([(path, True)], needed)
        for diagnosed in loaded.diagnostics:
            if diagnosed.severity is Severity.ERROR:
                self._fail([*keys, "suite"], f"tests: {diagnosed}")
        for name in test.define:
            if name not in loaded.variables:
                self._fail([*keys, "define"], f"tests: {test.suite} has no ${{{name}}}")
        self._check_units(keys, test, loaded.variables)
        return loaded.variables

    def _check_units(self, keys: list[str], test: TestTable, variables: frozenset[str]) -> None:
        several = any(robot.all_units != [0] for robot in self.file.robots)
        varied = {"model": len(self.file.robots) > 1, "unit": several, "seed": len(self.file.all_seeds) > 1}
        for name, needed in varied.items():
            if needed and name not in variables and self.file.robots:
                self._fail(
                    [*keys, "suite"], f"tests: every {name} would be the same: {test.suite} has no ${{{name}}} for it"
                )

    def _has_part(self, number: int, test: TestTable) -> bool:
        """Return whether a test has the parameter ``part``."""
        ref = find("test", test.name, beside=self.folder)
        if ref.language != "python" or not self.file.faults:
            return False
        try:
            return isinstance(getattr(type(load_test(ref)), "part", None), Parameter)
        except RtfError as error:
            self._fail(["tests", str(number), "name"], f"tests: {error}")

    # Cells -------------------------------------------------------------------------------------------------------

    def _cells(self) -> Iterator[Cell]:
        robots: Sequence[RobotTable | None] = self.file.robots or [None]
        for number, fault in enumerate(self.file.faults):
            self._check_targets(number, fault)
        for test, robot in product(self.file.tests, robots):
            broken = [*self._broken_cells(test, robot)]
            if self.file.healthy or (robot is not None and robot.real) or not self.file.faults:
                parts = dict.fromkeys(cell.part for cell in broken) or {"": None}
                yield from (Cell(test, robot, part=part) for part in parts)
            yield from broken

    def _broken_cells(self, test: TestTable, robot: RobotTable | None) -> Iterator[Cell]:
        model = self._robots.get(robot.model) if robot is not None and not robot.real else None
        if model is None:
            return
        for fault in self.file.faults:
            if test.faults is not None and fault.kind not in test.faults:
                continue
            for target in self._targets(fault, model):
                tested = self._of_a_part.get(test.name) and "part" not in test.parameters and target in model.index
                part = model.axis(target).part if tested else ""
                yield Cell(test, robot, fault, target, part)

    def _targets(self, fault: FaultTable, model: RobotModel) -> list[str]:
        """Return the targets of a fault that a robot has."""
        from rtf.simulator.faults import Target

        kind = self._kinds[fault.kind].target_kind
        if kind is Target.ROBOT:
            return [""]
        of_parts = [axis.name for part in fault.parts if part in model.parts for axis in model.parts[part].axes]
        targets = [*dict.fromkeys([*fault.targets, *of_parts])]
        return [one for one in targets if one in model.index] if kind is Target.AXIS else targets

    def _check_targets(self, number: int, fault: FaultTable) -> None:
        from rtf.simulator.faults import Target

        if self._kinds[fault.kind].target_kind is not Target.AXIS:
            return  # the simulator refuses those that it does not have
        keys, models = ["faults", str(number)], [model for model in self._robots.values() if model is not None]
        if not models:
            self._fail(keys, "faults: there is no simulated robot that could have them")
        joints = [name for model in models for name in model.index]
        for target in fault.targets:
            if target not in joints:
                self._fail([*keys, "targets"], f"faults: no robot has a joint {target!r}{did_you_mean(target, joints)}")
        parts = [name for model in models for name in model.parts]
        for part in fault.parts:
            if part not in parts:
                self._fail([*keys, "parts"], f"faults: no robot has a part {part!r}{did_you_mean(part, parts)}")

    # Tasks -------------------------------------------------------------------------------------------------------

    def task(self, cell: Cell, unit: int, seed: int, severity: float | None, overrides: Sequence[str]) -> Task:
        """Return the run of a cell with these values."""
        test, robot = cell.test, cell.robot
        parameters = {name: text_of(value) for name, value in test.parameters.items()}
        if cell.part:
            parameters["part"] = cell.part
        return Task(
            test=test.name,
            suite=test.suite,
            parameters=tuple(parameters.items()),
            define=self._define(cell, unit, seed) if test.suite else (),
            model=robot.model if robot is not None else "",
            unit=unit,
            real=_real(robot) if robot is not None and robot.real else None,
            seed=seed,
            fault=self._fault(cell, severity) if cell.fault else None,
            cameras=bool(robot is not None and robot.model) and _needs_cameras(cell),
            overrides=tuple((one.parameter, value) for one, value in zip(self.file.overrides, overrides, strict=True)),
        )

    def _define(self, cell: Cell, unit: int, seed: int) -> tuple[tuple[str, str], ...]:
        values = {name: text_of(value) for name, value in cell.test.define.items()}
        model = self._robots.get(cell.robot.model) if cell.robot is not None and not cell.robot.real else None
        if cell.robot is not None and model is not None:
            torque = (part.name for part in model.parts.values() if any(axis.torque_control for axis in part.axes))
            values = {
                "model": cell.robot.model,
                "unit": str(unit),
                "seed": str(seed),
                "parts": " ".join(model.parts),
                "torque_parts": " ".join(torque),
            } | values
        variables = self._variables[self.file.tests.index(cell.test)]
        return tuple((name, value) for name, value in values.items() if name in variables)

    def _fault(self, cell: Cell, severity: float | None) -> FaultValues:
        assert cell.fault is not None
        kind = self._kinds[cell.fault.kind]
        values = dict(cell.fault.values)
        if severity is not None:
            first = kind.parameters[0]
            values = {first.name: rounded((first.healthy or 0.0) + severity), **values}
        sized = kind.severity({name: value for name, value in values.items() if name not in _TIMES})
        return FaultValues(
            cell.fault.kind, cell.target, tuple(values.items()), severity if severity is not None else sized
        )

    def severities(self, cell: Cell) -> list[float | None] | Range:
        """Return the severities of a cell's fault; None stands for a healthy robot, or for the fault's default."""
        given = None if cell.fault is None else cell.fault.severities
        return [None] if given is None else given if isinstance(given, Range) else [*given]

    @staticmethod
    def _values(values: list[Value] | Range) -> list[str] | Range:
        return values if isinstance(values, Range) else [text_of(value) for value in values]

    # Files -------------------------------------------------------------------------------------------------------

    def _read_files(self) -> dict[str, bytes]:
        """Return the files that workers need, by their paths from the campaign's folder."""
        own = [test.name for test in self.file.tests] + [test.suite for test in self.file.tests]
        paths = {self.folder / name for name in own if name and (self.folder / name).is_file()}
        for number, pattern in enumerate(self.file.files):
            found = [path for path in self.folder.glob(pattern) if path.is_file()]
            if not found:
                self._fail(["files"], f"files: nothing matches pattern {number + 1}, {pattern!r}, beside this file")
            paths.update(found)
        files = {}
        for path in sorted(paths):
            if not path.resolve().is_relative_to(self.folder.resolve()):
                self._fail(
                    ["files"], f"files: {path} is not below the folder of this file, and cannot be sent to workers"
                )
            files[str(path.relative_to(self.folder))] = path.read_bytes()
        if sum(map(len, files.values())) > _MOST_BYTES:
            self._fail(["files"], f"files: they have more than {_MOST_BYTES >> 20} MiB; each run is sent all of them")
        return files


def suite_path(name: str, folder: Path) -> Path:
    """Return the path of a suite: beside the campaign's file, or else among those that are shipped."""
    beside = folder / name
    return beside if beside.is_file() else shipped_folder("suites") / name


def load_campaign(path: Path) -> Campaign:
    """Read a campaign. Raises CampaignError."""
    if not path.is_file():
        raise CampaignError(f"there is no file {path}; docs/campaigns.md has an example")
    return Campaign(path)


def _real(robot: RobotTable) -> RealRobot:
    host, _, port = robot.server.rpartition(":")
    return RealRobot(robot.name, host, int(port), robot.namespace, robot.ports.strip("/"))


def _needs_cameras(cell: Cell) -> bool:
    from rtf.robot_testing.proof import Case, Expectation

    kind = cell.fault.kind if cell.fault is not None else ""
    return Case(cell.test.name, Expectation.HEALTHY, kind).needs_cameras
