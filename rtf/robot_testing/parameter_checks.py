"""Checks of the parameters of a robot test that need no robot: consistent lists and ranges."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.parameters import ParameterError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from rtf.testing.parameters import Declared


def refuse(test: Declared, problems: Sequence[str]) -> None:
    """Raise ParameterError if there are problems; for ``check_parameters``."""
    if problems:
        raise ParameterError(type(test).__name__, problems)


def joint_count(test: Declared) -> int:
    """Return the number of joints in the parameter ``joints``, a list or a number; 0: all of the part, or none."""
    joints = test.parameter_values().get("joints", 0)
    return joints if isinstance(joints, int) else len(joints)


def wrong_lists(test: Declared, not_per_joint: Collection[str] = ()) -> list[str]:
    """Return the errors of lists of numbers that need no value, one value for all joints, or one for each joint.

    ``not_per_joint`` are the names of other lists. Without named joints the longest list gives their number.
    """
    lists = {key: len(getattr(test, name)) for name, key in _lists(test, not_per_joint)}
    count, of = joint_count(test), "joints"
    if not count and lists:
        longest = max(lists, key=lambda key: lists[key])
        count, of = lists[longest], f"joints that {longest} has values for"
    return [
        f"{key} has {length} values; give one, or one for each of the {count} {of} ({test.parameter_source(key)})"
        for key, length in lists.items()
        if length != count
    ]


def drop_surplus(test: Declared, not_per_joint: Collection[str] = ()) -> list[str]:
    """Cut lists of ``.ini`` files that are longer than ``joints``; return a warning for each.

    The C++ tests do so, and some of the files that are used with them have such lists.
    """
    count = joint_count(test)
    warnings = []
    for name, key in _lists(test, not_per_joint):
        values, source = getattr(test, name), test.parameter_source(key)
        if 0 < count < len(values) and source.rpartition(":")[0].endswith(".ini"):
            setattr(test, name, values[:count])
            surplus = f"{key} has {len(values)} values for {count} joints; those at its end are ignored"
            warnings.append(f"{surplus} ({source})")
    return warnings


def _lists(test: Declared, not_per_joint: Collection[str]) -> list[tuple[str, str]]:
    """Return name and key of each list of numbers with more than one value, but for ``not_per_joint``."""
    values = test.parameter_values()
    return [
        (name, parameter.key)
        for name, parameter in test.declarations().items()
        if parameter.kind == list[float] and name not in not_per_joint and len(values[name]) > 1
    ]


def swapped_ends(test: Declared) -> list[str]:
    """Return warnings about the ends of moves in ``low`` and ``high``: a lower end that is not below its upper end."""
    low, high = (declared.key if (declared := test.declarations().get(name)) else name for name in ("low", "high"))
    source = test.parameter_source(high)
    return [
        f"{high}: element {place} is {top:g}, "
        + (
            f"equal to that of {low}: the joint does not move ({source})"
            if top == bottom
            else f"below that of {low}, {bottom:g}: the joint moves to its lower end first ({source})"
        )
        for place, bottom, top in _without_room(test, "low", "high")
    ]


def swapped_limits(test: Declared, low: str, high: str) -> list[str]:
    """Return the errors of limits in the lists ``low`` and ``high``: a lower limit that is not below its upper one."""
    source = test.parameter_source(high)
    return [
        f"{high}: element {place} is {top:g}; it has to be above that of {low}, {bottom:g} ({source})"
        for place, bottom, top in _without_room(test, low, high)
    ]


def _without_room(test: Declared, low: str, high: str) -> list[tuple[int, float, float]]:
    """Return index and values of all elements where ``low`` is not below ``high``, up to the shorter list."""
    values = test.parameter_values()
    lows, highs = values.get(low), values.get(high)
    if not (isinstance(lows, list) and isinstance(highs, list) and lows and highs):
        return []
    count = max(len(lows), len(highs))
    lows, highs = (one * count if len(one) == 1 else one for one in (lows, highs))
    return [(place, bottom, top) for place, (bottom, top) in enumerate(zip(lows, highs, strict=False)) if top <= bottom]
