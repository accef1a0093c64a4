"""Control modes: every request in every mode follows the transition table, and no joint moves in a wrong mode."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.control_modes import (
    HOLDING_MODES,
    REQUESTS,
    STATES,
    TRAJECTORY_MODES,
    USER_MODES,
    VELOCITY_MODES,
    ControlMode,
    InteractionMode,
    answer,
    mode_word,
)
from rtf.robot.errors import NotSupportedError, RefusedError
from rtf.robot_testing import Limits, Safety, likely_causes
from rtf.robot_testing.guard.snapshot import answered
from rtf.robot_testing.joints_test import JointsTest, command_at
from rtf.robot_testing.motion.disturbance import disturbance, limpness
from rtf.robot_testing.motion.modes import LEGEND, ModeWalk, mode_numbers
from rtf.robot_testing.torque_control import greatest_torque, torque_flags
from rtf.testing import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.interfaces import FloatArray
    from rtf.robot_testing import Trace


class _Command(NamedTuple):
    """A motion command: the modes that accept it, and a function that sends it to joints with their directions."""

    name: str
    modes: frozenset[ControlMode]
    send: Callable[[RemoteBoard, list[int], FloatArray], None]


class ControlModes(JointsTest):
    """Walks all joints through all control modes, and compares the mode after each request with the transition table.

    A mode that has to change must do so within ``change_time`` and stay; one that must not is watched for ``settle``
    seconds. Then a greatest current of zero drives the joints into hardware faults, which only a forced idle may end.
    A joint that the guard has to stop fails and is excluded from then on, together with those that share its motors.
    """

    aliases = ("controlModes",)
    tags = ("modes", "faults")
    safety = Safety.FAULT
    # Joints fall while they have no power.
    limits = Limits(beyond=15.0, speed=math.inf, current=None, contact=None)

    tolerance = Parameter(float, "tolerance of the home position", unit="deg", default=0.5, low=0.001)
    without = Parameter(list[str], "modes that the boards do not have, such as icur", default=[])
    faults = Parameter(bool, "whether joints are driven into faults", default=True)
    change_time = Parameter(float, "greatest time of a mode change", unit="s", default=0.5, low=0.001)
    settle = Parameter(float, "how long a mode that must not change is watched", unit="s", default=0.1, low=0.001)
    moved = Parameter(float, "least motion that counts as obeying a wrong command", unit="deg", default=0.5, low=0.001)

    def setup(self) -> None:
        """Open the part, read the capabilities of its joints, and move them home."""
        super().setup()
        part = self.robot_part
        words = {mode.word: mode for mode in (*USER_MODES, ControlMode.IDLE)}
        unknown = [word for word in self.without if word not in words]
        self.assert_error_if_true(unknown, f"without: unknown modes {', '.join(unknown)}; use {', '.join(words)}")
        self.missing = {words[word] for word in self.without}
        if ControlMode.IDLE in self.missing:
            self.missing.add(ControlMode.FORCE_IDLE)
        self.refused: set[ControlMode] = set()
        self.torque_known = True
        self.compliant = self._torque_controlled()
        self.currents = {joint: part.board.max_current(joint) for joint in self.chosen} if self.faults else {}
        self.assert_error_if_false(
            all(current > 0 for current in self.currents.values()),
            f"{part.name}: a greatest current is zero before the test",
        )
        self.tested: dict[int, set[tuple[ControlMode, ControlMode]]] = {joint: set() for joint in self.chosen}
        self.wrong: dict[int, list[str]] = {joint: [] for joint in self.chosen}
        #: What moved at commands of other modes, and what disturbed it then.
        self.moved_by: dict[int, list[tuple[str, str]]] = {joint: [] for joint in self.chosen}
        begin = self.now(), float(ControlMode.POSITION)
        self.expected = {joint: [begin] for joint in self.chosen}
        self.slowest = dict.fromkeys(self.chosen, 0.0)
        self.bring_home(tolerance=self.tolerance)

    def _torque_controlled(self) -> set[int]:
        """Return the chosen joints that have torque control by the board's variable; none if that is unknown."""
        part = self.robot_part
        try:
            flags = torque_flags(part)
        except (NotSupportedError, RefusedError) as error:
            self.torque_known = False
            self.warn(
                f"{part.name} does not report which joints have torque control: torque mode is not tested, and joints "
                f"may become compliant or stay stiff ({error})"
            )
            return set()
        return {joint for joint in self.chosen if flags[joint]}

    def run(self) -> None:
        """Walk, drive into faults, and judge each joint."""
        with self.robot_part.recorded() as trace:
            needed = self._walk()
            if self.faults:
                needed |= self._fault()
            self._try_request(ControlMode.POSITION)
        self.report(LEGEND)
        for joint in self.chosen:
            with self.subresult(self.robot_part.names[joint]):
                self._keep(joint, trace)
                self._judge(joint, needed)
        self.robot_part.report_clock_offset(self.report)

    # Modes -------------------------------------------------------------------------------------------------------

    def _walk(self) -> set[tuple[ControlMode, ControlMode]]:
        walk = ModeWalk((*USER_MODES, ControlMode.IDLE), self.missing)
        needed, state, seen = walk.pairs, ControlMode.POSITION, set[ControlMode]()
        while True:
            if state not in seen:
                self._visit(state)
                seen.add(state)
                self.progress(0.7 * len(seen) / len(walk.open), state.word)
            if state is ControlMode.POSITION:
                self._come_back()
            request = walk.next_request(state)
            if request is None:
                return needed
            self._try_request(request)
            state = answer(state, request)[1]

    def _visit(self, state: ControlMode) -> None:
        """Try once in each mode: a change of the interaction mode, commands of other modes, and forbidden requests."""
        self._change_interaction(state)
        if state in HOLDING_MODES or state is ControlMode.IDLE:
            for command in _COMMANDS:
                if state not in command.modes:
                    self._command(state, command)
        if state is ControlMode.POSITION:
            for mode in _NEVER:
                self._try_request(mode)

    def _try_request(self, request: ControlMode) -> None:
        """Request a mode of all joints, and compare the resulting modes with the transition table."""
        part = self.robot_part
        joints = [joint for joint in self.chosen if request is not ControlMode.TORQUE or joint in self.compliant]
        if not joints:
            return
        before = dict(zip(joints, part.board.control_modes(joints), strict=True))
        lost = [joint for joint, mode in before.items() if mode not in STATES]
        for joint in lost:
            self.wrong[joint].append(f"it is in {before[joint].word}")
            joints.remove(joint)
        expected = {joint: answer(before[joint], request)[1] for joint in joints}
        reliable = [joint for joint in joints if not self.wrong[joint]] or joints[:1]
        unchanged = any(expected[joint] is before[joint] for joint in joints)
        begin = self.now()
        for joint in joints:
            self.expected[joint].append((begin, expected[joint]))
        with part.recorded() as trace:
            refused = self._request(request, joints, wanted=request in expected.values())
            if request is ControlMode.CURRENT:  # otherwise boards may keep the last measured current
                part.board.set_reference_currents([0.0] * len(joints), joints)
            self._wait_for_modes({joint: expected[joint] for joint in reliable})
            self._wait(self.settle if unchanged else _STAYS)
            self._wait_until(lambda: len(trace) > 0)  # on a busy machine states come late
        for joint in filter(self._has, joints):
            self.tested[joint].add((before[joint], request))
            self._compare_modes(joint, before[joint], request, expected[joint], trace, begin, refused=refused)

    def _has(self, joint: int) -> bool:
        """Whether a joint is still tested."""
        return joint in self.chosen

    def _wait_until(self, condition: Callable[[], bool]) -> None:
        """Wait for a condition for ``change_time``; joints that the guard stops meanwhile are excluded."""
        self.retry_without_stopped(lambda: self.robot_part.wait_until(condition, self.change_time, pace=_LOOK))

    def _wait_for_modes(self, expected: dict[int, ControlMode]) -> None:
        """Wait for the modes of joints; longer, once, if they are late, to tell late modes from wrong ones."""

        def there() -> bool:
            return all(
                self.robot_part.board.control_mode(joint) is expected[joint] for joint in filter(self._has, expected)
            )

        self._wait_until(there)
        if not any(self.wrong[joint] for joint in expected) and not there():
            self.retry_without_stopped(lambda: self.robot_part.wait_until(there, _LATE, pace=_LOOK))

    def _wait(self, seconds: float) -> None:
        self.retry_without_stopped(lambda: self.robot_part.wait(seconds, pace=_LOOK))

    def _request(self, request: ControlMode, joints: list[int], *, wanted: bool) -> bool:
        """Request a mode; return whether the board refused it. Where a joint should take it, that is reported once."""
        try:
            self.robot_part.let_go.update(joints)  # whatever is requested, idle is among it
            self.robot_part.board.set_control_modes([request] * len(joints), joints)
        except RefusedError as error:
            if wanted and request not in self.refused:
                self.refused.add(request)
                self.warn(f"{error}; if the boards do not have this mode, write it into 'without' ({request.word})")
            return True
        return False

    def _compare_modes(
        self,
        joint: int,
        before: ControlMode,
        request: ControlMode,
        expected: ControlMode,
        trace: Trace,
        begin: float,
        *,
        refused: bool,
    ) -> None:
        modes = trace.control_modes[:, joint]
        there = np.flatnonzero(modes == expected)
        first = int(there[0]) if len(there) else len(modes)
        asked = f"after a request for {request.word} in {before.word} it"
        if not len(modes) or modes[-1] != expected:
            now = mode_word(int(modes[-1])) if len(modes) else "unknown"
            why = " (refused)" if refused else ""
            self.wrong[joint].append(f"{asked} is in {now}, not {expected.word}{why}")
        elif (modes[:first] != before).any() or (modes[first:] != expected).any():
            passed = ", ".join(mode_word(mode) for mode in dict.fromkeys(modes.tolist()))
            self.wrong[joint].append(f"{asked} goes through {passed} to {expected.word}")
        elif expected is not before:
            self.slowest[joint] = max(self.slowest[joint], float(trace.time[first]) + trace.offset - begin)

    def _change_interaction(self, state: ControlMode) -> None:
        """Make all joints compliant, then stiff: only those with torque control may change, and no control mode may.

        A board may refuse the request for a joint without torque control. Where it is unknown which joints have it,
        each joint may do either.
        """
        part = self.robot_part
        for wanted in (InteractionMode.COMPLIANT, InteractionMode.STIFF):
            expected = {joint: self._allowed(joint, wanted) for joint in self.chosen}
            before = part.board.control_modes()
            compliant = [j for j in self.chosen if j in self.compliant]
            for joints in (compliant, [j for j in self.chosen if j not in self.compliant]):
                if joints:
                    self._request_interaction(wanted, joints)
            self._wait_until(partial(self._interactions_are, expected))
            self._wait(_STAYS)
            found, after = self._interactions(), part.board.control_modes()
            for joint in self.chosen:
                old, new = before[joint], after[joint]
                asked = f"after a request to be {wanted.word} in {state.word} it"
                if found[joint] not in expected[joint]:
                    right = " or ".join(mode.word for mode in expected[joint])
                    self.wrong[joint].append(f"{asked} is {found[joint].word}, not {right}")
                if new is not old:
                    self.wrong[joint].append(f"{asked} changes from {old.word} to {new.word}")

    def _allowed(self, joint: int, wanted: InteractionMode) -> set[InteractionMode]:
        """Return the interaction modes that a joint may have after a request."""
        if joint in self.compliant:
            return {wanted}
        return {InteractionMode.STIFF} if self.torque_known else {wanted, InteractionMode.STIFF}

    def _interactions_are(self, expected: dict[int, set[InteractionMode]]) -> bool:
        found = self._interactions()
        return all(mode in expected[joint] for joint, mode in found.items())

    def _interactions(self) -> dict[int, InteractionMode]:
        return dict(zip(self.chosen, self.robot_part.board.interaction_modes(self.chosen), strict=True))

    def _request_interaction(self, wanted: InteractionMode, joints: list[int]) -> None:
        try:
            self.robot_part.board.set_interaction_modes([wanted] * len(joints), joints)
        except (RefusedError, NotSupportedError) as error:
            if set(joints) & self.compliant:
                self.warn(f"{self.names_of(joints)}: {error}")

    # Commands of other modes -------------------------------------------------------------------------------------

    def _command(self, state: ControlMode, command: _Command) -> None:
        """Send a command that the mode does not accept: no joint may move, and no motor without power may be driven.

        A joint without power may fall, so its duty cycle is judged, and only if all joints of the part are in that
        mode.
        """
        part = self.robot_part
        modes = part.board.control_modes()
        joints = [joint for joint in self.chosen if modes[joint] is state]
        if not joints or (state not in HOLDING_MODES and any(mode is not state for mode in modes)):
            return
        before = part.board.encoders(joints)
        middle = (part.low[joints] + part.high[joints]) / 2
        with part.recorded() as trace:
            with suppress(RefusedError, NotSupportedError):  # refusing and ignoring are both correct
                command.send(part.board, joints, np.where(before < middle, 1.0, -1.0))
            self._wait(_WATCHED)
            self._wait_until(lambda: len(trace) > 0)
        if state in HOLDING_MODES:
            found, most = np.abs(trace.positions[:, joints] - before), self.moved
        else:
            found, most = np.abs(trace.duty_cycles[:, joints]), _DRIVEN
        ways = dict(zip(joints, found.max(axis=0).tolist(), strict=True))
        for joint in (joint for joint, way in ways.items() if way > most and self._has(joint)):
            if state in HOLDING_MODES:
                what, why = f"moves by {part.shown(joint, ways[joint])}", self._shaken(joint, ways)
            else:
                what, why = f"is driven with {ways[joint]:.2f} %", ""
            self.moved_by[joint].append((f"in {state.word} it {what} at a command of {command.name}", why))

    def _shaken(self, joint: int, ways: Mapping[int, float]) -> str:
        """Return what has moved a joint whose mode holds it: another one that went much farther; "" if nothing has."""
        part, farthest = self.robot_part, max(ways, key=ways.__getitem__)
        if why := disturbance(part, joint):
            return why
        if ways[farthest] < _SHAKES * ways[joint]:
            return ""
        return f"it was disturbed: {part.names[farthest]} moves by {part.shown(farthest, ways[farthest])}"

    def _come_back(self) -> None:
        """Move the joints without errors home if they have fallen without power."""
        self.retry_without_stopped(self._move_back)

    def _move_back(self) -> None:
        part = self.robot_part
        joints = [joint for joint in self.chosen if not (self.wrong[joint] or self.moved_by[joint])]
        if joints and np.abs(part.board.encoders(joints) - part.home[joints]).max() > _FALLEN:
            part.move(part.home[joints], joints, speed=_RETURN, tolerance=_FALLEN / 2)

    # Faults ------------------------------------------------------------------------------------------------------

    def _fault(self) -> set[tuple[ControlMode, ControlMode]]:
        """Drive all joints into hardware fault, try all forbidden requests to leave it, and then the allowed one."""
        fault = ControlMode.HARDWARE_FAULT
        walk = ModeWalk([fault], self.missing)
        needed = walk.pairs
        self._provoke([*self.chosen])
        for joint, mode in zip(self.chosen, self.robot_part.board.control_modes(self.chosen), strict=True):
            if mode is not fault:
                self.wrong[joint].append(f"a greatest current of 0 A leaves it in {mode.word}, not {fault.word}")
        for request in (*[r for r in walk.open[fault] if r is not ControlMode.FORCE_IDLE], *_NEVER):
            self._try_request(request)
            modes = self.robot_part.board.control_modes(self.chosen)
            left = [joint for joint, mode in zip(self.chosen, modes, strict=True) if mode is not fault]
            if left:
                self._provoke(left)
        for command in _COMMANDS[:3]:
            self._command(fault, command)
        self._try_request(ControlMode.FORCE_IDLE)
        self._try_request(ControlMode.POSITION)
        self._come_back()
        self.progress(0.95, "out of fault")
        return needed

    def _provoke(self, joints: Sequence[int]) -> None:
        """Drive joints into hardware fault by a greatest current of zero; restore the greatest currents at once."""
        board = self.robot_part.board
        for joint in joints:
            self.expected[joint].append((self.now(), ControlMode.HARDWARE_FAULT))
        try:
            for joint in joints:
                board.set_max_current(joint, 0.0)
            self._wait_until(
                lambda: all(
                    board.control_mode(joint) is ControlMode.HARDWARE_FAULT for joint in joints if self._has(joint)
                )
            )
        finally:
            for joint in joints:
                board.set_max_current(joint, self.currents[joint])

    # Verdict -----------------------------------------------------------------------------------------------------

    def _keep(self, joint: int, trace: Trace) -> None:
        """Record the actual and the expected modes of a joint."""
        time = trace.local_time
        self.record(
            "modes",
            time=(time - time[0], "s"),
            mode=(mode_numbers(trace.control_modes[:, joint]), ""),
            expected=(mode_numbers(command_at(time, self.expected[joint])), ""),
        )

    def _judge(self, joint: int, needed: set[tuple[ControlMode, ControlMode]]) -> None:
        part, name = self.robot_part, self.robot_part.names[joint]
        # A joint that was stopped later has shaken the others before, perhaps.
        moved = [(text, why or limpness(part, joint)) for text, why in self.moved_by[joint]]
        wrong = self.wrong[joint] + [text for text, why in moved if not why]
        doubts = [f"{text}; but {why}" for text, why in moved if why]
        if joint not in self.compliant:
            needed = {pair for pair in needed if ControlMode.TORQUE not in pair}
        left = needed - self.tested[joint]
        self.measure("requests tried", len(needed) - len(left))
        busy = self.busy() if self.slowest[joint] > self.change_time else ""
        text = f"{name} shows a new mode after {self.slowest[joint]:.2f} s"
        most = None if busy else 1e3 * self.change_time
        hint = f"{text}; {likely_causes('mode late')}"
        self.measure("slowest change", 1e3 * self.slowest[joint], "ms", high=most, hint=hint)
        more = f"; and {len(wrong) - _SHOWN} more" if len(wrong) > _SHOWN else ""
        hint = f"{name}: {'; '.join(wrong[:_SHOWN])}{more}; {likely_causes('mode')}"
        self.measure("wrong answers", len(wrong), high=0, hint=hint)
        self.assert_error_if_true(left and not wrong, f"{name}: {len(left)} requests could not be tried")
        if busy:
            self.inconclusive(f"{text}; but {busy}")
        if doubts:
            self.inconclusive(f"{name}: {doubts[0]}")


#: Seconds between two checks of the modes; for which a new mode is watched; for which a joint is watched for motion.
_LOOK, _STAYS, _WATCHED = 0.01, 0.03, 0.1
#: Seconds more for a mode that is late: boards that show modes in a slow loop have loops of a second at most.
_LATE = 2.0
#: Fall after which joints are moved back, deg; and the speed of that move, deg/s.
_FALLEN, _RETURN = 3.0, 30.0
#: A joint that moves so many times as far as another one has shaken that.
_SHAKES = 3.0
_DRIVEN = 1.0  # per cent of duty cycle, of a motor without power
_SHOWN = 5  # wrong answers that a failure lists
#: Modes that must not be requested.
_NEVER = tuple(mode for mode in STATES if mode not in REQUESTS)
#: Commands that are large enough to be seen and small enough to be safe: deg, deg/s, per cent of the range.
_STEP, _SPEED, _EFFORT = 3.0, 20.0, 10.0
#: The same for boards that do not report their ranges: Nm, A.
_TORQUE, _CURRENT = 0.5, 0.1


def _torque(board: RemoteBoard, joints: list[int], way: FloatArray) -> None:
    most = [greatest_torque(board, joint) for joint in joints]
    efforts = np.array([_TORQUE if one is None else _EFFORT / 100.0 * one for one in most])
    board.set_reference_torques(efforts * way, joints)


def _current(board: RemoteBoard, joints: list[int], way: FloatArray) -> None:
    board.set_reference_currents(np.array([_current_of(board, joint) for joint in joints]) * way, joints)


def _current_of(board: RemoteBoard, joint: int) -> float:
    found = answered(partial(board.current_range, joint))
    return _CURRENT if found is None else _EFFORT / 100.0 * found[1]


_COMMANDS = (
    _Command(
        "position", TRAJECTORY_MODES,
        lambda board, joints, way: board.position_move(board.encoders(joints) + _STEP * way, joints),
    ),
    _Command("velocity", VELOCITY_MODES, lambda board, joints, way: board.velocity_move(_SPEED * way, joints)),
    _Command(
        "direct position", frozenset({ControlMode.POSITION_DIRECT}),
        lambda board, joints, way: board.set_positions(board.encoders(joints) + _STEP * way, joints),
    ),
    _Command("torque", frozenset({ControlMode.TORQUE}), _torque),
    _Command("current", frozenset({ControlMode.CURRENT}), _current),
    _Command(
        "duty cycle", frozenset({ControlMode.PWM}),
        lambda board, joints, way: board.set_reference_duty_cycles(_EFFORT * way, joints),
    ),
)  # fmt: skip
