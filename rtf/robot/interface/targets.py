"""Which devices an action is about: what it is attached to, and what is calibrated or parked."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Value, to_string
from rtf.robot.errors import ConfigurationError
from rtf.robot.interface.model import ActionKind

if TYPE_CHECKING:
    from rtf.errors import Location
    from rtf.robot.interface.model import Action, Robot
    from rtf.robot.interface.problems import ProblemLog

#: The type of device that is told which devices the robot has, whatever its attach says.
DESCRIBING = "robotDescription_nws_yarp"


class TargetError(ConfigurationError):
    """An action says what cannot be done; ``location`` is where."""

    def __init__(self, sentence: str, location: Location) -> None:
        super().__init__(sentence)
        self.location = location


def check_targets(robot: Robot, problems: ProblemLog) -> None:
    """Note every action that names a device that is not there, or none."""
    for device in robot.devices:
        for action in device.actions:
            try:
                if action.kind is ActionKind.ATTACH:
                    attachments(robot, action)
                elif action.kind.moves:
                    target(robot, action)
            except TargetError as error:
                problems.error(error.location, f"{action}: {error}")


def attachments(robot: Robot, action: Action) -> dict[str, str]:
    """What an ``attach`` means: what the configuration calls a device there, and the device's name. Raises TargetError.

    That is the network where one is named, else the device's name.
    """
    given = action.parameters
    if is_describing(robot, action):
        return {}
    ways = [key for key in ("device", "networks", "all") if given.check(key)]
    if len(ways) != 1 or (given.check("network") and ways != ["device"]):
        said = " and ".join(key for key in ("device", "network", "networks", "all") if given.check(key)) or "nothing"
        raise TargetError(
            f"it says {said}; write one of 'device' (perhaps with 'network'), 'networks' and 'all'", action.location
        )
    if ways == ["all"]:
        return {device.name: device.name for device in robot.devices if device.name != action.device}
    if ways == ["networks"]:
        return {name: _device(robot, action, name) for name in _networks(action)}
    name = _device(robot, action, "device")
    return {to_string(given.find("network")) if given.check("network") else name: name}


def is_describing(robot: Robot, action: Action) -> bool:
    """Whether the device of an action is one that is told which devices the robot has."""
    entry = robot.device(action.device)
    return entry is not None and entry.kind == DESCRIBING


def target(robot: Robot, action: Action) -> str:
    """The device that is calibrated or parked. Raises TargetError."""
    if not action.parameters.check("target"):
        raise TargetError('it names no device to move; write <param name="target">DEVICE</param>', action.location)
    return _device(robot, action, "target")


def _networks(action: Action) -> list[str]:
    values: list[Value] = [*(action.parameters.find_group("networks") or Bottle())[1:]]
    if len(values) == 1 and isinstance(values[0], Bottle):
        values = [*values[0]]
    names = [to_string(value) for value in values]
    if not names or len({*names}) != len(names):
        said = "names a network twice" if names else "names no network"
        raise TargetError(f"'networks' {said}; write it as (NAME NAME …)", _place(action, "networks"))
    return names


def _device(robot: Robot, action: Action, key: str) -> str:
    """The name of the device under a key of the action."""
    if not action.parameters.check(key):
        raise TargetError(
            f"the network {key!r} has no device; write <param name={key!r}>DEVICE</param>", action.location
        )
    name = to_string(action.parameters.find(key))
    if name == action.device:
        raise TargetError(f"the device {name!r} is meant to work with itself; name another one", _place(action, key))
    if robot.device(name) is None:
        known = [device.name for device in robot.devices if device.name != action.device]
        near = difflib.get_close_matches(name, known, 1)
        hint = f"is it {near[0]!r}?" if near else f"known are {', '.join(known[:20]) or 'none'}"
        raise TargetError(f"there is no device {name[:100]!r}; {hint}", _place(action, key))
    return name


def _place(action: Action, key: str) -> Location:
    return action.parameters.location(key) or action.location
