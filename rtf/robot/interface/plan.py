"""The plan of a robot: the columns, steps and lines that the drawings show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtf.robot.interface.action_targets import attachments, is_describing, target
from rtf.robot.interface.log import printable
from rtf.robot.interface.model import ACTING, Action, ActionKind, Phase, Robot

if TYPE_CHECKING:
    from collections.abc import Iterator

_NOTES = {
    Phase.INTERRUPT1: "the first signal, or quit",
    Phase.INTERRUPT2: "the second signal",
    Phase.INTERRUPT3: "the third signal",
}


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the plan. ``parallel``: it runs in parallel with the other such lines of its step."""

    text: str
    place: str
    parallel: bool = False


@dataclass(frozen=True, slots=True)
class Step:
    """A step: lines that are done before the next step begins."""

    title: str
    lines: tuple[Line, ...]


@dataclass(frozen=True, slots=True)
class Column:
    """A phase, with a short note."""

    title: str
    note: str
    steps: tuple[Step, ...]


def columns(robot: Robot) -> Iterator[Column]:
    """Return the columns: open, the phases, close. Phases without actions are omitted, except startup and shutdown."""
    devices = [Line(printable(f"{entry.name} ({entry.kind})"), str(entry.location)) for entry in robot.devices]
    yield Column("open", "one after the other", _steps("devices", devices))
    for phase in ACTING:
        steps = tuple(
            Step(f"level {level}", tuple(_line(robot, action) for action in actions))
            for level, actions in robot.levels(phase)
        )
        if steps or phase in (Phase.STARTUP, Phase.SHUTDOWN):
            yield Column(str(phase), _NOTES.get(phase, "level by level"), steps)
        if phase is Phase.STARTUP:
            yield Column(str(Phase.RUN), "until a signal, or quit", ())
    yield Column("close", "one after the other", _steps("devices", devices[::-1]))


def _steps(title: str, lines: list[Line]) -> tuple[Step, ...]:
    return (Step(title, tuple(lines)),) if lines else ()


def _line(robot: Robot, action: Action) -> Line:
    limit = f", at most {action.timeout:g} s" if action.timeout is not None else ""
    return Line(printable(f"{_sentence(robot, action)}{limit}"), str(action.location), action.kind.moves)


def _sentence(robot: Robot, action: Action) -> str:
    if action.kind.moves:
        return f"{action.kind} {target(robot, action)} by {action.device}"
    if action.kind is ActionKind.ATTACH and is_describing(robot, action):
        return f"attach {action.device} to the list of devices"
    if action.kind is ActionKind.ATTACH:
        found = [name if key == name else f"{key}={name}" for key, name in attachments(robot, action).items()]
        return f"attach {action.device} to {', '.join(found) or 'nothing'}"
    if action.kind in (ActionKind.CUSTOM, ActionKind.CONFIGURE):
        return f"{action.kind} {action.device} {action.parameters.to_text()}".rstrip()
    return f"{action.kind} {action.device}"
