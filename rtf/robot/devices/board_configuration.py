"""The axes of a board as a configuration describes them, for drivers whose hardware does not report them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_float, as_string, to_string
from rtf.robot.interfaces import JointType, values_for
from rtf.robot.parameters import count, group_of, wrong

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.robot.devices.board_axes import BoardAxis

MAX_JOINTS = 1000
_TYPES = {"revolute": JointType.REVOLUTE, "prismatic": JointType.PRISMATIC}


def configured_axes(configuration: Property, default: BoardAxis, joints: int | None = None) -> list[BoardAxis]:
    """Return the axes of a configuration, with the values of ``default`` where it is silent.

    Its groups: ``GENERAL`` with ``Joints`` (their number), ``AxisName`` and ``AxisType`` (lists), and ``LIMITS`` with
    ``Min`` and ``Max`` (deg). ``joints`` is their number on a board that always has as many. Raises ConfigurationError,
    with the location, for an invalid value.
    """
    general, limits = group_of(configuration, "GENERAL"), group_of(configuration, "LIMITS")
    given = count(general, "Joints", joints or 1, MAX_JOINTS)
    if joints is not None and given != joints:
        raise wrong(general, "Joints", f"this board has {joints}, not {given}")
    joints = given
    names = _listed(general, "AxisName", joints) or [f"{default.name}{joint}" for joint in range(joints)]
    types = _listed(general, "AxisType", joints) or ["revolute"] * joints
    minima = _numbers(limits, "Min", joints, default.minimum)
    maxima = _numbers(limits, "Max", joints, default.maximum)
    for joint, (minimum, maximum) in enumerate(zip(minima, maxima, strict=True)):
        if minimum > maximum:
            raise wrong(limits, "Min", f"joint {joint} has a minimum above its maximum")
    return [
        replace(
            default,
            name=as_string(name),
            kind=_TYPES.get(as_string(kind), JointType.UNKNOWN),
            minimum=minimum,
            maximum=maximum,
        )
        for name, kind, minimum, maximum in zip(names, types, minima, maxima, strict=True)
    ]


def _listed(group: Property, key: str, joints: int) -> Bottle | None:
    """Return a list with an element for each joint; None if it is missing."""
    found = group.find_group(key)
    if found is None or len(found) == 1:
        return None
    value = found.get(1)
    if not isinstance(value, Bottle):
        value = found[1:]
    if len(value) != joints:
        raise wrong(group, key, f"{to_string(value)[:60]} is not a list of {joints} elements, one for each joint")
    return value


def _numbers(group: Property, key: str, joints: int, default: float) -> list[float]:
    """Return a number for each joint."""
    values = _listed(group, key, joints) or [default] * joints
    if not all(isinstance(value, int | float) for value in values):
        raise wrong(group, key, f"{to_string(group.find(key))[:60]} are not all numbers")
    return list(values_for(joints, [as_float(value) for value in values]))
