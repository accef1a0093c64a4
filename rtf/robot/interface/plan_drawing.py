"""Drawings of a robot's plan: as text, and as SVG."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from rtf.robot.interface.log import printable
from rtf.robot.interface.plan import Column, Line, Step, columns

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.interface.model import Robot

#: The mark of actions that run in parallel.
_TOGETHER = "\N{PARALLEL TO} "


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
    told = f"<title>{escape(printable(f'{text} ({place})'))}</title>" if place else ""
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{told}{escape(shown)}</text>'
