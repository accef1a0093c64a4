"""What can be said of the parameters of a robot test without a robot: whether they fit each other, and are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.parameters import ParameterError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from rtf.testing.parameters import Declared


def refuse(test: Declared, problems: Sequence[str]) -> None:
    """Raise ParameterError where there are any; for ``check_parameters``."""
    if problems:
        raise ParameterError(type(test).__name__, problems)


def joint_count(test: Declared) -> int:
    """How many joints a test names in ``joints``, a list of them or their number; 0: all of the part, or none."""
    joints = test.parameter_values().get("joints", 0)
    return joints if isinstance(joints, int) else len(joints)


def wrong_lists(test: Declared, apart: Collection[str] = ()) -> list[str]:
    """What is wrong with lists of numbers that have one value for all joints, or one for each; none is fine, too.

    ``apart`` are the names of those that are something else. Where no joints are named the longest list says how many.
    """
    values = test.parameter_values()
    lists = {
        parameter.key: len(values[name])
        for name, parameter in test.declarations().items()
        if parameter.kind == list[float] and name not in apart and len(values[name]) > 1
    }
    count, of = joint_count(test), "joints"
    if not count and lists:
        longest = max(lists, key=lambda key: lists[key])
        count, of = lists[longest], f"joints that {longest} has values for"
    return [
        f"{key} has {length} values; give one, or one for each of the {count} {of} ({test.parameter_source(key)})"
        for key, length in lists.items()
        if length != count
    ]


def swapped_ends(test: Declared) -> list[str]:
    """What is odd about ends of moves, given in ``low`` and ``high``: a lower one that is not below its upper one."""
    low, high = (declared.key if (declared := test.declarations().get(name)) else name for name in ("low", "high"))
    source = test.parameter_source(high)
    return [
        f"{high}: element {place} is {top:g}, "
        + (
            f"as that of {low}: the joint does not move ({source})"
            if top == bottom
            else f"below that of {low}, {bottom:g}: the joint begins with its lower end ({source})"
        )
        for place, bottom, top in _without_room(test, "low", "high")
    ]


def swapped_limits(test: Declared, low: str, high: str) -> list[str]:
    """What is wrong with limits that are given in two lists: a lower one that is not below its upper one."""
    source = test.parameter_source(high)
    return [
        f"{high}: element {place} is {top:g}; it has to be above that of {low}, {bottom:g} ({source})"
        for place, bottom, top in _without_room(test, low, high)
    ]


def _without_room(test: Declared, low: str, high: str) -> list[tuple[int, float, float]]:
    """The place and the two values where that of list ``low`` is not below that of list ``high``; as far as both go."""
    values = test.parameter_values()
    lows, highs = values.get(low), values.get(high)
    if not (isinstance(lows, list) and isinstance(highs, list) and lows and highs):
        return []
    count = max(len(lows), len(highs))
    lows, highs = (one * count if len(one) == 1 else one for one in (lows, highs))
    return [(place, bottom, top) for place, (bottom, top) in enumerate(zip(lows, highs, strict=False)) if top <= bottom]


def wrong_fault(test: Declared) -> list[str]:
    """What is wrong with ``inject``: a kind, a joint or a number that the simulator would refuse."""
    text = test.parameter_values()["inject"]
    if not text:
        return []
    # The faults come with the whole simulator, which few tests need.
    import difflib

    from rtf.robot.errors import RefusedError
    from rtf.robot_testing.case import parse_injection
    from rtf.simulator.axes import INDEX
    from rtf.simulator.faults.base import Target
    from rtf.simulator.faults.kinds import find_kind

    source = test.parameter_source("inject")
    try:
        word, target, values = parse_injection(text)
        kind = find_kind(word)
    except (ParameterError, RefusedError) as error:
        said = error.problems[0] if isinstance(error, ParameterError) else str(error)
        return [f"inject: {said} ({source})"]
    problems = []
    if kind.target_kind is Target.AXIS and target not in INDEX:
        near = difflib.get_close_matches(target, INDEX, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"its joints are {', '.join(INDEX)}"
        problems.append(f"the robot has no joint {target!r}; {hint}")
    known = {parameter.name: parameter for parameter in kind.parameters}
    for name, value in values.items():
        if name in ("delay", "duration"):
            continue
        if name not in known:
            problems.append(f"{word} has no parameter {name}; what can be set is {', '.join(known) or 'nothing'}")
        elif not known[name].minimum <= value <= known[name].maximum:
            limits = f"{known[name].minimum:g} to {known[name].maximum:g} {known[name].unit}".strip()
            problems.append(f"{word}: {name} is from {limits}, not {value:g}")
    return [f"inject: {problem} ({source})" for problem in problems]
