"""What robot tests do to a robot, as its boards see it: every command that reaches a simulated one is kept.

A test that has lost its stimulus may well pass, for nothing is wrong with a robot that is asked for nothing. So what
arrives is to be compared with what the specification of the test says, and not with the test's own account of it.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest

from harness import Outcome, run_command, write_files
from icub import ICUB
from rtf import clock
from rtf.middleware.naming import configuration
from rtf.middleware.naming.configuration import find_network
from rtf.middleware.naming.server import NameServer
from rtf.simulator.control_service import SimulatorService
from rtf.simulator.part import SimulatedPart
from rtf.simulator.robot import SimulatedRobot
from rtf.testing.events import TestEnded, TestStarted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from rtf.robot.interfaces import FloatArray
    from rtf.simulator.faults.injection import FaultInjector

#: Commands to joints: their values, and then the joints, None for all.
_OF_JOINTS = (
    "position_move",
    "relative_move",
    "velocity_move",
    "set_positions",
    "set_reference_speeds",
    "set_reference_accelerations",
    "set_reference_torques",
    "set_reference_currents",
    "set_reference_duty_cycles",
    "set_control_modes",
    "set_interaction_modes",
)
#: Settings of one joint: it, and then the values.
_OF_JOINT = ("set_impedance", "set_max_current")
#: Of those, what has something else in front of the joint: which controller it is.
_SET_PID = "set_pid"
#: The fault that is a push of a joint, and what its end is called here.
_PUSH, _RELEASE = "push", "release"


class Command(NamedTuple):
    """A command to a board. ``form``: how the joints were named, as a "single" one, as a "group", or as "all".

    ``values`` has one for each of the joints, or all that were given for the only one. ``time`` is the robot's, s;
    ``positions`` are where all joints of the part were then, deg; ``moment`` is that of the machine, s.
    """

    method: str
    form: str
    joints: tuple[int, ...]
    values: tuple[Any, ...]
    time: float
    positions: FloatArray
    moment: float

    def value(self, joint: int) -> Any:
        """Return the value that was commanded to one of the joints."""
        return self.values[self.joints.index(joint)]


class Recording:
    """The commands that arrived while a suite ran, and its outcome."""

    def __init__(self, commands: Sequence[Command], outcome: Outcome) -> None:
        self.outcome = outcome
        self._commands = commands

    def during(self, test: str) -> list[Command]:
        """Return the commands between the beginning and the end of a test, in order."""
        (began,) = self.outcome.of(TestStarted, test=f"s/{test}")
        (ended,) = self.outcome.of(TestEnded, test=f"s/{test}")
        return [one for one in self._commands if began.time <= one.moment <= ended.time]

    def commands(self, test: str, method: str, joint: int | None = None) -> list[Command]:
        """Return the commands of one method, to one joint if it is given."""
        return [one for one in self.during(test) if one.method == method and (joint is None or joint in one.joints)]

    def values(self, test: str, method: str, joint: int) -> list[Any]:
        """Return the values that one method commanded to a joint."""
        return [one.value(joint) for one in self.commands(test, method, joint)]

    def in_force(self, test: str, method: str, joint: int) -> list[Any]:
        """The last value that commands of one kind gave a joint, at each of its position moves; None: nothing yet."""
        last, found = None, []
        for one in self.during(test):
            if one.method == method and joint in one.joints:
                last = one.value(joint)
            elif one.method == "position_move" and joint in one.joints:
                found.append(last)
        return found


class _Recorder:
    """Records the commands between ports and boards of the robots that are made after it."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.commands: list[Command] = []
        for name in (*_OF_JOINTS, *_OF_JOINT, _SET_PID):
            patch.setattr(SimulatedPart, name, self._listening(name))

    def _listening(self, name: str) -> Callable[..., object]:
        act = getattr(SimulatedPart, name)

        def recorded(part: SimulatedPart, *arguments: Any) -> object:
            if name in _OF_JOINTS:
                values, joints = (*arguments, None)[:2]
            elif name == _SET_PID:
                _, joints, pid = arguments
                values = [pid]
            else:
                joints, *values = arguments
            self._note(part, name, joints, values)
            return act(part, *arguments)

        return recorded

    def listen_to_pushes(self, robot: SimulatedRobot, injector: FaultInjector) -> None:
        """Record pushes, which are faults of the mechanics of a simulated robot."""
        inject, clear = injector.inject, injector.clear
        places = {part.axis_name(joint): (part, joint) for part in robot.parts.values() for joint in range(part.size)}
        pushed: dict[int | None, tuple[SimulatedPart, int]] = {}

        def recorded_inject(kind: str, target: str, values: dict[str, float], **times: float) -> int:
            number = inject(kind, target, values, **times)
            if kind == _PUSH:
                part, joint = pushed[number] = places[target]
                self._note(part, _PUSH, joint, [*values.values()])
            return number

        def recorded_clear(number: int | None = None) -> int:
            if number in pushed:
                part, joint = pushed[number]
                self._note(part, _RELEASE, joint, [])
            return clear(number)

        injector.inject, injector.clear = recorded_inject, recorded_clear  # type: ignore[method-assign,assignment]

    def _note(self, part: SimulatedPart, method: str, joints: int | Sequence[int] | None, values: Any) -> None:
        """Keep a command; a single value stands for all of the joints."""
        if isinstance(joints, int):
            form, named = "single", (joints,)
        else:
            form, named = ("all", (*range(part.size),)) if joints is None else ("group", (*joints,))
        given = (*values,) if isinstance(values, list | tuple | np.ndarray) else (values,) * len(named)
        here = part.board.position[part.own].copy()
        self.commands.append(Command(method, form, named, given, part.board.now, here, clock.now()))


def run_recorded(folder: Path, tests: str, parts: Sequence[str]) -> Recording:
    """Run tests, written as in a suite, one after the other on a simulated robot of this process, in lockstep."""
    write_files(folder, {"suite.xml": f'<suite name="s">{tests}</suite>'})
    with pytest.MonkeyPatch.context() as patch, ExitStack() as opened:
        patch.setenv("YARP_CONFIG_HOME", str(folder / "user"))
        configuration.write_place(opened.enter_context(NameServer()).contact)
        network = find_network()
        opened.callback(network.names.close)
        recorder = _Recorder(patch)
        robot = opened.enter_context(SimulatedRobot(ICUB, network=network, parts=parts, lockstep=True))
        service = SimulatorService(robot, network=network, end=lambda: None)
        opened.callback(service.close)
        recorder.listen_to_pushes(robot, service.injector)
        outcome = run_command(
            folder, "--suite", "suite.xml", limit=300.0,
            YARP_ROBOT_NAME=robot.name, RTF_CLOCK=f"lockstep:{robot.clock.name}", YARP_CLOCK=robot.clock.name,
        )  # fmt: skip
        return Recording(recorder.commands, outcome)
