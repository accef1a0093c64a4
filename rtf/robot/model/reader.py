"""Reading ``robot.toml``: finding it, checking it, and completing it by the robot's description.

A file is ``robots/<name>/robot.toml`` below the current folder, in the user's folder of plug-ins, or among the shipped
suites; or it is given by its path. What no file says is read from the description (limits, efforts, types of joints),
which needs the package of the physics engine.
"""

from __future__ import annotations

import math
import os
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.errors import did_you_mean
from rtf.resources.toml_file import TomlFile
from rtf.robot.model.drives import drive_of
from rtf.robot.model.errors import RobotModelError
from rtf.robot.model.file import CouplingBlock, Joint, Motor, PartTable, RobotFile, ThresholdTable
from rtf.robot.model.names import DEFAULT_ROBOT, FILE, ROBOT_MODEL_VARIABLE
from rtf.robot.model.values import UNVALIDATED, Axis, Coupling, Part, RobotModel, Thresholds
from rtf.robot.model.workspace import workspace_of
from rtf.testing.plugins import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rtf.robot.model.description import JointDescription
    from rtf.robot.model.workspace import Workspace

#: Of a joint for which neither the file nor the description says more: those of a small bench.
_FALLBACK = Joint(max_velocity=90.0, gearbox=100.0, ratio=1.0)
_TICKS_A_DEGREE = 182.044  # 65536 a turn
#: Metres a second of a prismatic joint for which nothing is said.
_SLIDE = 0.2
#: Where thresholds may come from; and the parameters of tests that are none.
_MEASURED, _ORIGINS = "measured on ", ("chosen", UNVALIDATED)
_SUBJECTS = frozenset({"name", "description", "robot", "part", "joints", "inject"})
#: The share of the range of a prismatic joint that stands for a degree in tests: the whole is one of a hundred degrees.
SHARE = 0.01
#: What friction at rest has more, a share of the dry friction, and the speed (deg/s of the joint) at which half of that
#: is left: near those of an industrial robot's joints with their gears and grease, 1.35 times and some rad/s of the
#: motor (Bittencourt and Gunnarsson, "Static friction in a robot joint", 2012).
STRIBECK, STRIBECK_SPEED = 0.3, 3.0
_NAMES = "a name has letters, digits and underscores, and the robot's begins with a letter"
#: A coupling with a greater condition number cannot be inverted to any use.
_SINGULAR = 1e6


def robot_folders() -> list[Path]:
    """Return the folders in which robots are looked for, each ``<folder>/<name>/robot.toml``."""
    import platformdirs

    user = Path(platformdirs.user_data_dir("rtf", appauthor=False)) / "robots"
    return [Path.cwd() / "robots", user, shipped_folder("suites") / "robots"]


def robot_names() -> list[str]:
    """Return the names of all robots that can be found, without paths."""
    return sorted({path.parent.name for folder in robot_folders() for path in folder.glob(f"*/{FILE}")})


def find_robot(name: str) -> Path:
    """Return the file of a robot by its name, or by the path of its file or folder.

    Raises RobotModelError with the places tried.
    """
    given = Path(name).expanduser()
    if "/" in name or given.suffix == ".toml":
        path = given / FILE if given.is_dir() else given
        if path.is_file():
            return path
        raise RobotModelError(f"{path}: there is no such file; write the name of a robot, or the path of a {FILE}")
    for folder in robot_folders():
        path = folder / name / FILE
        if path.is_file():
            return path
    places = "\n".join(f"  tried {folder / name / FILE}" for folder in robot_folders())
    raise RobotModelError(f"there is no robot {name!r}; there are {', '.join(robot_names()) or 'none'}\n{places}")


@cache
def default_robot() -> RobotModel:
    """Return the robot that the variable ``RTF_ROBOT_MODEL`` names, else the iCub. Raises as :func:`load_robot`."""
    return load_robot(os.environ.get(ROBOT_MODEL_VARIABLE) or DEFAULT_ROBOT)


def load_robot(name: str) -> RobotModel:
    """Read a robot by its name or path. Raises RobotModelError, with the place, for all that is wrong with it."""
    return _Reading(find_robot(name)).model()


class _Reading:
    """The reading of one file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._toml: TomlFile[RobotFile] = TomlFile(path, RobotModelError)
        self._place, self._fail = self._toml.place, self._toml.fail
        self._check_numbers(self._toml.data)
        self._file = self._toml.converted(RobotFile, _NAMES)
        self._description = self._find_description()
        self._described: Mapping[str, JointDescription] | None = None

    def _check_numbers(self, data: Mapping[str, Any]) -> None:
        """Refuse infinite numbers, and those that are none; thresholds may be infinite."""
        for keys, value in _leaves(data):
            if isinstance(value, float) and not math.isfinite(value) and keys[0] != "thresholds":
                self._fail(keys, f"{'.'.join(keys)}: expected a finite number, not {value:g}")

    def _find_description(self) -> Path:
        given = self._file.description
        if not given.package:
            path = self._path.parent / given.file
            if not path.is_file():
                self._fail(["description", "file"], f"there is no {path}")
            return path
        try:
            files = distribution(given.package).files or []
        except PackageNotFoundError:
            self._fail(
                ["description", "package"], f"the package {given.package} is not installed: pip install {given.package}"
            )
        found = [file for file in files if str(file).endswith(given.file)]
        if len(found) != 1:
            self._fail(["description", "file"], f"{given.package} has {len(found)} files that end with {given.file}")
        return Path(str(found[0].locate())).resolve()

    def model(self) -> RobotModel:
        """Return the checked model."""
        file = self._file
        parts: dict[str, Part] = {}
        kinematic: dict[str, Part] = {}
        seen: dict[str, str] = {}
        for name, table in file.parts.items():
            for joint in table.joints:
                if joint in seen:
                    self._fail(
                        ["parts", name, "joints", joint],
                        f"the joint {joint} belongs to {seen[joint]} and {name}; a joint has one part",
                    )
                seen[joint] = name
            (kinematic if table.kinematic else parts)[name] = self._part(name, table)
        self._check_sensors(seen)
        self._check_outlines()
        return RobotModel(
            name=file.name,
            title=file.title or file.name,
            file=self._path.absolute(),  # for programs that run in other folders
            description=self._description,
            parts=parts,
            kinematic_parts=kinematic,
            body=file.body,
            sensors=file.sensors,
            guard=file.guard,
            scene=file.scene,
            profile=file.profile,
            assumed=tuple(file.assumed),
            workspace=self._workspace(),
            thresholds={name: self._thresholds(name, table) for name, table in file.thresholds.items()},
            safe_poses=self._safe_poses(
                [axis for part in (*parts.values(), *kinematic.values()) for axis in part.axes]
            ),
        )

    def _thresholds(self, test: str, table: ThresholdTable) -> Thresholds:
        keys = ["thresholds", test]
        origin = table.get("origin", "")
        if not (isinstance(origin, str) and (origin in _ORIGINS or origin.startswith(_MEASURED))):
            said = f", not {origin!r}" if origin else ""
            self._fail(
                [*keys, "origin"], f'thresholds of {test}: origin is "measured on …", "chosen" or "unvalidated"{said}'
            )
        values = {key: value for key, value in table.items() if key != "origin"}
        for key in _SUBJECTS & values.keys():
            self._fail([*keys, key], f"thresholds of {test}: {key} says what is tested; that is for suites to say")
        places = {key: self._place([*keys, key]) for key in values}
        return Thresholds(test, origin, values, self._place(keys), places)

    def _workspace(self) -> Workspace | None:
        if self._file.workspace is None:
            return None
        try:
            return workspace_of(self._file.workspace)
        except ValueError as error:
            self._fail(["workspace"], f"workspace: {error}")

    def _safe_poses(self, axes: Sequence[Axis]) -> dict[str, dict[str, float]]:
        """Return the safe poses, completed by the home positions."""
        by_name = {axis.name: axis for axis in axes}
        for name, pose in self._file.safe.items():
            for joint, place in pose.items():
                keys, axis = ["safe", name, joint], by_name.get(joint)
                if axis is None:
                    self._fail(keys, f"safe pose {name}: there is no joint {joint!r}{did_you_mean(joint, by_name)}")
                if not axis.minimum <= place <= axis.maximum:
                    self._fail(
                        keys,
                        f"safe pose {name}: {joint} at {place:g} {axis.unit} is not within its limits "
                        f"{axis.minimum:g} and {axis.maximum:g}",
                    )
        home = {axis.name: axis.home for axis in axes}
        return {name: {**home, **pose} for name, pose in self._file.safe.items()}

    def _part(self, name: str, table: PartTable) -> Part:
        if not table.joints:
            self._fail(["parts", name], f"the part {name} has no joints")
        axes = tuple(self._axis(name, joint, table) for joint in table.joints)
        couplings = self._couplings(name, table)
        unknown = [j for queue in table.together for group in queue for j in group if j not in table.joints]
        if unknown:
            self._fail(["parts", name, "together"], f"{name} has no joint {', '.join(unknown)}")
        unknown = [joint for joint in table.light if joint not in table.joints]
        if unknown:
            self._fail(["parts", name, "light"], f"{name} has no joint {', '.join(unknown)}")
        together = tuple(tuple(tuple(group) for group in queue) for queue in table.together)
        return Part(name, axes, couplings, together, frozenset(table.light))

    # Axes ------------------------------------------------------------------------------------------------------------

    def _axis(self, part: str, name: str, table: PartTable) -> Axis:
        keys = ["parts", part, "joints", name]
        file, given = self._file, table.joints[name]
        described = None if table.kinematic else self._needed_description(given, name)
        prismatic = _first(given.prismatic, described.prismatic if described else None, False)
        if described and described.prismatic != prismatic:
            self._fail(keys, f"{name}: prismatic does not agree with {self._description.name}")

        def value(key: str, described_value: float | None = None) -> Any:
            return _first(*(getattr(one, key) for one in (given, file.defaults)), described_value)

        limits = self._limits(keys, given, described)
        motor = self._motor(keys, given)
        torque = value("max_torque", described.effort if described else None)
        if torque is None:
            if not table.kinematic:
                self._fail(keys, f"{name}: neither this file nor {self._description.name} has its max_torque")
            torque = 1.0
        ratio = _first(value("ratio"), _FALLBACK.ratio)
        gearbox = _first(value("gearbox"), _FALLBACK.gearbox)
        home = _first(value("home"), min(max(0.0, limits[0]), limits[1]))
        for key, number in (("gearbox", gearbox), ("ratio", ratio)):
            if not number:
                self._fail(
                    self._origin(keys, given, key), f"{name}: {key} is 0; write the turns of the motor, or leave it"
                )
        if not limits[0] <= home <= limits[1]:
            self._fail(keys, f"{name}: its home {home:g} is not within its limits {limits[0]:g} and {limits[1]:g}")
        if given.degree is not None and not prismatic:
            self._fail(keys, f"{name}: degree is for prismatic joints, and this one turns")
        degree = _first(value("degree"), SHARE * (limits[1] - limits[0])) if prismatic else math.radians(1.0)
        speed = described.max_velocity if described else None
        fastest = _first(value("max_velocity", speed), _SLIDE if prismatic else _FALLBACK.max_velocity)
        motor_torque = _first(given.motor_torque, torque)
        return Axis(
            part=part,
            name=name,
            minimum=float(limits[0]),
            maximum=float(limits[1]),
            max_velocity=fastest,
            max_torque=torque,
            gearbox=gearbox,
            encoder_resolution=_first(
                value("encoder_resolution"), _TICKS_A_DEGREE / degree if prismatic else _TICKS_A_DEGREE
            ),
            rotor_resolution=motor.rotor_resolution,
            armature=value("armature"),
            friction=value("friction"),
            stribeck=_first(value("stribeck"), STRIBECK),
            stribeck_speed=_first(value("stribeck_speed"), STRIBECK_SPEED * (degree if prismatic else 1.0)),
            damping=value("damping"),
            play=_first(value("play"), 0.0),
            stiffness=value("stiffness"),
            home=home,
            nominal_current=motor.nominal_current,
            peak_current=motor.peak_current,
            overload_current=motor.overload_current,
            drive=drive_of(motor, torque=motor_torque, speed=fastest, gearbox=gearbox, prismatic=prismatic),
            torque_control=_first(value("torque_control"), False),
            ratio=ratio,
            prismatic=prismatic,
            degree=degree,
        )

    def _limits(self, keys: list[str], given: Joint, described: JointDescription | None) -> tuple[float, float]:
        name = keys[-1]
        limits = given.limits or (described.limits if described else None)
        if limits is None:
            self._fail(keys, f"{name}: neither this file nor {self._description.name} has its limits; write limits")
        if not (limits[0] < limits[1] and all(map(math.isfinite, limits))):
            self._fail(keys, f"{name}: limits are a smaller and a greater number, not {limits[0]:g} and {limits[1]:g}")
        return limits

    def _motor(self, keys: list[str], given: Joint) -> Motor:
        motors, chosen = self._file.motors, given.motor or self._file.defaults.motor
        if chosen is None or chosen not in motors:
            known = ", ".join(motors) or "none; write a table [motors.NAME]"
            place = self._origin(keys, given, "motor")
            self._fail(place, f"{keys[-1]}: motor {chosen!r} is none of [motors]: {known}")
        return motors[chosen]

    def _origin(self, keys: Sequence[str], given: Joint, key: str) -> Sequence[str]:
        """Return where a key of a joint is said: in its own line, else in ``[defaults]``."""
        said = getattr(given, key) is None and getattr(self._file.defaults, key) is not None
        return ["defaults", key] if said else keys

    def _needed_description(self, given: Joint, name: str) -> JointDescription | None:
        """Return what the description says of a joint; None if the file says all, so that it need not be read."""
        if given.limits and _first(given.max_torque, self._file.defaults.max_torque) is not None:
            return None
        if self._described is None:
            from rtf.robot.model.description import read_joints

            self._described = read_joints(self._description)
        if name not in self._described:
            self._fail(
                ["parts", *(part for part, table in self._file.parts.items() if table.joints.get(name) is given),
                 "joints", name],
                f"{self._description.name} has no joint {name!r}; its joints are {', '.join(self._described)}",
            )  # fmt: skip
        return self._described[name]

    def _couplings(self, part: str, table: PartTable) -> tuple[Coupling, ...]:
        """Return the couplings of a part, completed by identities for the joints that none names."""
        count = len(table.joints)
        sizes = table.boards or [count]
        keys = ["parts", part]
        if sum(sizes) != count:
            self._fail([*keys, "boards"], f"{part}: its boards have {sum(sizes)} joints together, the part {count}")
        given: dict[int, CouplingBlock] = {}
        for number, one in enumerate(table.couplings):
            if one.first in given:
                place = [*keys, "couplings", str(number)]
                self._fail(place, f"{part}: there are two couplings from joint {one.first}; a board has one")
            given[one.first] = one
        found: list[Coupling] = []
        first = 0
        for size in sizes:
            block = given.pop(first, None)
            if block is None:
                rows = tuple(tuple(float(row == column) for column in range(size)) for row in range(size))
            else:
                number = table.couplings.index(block)
                rows = self._matrix([*keys, "couplings", str(number)], part, block, size)
            found.append(Coupling(first, rows))
            first += size
        if given:
            self._fail(
                [*keys, "couplings"], f"{part}: no board begins at joint {', '.join(map(str, given))}; see boards"
            )
        return tuple(found)

    def _matrix(self, keys: Sequence[str], part: str, block: CouplingBlock, size: int) -> tuple[tuple[float, ...], ...]:
        rows = tuple(tuple(map(float, row)) for row in block.joint_to_motor)
        if len(rows) != size or any(len(row) != size for row in rows):
            self._fail(keys, f"{part}: the coupling from joint {block.first} is not {size} rows of {size} numbers")
        if not np.isfinite(rows).all() or np.linalg.cond(np.array(rows)) > _SINGULAR:
            self._fail(keys, f"{part}: the coupling from joint {block.first} cannot be inverted")
        return rows

    def _check_sensors(self, joints: Mapping[str, str]) -> None:
        sensors = self._file.sensors
        for name, sensor in sensors.force_torque.items():
            for part in sensor.parts:
                if part not in self._file.parts:
                    self._fail(["sensors", "force_torque", name], f"{name}: there is no part {part!r}")
        self._check_ports()
        for name, angles in sensors.angles.items():
            for axis, _ in angles.channels:
                if axis not in joints:
                    self._fail(["sensors", "angles", name], f"{name}: there is no joint {axis!r}")
        for name, camera in sensors.depth_cameras.items():
            if not camera.near < camera.far:
                self._fail(
                    ["sensors", "depth_cameras", name],
                    f"{name}: near, {camera.near:g} m, is less than far, {camera.far:g} m",
                )
        battery = sensors.battery
        if battery is not None and not battery.empty < battery.full:
            self._fail(
                ["sensors", "battery", "empty"],
                f"the voltage of an empty battery, {battery.empty:g} V, is less than that of a full one, "
                f"{battery.full:g} V",
            )

    def _check_ports(self) -> None:
        """Refuse two sensors of a kind on one port."""
        for kind in ("force_torque", "inertial", "cameras", "angles", "skin", "depth_cameras"):
            ports: dict[str, str] = {}
            for name, sensor in getattr(self._file.sensors, kind).items():
                other = ports.setdefault(sensor.port, name)
                if other != name:
                    keys = ["sensors", kind, name]
                    self._fail(keys, f"{name} and {other} have the same port, {sensor.port}; each needs its own")

    def _check_outlines(self) -> None:
        for number, shape in enumerate(self._file.body.outlines):
            capsule = [value is not None for value in (shape.start, shape.end, shape.radius)]
            box = [value is not None for value in (shape.centre, shape.half)]
            if not ((all(capsule) and not any(box)) or (all(box) and not any(capsule))):
                self._fail(
                    ["body", "outlines", str(number)],
                    f"outline {number} of {shape.link}: write start, end and radius, or centre and half",
                )


def _leaves(value: object, keys: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield all values that are no tables and arrays, each with its keys."""
    if isinstance(value, dict | list):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(one, (*keys, str(key)))
    else:
        yield keys, value


def _first(*values: Any) -> Any:
    """Return the first value that is not None."""
    return next((value for value in values if value is not None), None)
