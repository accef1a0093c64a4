"""The reader of robot files: from elements to devices, their configurations and their actions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rtf.bottle import Bottle, Property, as_float, to_string
from rtf.robot.interface.action_targets import check_targets
from rtf.robot.interface.includes import Tags, load
from rtf.robot.interface.model import ACTING, Action, ActionKind, DeviceEntry, Phase, Robot
from rtf.robot.interface.parameters import AUTOMATIC, TAGS, ParameterReader, Settings, to_property
from rtf.robot.interface.problems import Problem, ProblemLog, RobotFileError

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from rtf.xml_tree import Element

MAX_LEVEL = 1_000_000
MAX_BUILD = (1 << 32) - 1
MAX_DEVICES = 1000
MAX_ACTIONS = 10_000
#: The largest number of parameters of ``devices``, which each device inside gets.
MAX_SHARED = 1000
#: The longest timeout of an action, in seconds.
MAX_TIMEOUT = 86400.0

E = TypeVar("E", Phase, ActionKind)


@dataclass(frozen=True, slots=True)
class ReadResult:
    """A robot, the warnings about its files, and the keys in their ``extern-name`` attributes."""

    robot: Robot
    warnings: tuple[Problem, ...]
    asked: frozenset[str]


def read_robot(
    path: str | os.PathLike[str], given: Property | None = None, *, allow_deprecated_dtd: bool = False
) -> ReadResult:
    """Read a robot from a file and the files in its folder that this one includes.

    ``given`` are the command line's parameters: ``portprefix`` replaces that of the file, ``enable_tags``,
    ``disable_tags`` and ``enable_all`` select what is included, and those in ``extern-name`` attributes replace the
    text of the parameter. Raises RobotFileError with all problems.
    """
    given = Property() if given is None else given
    problems = ProblemLog()
    try:
        root = load(Path(path), _tags(given), problems, allow_deprecated=allow_deprecated_dtd)
    except RobotFileError as error:
        raise _all_of(problems, error) from None
    reader = _Reader(problems, given)
    try:
        robot = reader.robot(root)
        if robot is not None:
            check_targets(robot, problems)
    except RobotFileError as error:
        raise _all_of(problems, error) from None
    problems.judge()
    assert robot is not None
    return ReadResult(robot, tuple(problems.warnings), frozenset(reader.asked))


def _all_of(problems: ProblemLog, last: RobotFileError) -> RobotFileError:
    return RobotFileError(tuple(dict.fromkeys((*problems.errors, *last.problems))))


def _tags(given: Property) -> Tags:
    enabled, disabled = frozenset(_words(given, "enable_tags")), frozenset(_words(given, "disable_tags"))
    return Tags(enabled, disabled, given.check("enable_all") or "enable_all" in enabled)


def _words(given: Property, key: str) -> Iterator[str]:
    for value in (given.find_group(key) or Bottle())[1:]:
        for word in value if isinstance(value, Bottle) else [value]:
            yield from to_string(word).split()


class _Reader:
    """Reads one robot. Errors are recorded, and reading continues."""

    def __init__(self, problems: ProblemLog, given: Property) -> None:
        self._problems = problems
        self._given = given
        self._parameters = ParameterReader(problems, {}, given)
        self._robot_name = ""
        self._prefix = ""
        self._devices: dict[str, DeviceEntry] = {}
        self._action_count = 0

    @property
    def asked(self) -> set[str]:
        """The keys in ``extern-name`` attributes."""
        return self._parameters.asked

    def robot(self, root: Element) -> Robot | None:
        """Return the robot; None if the file has another root element, which is recorded as an error."""
        if root.tag != "robot":
            self._problems.error(root.location, f"the file holds <{root.tag[:40]}>", "a robot begins with <robot>")
            return None
        self._parameters.check_attributes(root, "name", "build", "portprefix", "reverse-shutdown-action-order")
        name = self._robot_name = self._parameters.name_of(root)
        build = self._build(root)
        self._prefix = self._portprefix(root, name)
        self._parameters.variables = {
            "portprefix": self._prefix,
            "robotname": name,
            "portprefixnoslash": self._prefix.lstrip("/"),
        }
        settings = self._content(root, ())
        return Robot(
            name=name,
            portprefix=self._prefix,
            build=build,
            reverse_shutdown=self._truth(root, "reverse-shutdown-action-order"),
            parameters=to_property(settings, self._problems, f"the robot {name!r}"),
            devices=tuple(self._devices.values()),
            location=root.location,
        )

    # Attributes --------------------------------------------------------------------------------------------------

    def _build(self, root: Element) -> int:
        text = root.attributes.get("build")
        if text is None:
            self._problems.warn(root.location, "<robot> has no build, 0 is assumed", 'write build="0"')
            return 0
        return self._number(root, "build", MAX_BUILD) or 0

    def _portprefix(self, root: Element, name: str) -> str:
        prefix = root.attributes.get("portprefix", "").strip() or name
        if self._given.check("portprefix"):
            prefix = to_string(self._given.find("portprefix"))
        if any(map(str.isspace, prefix)) or not prefix.isprintable():
            self._problems.error(
                root.location, f"the prefix {prefix[:100]!r} is not a port name", "write it without blanks"
            )
        elif not prefix.startswith("/"):
            self._problems.warn(
                root.location, f"the prefix {prefix!r} does not begin with '/'; the port is called /{prefix}/…"
            )
        return prefix

    def _number(self, element: Element, name: str, most: int) -> int | None:
        text = element.attributes.get(name, "").strip()
        if text.isascii() and text.isdigit() and len(text) <= len(str(most)) and int(text) <= most:
            return int(text)
        said = f"{text[:40]!r} is not" if name in element.attributes else "there is none"
        self._problems.error(element.location, f"the {name} of <{element.tag}> is a whole number from 0; {said}")
        return None

    def _truth(self, element: Element, name: str) -> bool:
        text = element.attributes.get(name, "false").strip().lower()
        if text not in ("true", "1", "false", "0"):
            self._problems.error(element.location, f"the attribute {name!r} is true or false, not {text[:40]!r}")
        return text in ("true", "1")

    def _choice(self, element: Element, name: str, choices: type[E]) -> E | None:
        text = element.attributes.get(name, "").strip()
        found = next((one for one in choices if one == text), None)
        if found is None or found is Phase.UNKNOWN:
            known = ", ".join(ACTING if choices is Phase else choices)
            said = f"{text[:40]!r} is not" if text else "there is none"
            self._problems.error(element.location, f"the {name} of <{element.tag}> is one of {known}; {said}")
            return None
        return found

    # Elements ----------------------------------------------------------------------------------------------------

    def _content(self, element: Element, above: Settings) -> Settings:
        """Read the content of ``robot`` or ``devices``. Return its parameters. Each device gets ``above``, too."""
        self._parameters.check_text(element)
        settings: list[Settings] = []
        for child in element.children:
            if child.tag in TAGS:
                settings.append(self._parameters.read(child))
            elif child.tag not in ("devices", "device"):
                self._parameters.unexpected(child, element, (*TAGS, "devices", "device"))
        own: Settings = sum(settings, ())
        shared = above if element.tag == "robot" else (*above, *own)
        if len(shared) > MAX_SHARED:
            self._problems.error(element.location, f"more than {MAX_SHARED} parameters are given to every device")
            return own
        for child in element.children:
            if child.tag == "devices":
                self._parameters.check_attributes(child, "robot", "build")
                self._content(child, shared)
            elif child.tag == "device":
                self._device(child, shared)
        return own

    def _device(self, element: Element, shared: Settings) -> None:
        self._parameters.check_attributes(element, "name", "type")
        self._parameters.check_text(element)
        name, kind = self._parameters.name_of(element), element.attributes.get("type", "").strip()
        if not kind:
            self._problems.error(element.location, f"the device {name!r} has no type", 'write type="…"')
        settings: list[Settings] = [shared]
        actions: list[Action] = []
        for child in element.children:
            if child.tag in TAGS:
                settings.append(self._parameters.read(child))
            elif child.tag in ("action", "actions"):
                actions += self._actions(child, name)
            else:
                self._parameters.unexpected(child, element, (*TAGS, "action", "actions"))
        configuration = to_property(sum(settings, ()), self._problems, f"the device {name!r}")
        entry = DeviceEntry(name, kind, self._complete(configuration, name, kind), tuple(actions), element.location)
        if name in self._devices:
            first = self._devices[name].location
            self._problems.error(element.location, f"there is a device {name!r} already, in {first}", "rename one")
        elif len(self._devices) >= MAX_DEVICES:
            raise RobotFileError.of(element.location, f"the robot has more than {MAX_DEVICES} devices")
        elif name:
            self._devices[name] = entry

    def _complete(self, configuration: Property, name: str, kind: str) -> Property:
        """Add the automatic keys to a device's configuration."""
        made = Property()
        for key, value in zip(AUTOMATIC, (name, kind, self._prefix), strict=True):
            place = configuration.location(key)
            if place is not None:
                self._problems.warn(place, f"the parameter {key!r} of the device {name!r} is always {value!r}")
            configuration.remove(key)
            made.put(key, value)
        made.update(configuration)
        return made

    def _actions(self, element: Element, device: str) -> Iterator[Action]:
        if element.tag == "action":
            found = self._action(element, device)
            if found is not None:
                yield found
            return
        self._parameters.check_attributes(element, "robot", "build")
        self._parameters.check_text(element)
        for child in element.children:
            if child.tag in ("action", "actions"):
                yield from self._actions(child, device)
            else:
                self._parameters.unexpected(child, element, ("action", "actions"))

    def _action(self, element: Element, device: str) -> Action | None:
        self._action_count += 1
        if self._action_count > MAX_ACTIONS:
            raise RobotFileError.of(element.location, f"the robot has more than {MAX_ACTIONS} actions")
        self._parameters.check_attributes(element, "phase", "level", "type")
        self._parameters.check_text(element)
        phase = self._choice(element, "phase", Phase)
        kind = self._choice(element, "type", ActionKind)
        level = self._number(element, "level", MAX_LEVEL)
        settings: list[Settings] = []
        for child in element.children:
            if child.tag in TAGS:
                settings.append(self._parameters.read(child))
            else:
                self._parameters.unexpected(child, element, TAGS)
        whose = f"the action {kind} of the device {device!r}"
        parameters = to_property(sum(settings, ()), self._problems, whose)
        if phase is None or kind is None or level is None:
            return None
        if phase is Phase.RUN:
            self._problems.warn(element.location, f"{whose} is ignored: the phase run has none")
            return None
        return Action(device, phase, level, kind, parameters, self._timeout(element, parameters), element.location)

    def _timeout(self, element: Element, parameters: Property) -> float | None:
        if not parameters.check("timeout"):
            return None
        value = parameters.find("timeout")
        seconds = as_float(value) if isinstance(value, int | float) else math.nan
        if not 0 < seconds <= MAX_TIMEOUT:
            place = parameters.location("timeout") or element.location
            self._problems.error(place, f"the timeout is a number of seconds up to {MAX_TIMEOUT:g}")
            return None
        return seconds
