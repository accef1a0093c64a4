"""The target devices of actions: those to attach to, and those to calibrate or park."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Value, to_string
from rtf.errors import nearest
from rtf.robot.errors import ConfigurationError
from rtf.robot.interface.model import ActionKind

if TYPE_CHECKING:
    from rtf.errors import Location
    from rtf.robot.interface.model import Action, Robot
    from rtf.robot.interface.problems import ProblemLog

#: The type of device whose attach always passes the list of the robot's devices.
DESCRIBING = "robotDescription_nws_yarp"


class TargetError(ConfigurationError):
    """An action has an invalid target; ``location`` is its place."""

    def __init__(self, sentence: str, location: Location) -> None:
        super().__init__(sentence)
        self.location = location


def check_targets(robot: Robot, problems: ProblemLog) -> None:
    """Record an error for every action without a target, or with an unknown one."""
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
    """Return the devices of an ``attach``: their keys in the configuration, and their names. Raises TargetError.

    A key is the network if one is named, else the name of the device.
    """
    given = action.parameters
    if is_describing(robot, action):
        return {}
    ways = [key for key in ("device", "networks", "all") if given.check(key)]
    if len(ways) != 1 or (given.check("network") and ways != ["device"]):
        said = " and ".join(key for key in ("device", "network", "networks", "all") if given.check(key)) or "nothing"
        raise TargetError(
            f"it has {said}; write one of 'device' (perhaps with 'network'), 'networks' and 'all'", action.location
        )
    if ways == ["all"]:
        return {device.name: device.name for device in robot.devices if device.name != action.device}
    if ways == ["networks"]:
        return {name: _device(robot, action, name) for name in _networks(action)}
    name = _device(robot, action, "device")
    return {to_string(given.find("network")) if given.check("network") else name: name}


def is_describing(robot: Robot, action: Action) -> bool:
    """Return whether the device of an action publishes the list of the robot's devices."""
    entry = robot.device(action.device)
    return entry is not None and entry.kind == DESCRIBING


def target(robot: Robot, action: Action) -> str:
    """Return the device that is calibrated or parked. Raises TargetError."""
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
    """Return the name of the device in a parameter of the action."""
    if not action.parameters.check(key):
        raise TargetError(
            f"the network {key!r} has no device; write <param name={key!r}>DEVICE</param>", action.location
        )
    name = to_string(action.parameters.find(key))
    if name == action.device:
        raise TargetError(f"the device {name!r} cannot be its own target; name another one", _place(action, key))
    if robot.device(name) is None:
        known = [device.name for device in robot.devices if device.name != action.device]
        near = nearest(name, known)
        hint = f"is it {near!r}?" if near else f"known are {', '.join(known[:20]) or 'none'}"
        raise TargetError(f"there is no device {name[:100]!r}; {hint}", _place(action, key))
    return name


def _place(action: Action, key: str) -> Location:
    return action.parameters.location(key) or action.location
