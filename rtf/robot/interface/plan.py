"""The plan of a robot: its phases, levels and actions as columns of lines, drawn as text and as SVG."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from rtf.robot.interface.action_targets import attachments, is_describing, target
from rtf.robot.interface.log import printable
from rtf.robot.interface.model import ACTING, Action, ActionKind, Phase, Robot

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The mark of actions that run in parallel.
_TOGETHER = "\N{PARALLEL TO} "
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


# Drawings -------------------------------------------------------------------------------------------------------------


def draw_text(robot: Robot) -> str:
    """Return the plan as text: phases, levels, and the actions in each, with their location in the files."""
    rows: list[tuple[str, str]] = [(_heading(robot), "")]
    for column in columns(robot):
        rows.append((f"{column.title}: {column.note}", ""))
        for step in column.steps:
            rows.append((f"  {step.title}", ""))
            rows += [(f"    {_text_of(line)}", line.place) for line in step.lines]
    width = max(len(text) for text, place in rows if place) if any(place for _, place in rows) else 0
    return "\n".join(f"{text:<{width}}  {place}".rstrip() if place else text for text, place in rows) + "\n"


def _heading(robot: Robot) -> str:
    return printable(f"{robot.name}, build {robot.build}, {len(robot.devices)} devices, port {robot.port_name}")


def _text_of(line: Line) -> str:
    return f"{_TOGETHER}{line.text}" if line.parallel else line.text


# The picture -----------------------------------------------------------------------------------------------------

_ROW, _GAP, _MARGIN = 20, 10, 20  # pixels
_CHARACTER = 7.3  # pixel width of a character
_LONGEST = 100  # characters of a line
_STYLE = (
    "text{font:12px monospace;fill:#1d2733}.head{font-level:bold;font-size:14px}.note{fill:#5b6875}"
    ".column{fill:#f4f6f8;stroke:#c3ccd5}.step{fill:#fff;stroke:#9aa7b4}.moves{fill:#8a3b00}"
)


def draw_svg(robot: Robot) -> str:
    """Return the plan as SVG: a column per phase, a box per level; parallel actions are marked."""
    found = [*columns(robot)]
    widths = [_width(column) for column in found]
    heights = [_height(column) for column in found]
    body: list[str] = []
    x = float(_MARGIN)
    top = _MARGIN + 2 * _ROW
    for column, width in zip(found, widths, strict=True):
        body += _column(column, x, top, width, max(heights))
        x += width + _MARGIN
    title = escape(_heading(robot))
    height = top + max(heights) + _MARGIN
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{x:.0f}" height="{height}">',
            f"<title>{title}</title><style>{_STYLE}</style>",
            _text(_MARGIN, _MARGIN + _ROW, _heading(robot), "head"),
            *body,
            "</svg>\n",
        ]
    )


def _width(column: Column) -> float:
    lines = [_text_of(line) for step in column.steps for line in step.lines]
    texts = [column.title, column.note, *(step.title for step in column.steps), *lines]
    return min(max(map(len, texts)), _LONGEST) * _CHARACTER + 4 * _GAP


def _height(column: Column) -> int:
    return 3 * _ROW + sum(_step_height(step) + _GAP for step in column.steps)


def _step_height(step: Step) -> int:
    return _ROW * (len(step.lines) + 1) + _GAP


def _column(column: Column, x: float, top: float, width: float, height: float) -> Iterator[str]:
    yield _box(x, top, width, height, "column")
    yield _text(x + _GAP, top + _ROW, column.title, "head")
    yield _text(x + _GAP, top + 2 * _ROW, column.note, "note")
    y = top + 2.5 * _ROW
    for step in column.steps:
        yield _box(x + _GAP, y, width - 2 * _GAP, _step_height(step), "step")
        yield _text(x + 2 * _GAP, y + _ROW - 4, step.title, "note")
        for number, line in enumerate(step.lines, 2):
            yield _text(
                x + 2 * _GAP, y + number * _ROW - 4, _text_of(line), "moves" if line.parallel else "", line.place
            )
        y += _step_height(step) + _GAP


def _box(x: float, y: float, width: float, height: float, kind: str) -> str:
    return f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="4"/>'


def _text(x: float, y: float, text: str, kind: str = "", place: str = "") -> str:
    shown = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    title = f"<title>{escape(printable(f'{text} ({place})'))}</title>" if place else ""
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{title}{escape(shown)}</text>'
