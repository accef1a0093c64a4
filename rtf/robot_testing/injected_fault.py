"""The parameter ``inject`` of robot tests: a fault that the simulated robot has from the beginning of a test."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from rtf.errors import nearest
from rtf.robot.errors import RobotError
from rtf.simulator.control_client import SimulatorControl
from rtf.testing.parameters import ParameterError

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.testing import TestCase
    from rtf.testing.parameters import Declared


class Injection(NamedTuple):
    """A fault: its kind, its target and its parameters; when it begins, and how long it lasts, in s."""

    kind: str
    target: str
    values: dict[str, float]
    delay: float = 0.0
    duration: float = math.inf


def parse_injection(text: str) -> Injection:
    """Return the fault that the parameter ``inject`` describes.

    ``delay`` and ``duration`` are those of the injection, unless the kind has a parameter of that name, as ``latency``
    has. Raises ParameterError, and RefusedError for such a word with an unknown kind.
    """
    kind, *words = text.split()
    target = words.pop(0) if words and "=" not in words[0] else "-"
    values: dict[str, float] = {}
    for word in words:
        name, equals, number = word.partition("=")
        try:
            values[name] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise ParameterError("inject", [f"{word!r} is not of the form name=number, such as torque=400"])
    times = {name: values[name] for name in ("delay", "duration") if name in values}
    if times:
        from rtf.simulator.faults.kinds import find_kind  # it loads the whole simulator, which few tests need

        own = {parameter.name for parameter in find_kind(kind).parameters}
        times = {name: values.pop(name) for name in times if name not in own}
    return Injection(kind, "" if target == "-" else target, values, **times)


def inject_fault(test: TestCase, robot: str, network: Network) -> None:
    """Inject the fault of a test into its simulated robot. Clean-up resets the robot: at home and healthy."""
    control = SimulatorControl(robot, network=network)
    test.add_cleanup(control.close)
    kind, target, values, delay, duration = parse_injection(test.parameter_values()["inject"])
    test.add_cleanup(control.reset)
    try:
        control.inject(kind, target, values, delay=delay, duration=duration)
    except RobotError as error:
        test.assert_error(f"inject: {error}")


def wrong_fault(test: Declared) -> list[str]:
    """Return the errors of ``inject``: a kind, a joint or a number that the simulator would refuse."""
    text = test.parameter_values()["inject"]
    if not text:
        return []
    # Imported here: the faults load the whole simulator, which few tests need.
    from rtf.robot.errors import RefusedError
    from rtf.robot_testing.robot_name import robot_model
    from rtf.simulator.faults.base import Target
    from rtf.simulator.faults.kinds import find_kind

    source = test.parameter_source("inject")
    try:
        word, target, values, *_ = parse_injection(text)
        kind = find_kind(word)
    except (ParameterError, RefusedError) as error:
        said = error.problems[0] if isinstance(error, ParameterError) else str(error)
        return [f"inject: {said} ({source})"]
    problems = []
    joints = robot_model(test).index
    if kind.target_kind is Target.AXIS and target not in joints:
        near = nearest(target, joints)
        hint = f"did you mean {near!r}?" if near else f"its joints are {', '.join(joints)}"
        problems.append(f"the robot has no joint {target!r}; {hint}")
    known = {parameter.name: parameter for parameter in kind.parameters}
    for name, value in values.items():
        if name not in known:
            problems.append(f"{word} has no parameter {name}; its parameters: {', '.join(known) or 'none'}")
        elif not known[name].minimum <= value <= known[name].maximum:
            limits = f"{known[name].minimum:g} to {known[name].maximum:g} {known[name].unit}".strip()
            problems.append(f"{word}: {name} is from {limits}, not {value:g}")
    return [f"inject: {problem} ({source})" for problem in problems]
