"""The diagram of the control modes in the documentation: ``python tools/control_mode_picture.py FILE``.

All contents are read from the tables of :mod:`rtf.robot.control_modes`; only the layout is defined here.
"""

from __future__ import annotations

import sys
from html import escape
from pathlib import Path
from typing import NamedTuple

from rtf.robot.control_modes import FORCED, REQUESTS, STATES, TRANSITIONS, USER_MODES, Answer, ControlMode, answer

_TIP = (
    '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" orient="auto">'
    '<path d="M0 0 L10 5 L0 10 z" fill="context-stroke"/></marker></defs>'
)
_WIDTH, _MARGIN = 960, 24
_LINE = 20
#: The y coordinate of the text.
_BELOW = 372
_STYLE = """
  text { font: 14px system-ui, sans-serif; fill: #1f2933 }
  .title { font-size: 20px; font-weight: 600 }
  .head { font-weight: 600 }
  .word { font-family: ui-monospace, monospace; font-size: 13px; fill: #52606d }
  .small { font-size: 13px; fill: #3e4c59 }
  .box { stroke-width: 1.5; rx: 10 }
  .moving { fill: #e3f2e6; stroke: #2f855a }
  .idle { fill: #eef2f7; stroke: #64748b }
  .fault { fill: #fde8e8; stroke: #c53030 }
  .starting { fill: #fff7e0; stroke: #b7791f }
  .arrow { fill: none; stroke: #334155; stroke-width: 1.6; marker-end: url(#tip) }
  .forced { stroke-dasharray: 6 4; stroke: #c53030 }
  .own { stroke-dasharray: 6 4 }
"""


class _Box(NamedTuple):
    """A rectangle with a heading and lines."""

    x: int
    y: int
    width: int
    height: int
    kind: str
    head: str
    lines: tuple[str, ...]


def _words(modes: tuple[ControlMode, ...]) -> tuple[str, ...]:
    return tuple(f"{_name(mode)} [{mode.word}]" for mode in modes)


#: The boxes: the kind, the heading and the states.
_GROUPS = (
    ("starting", "The board starts", (*(before for before, _, _ in FORCED if before is not None),)),
    ("moving", "The joint obeys its user", USER_MODES),
    ("idle", "No power", (ControlMode.IDLE,)),
    ("fault", "No power: a fault", (ControlMode.HARDWARE_FAULT,)),
)
#: The positions of the boxes: left, top, width.
_PLACES = {"starting": (24, 84, 250), "moving": (360, 84, 250), "idle": (734, 84, 202), "fault": (734, 204, 202)}
_GROUP_OF = {state: kind for kind, _, states in _GROUPS for state in states}


class _Route(NamedTuple):
    """The path of an arrow between two boxes, and the position of its label."""

    path: str
    x: int
    y: int
    anchor: str = "middle"


#: The arrows that may be drawn, for requests and for changes by the board.
_ON_REQUEST = {
    ("moving", "moving"): _Route("M525 268 v26 h-80 V270", 485, 312),
    ("moving", "idle"): _Route("M610 104 H732", 672, 96),
    ("idle", "moving"): _Route("M734 130 H612", 672, 148),
    ("fault", "idle"): _Route("M790 204 V150", 782, 181, "end"),
}
_BY_ITSELF = {
    ("starting", "moving"): _Route("M274 144 H358", 316, 136),
    ("moving", "fault"): _Route("M610 236 H732", 672, 228),
    ("idle", "fault"): _Route("M880 148 V202", 888, 181, "start"),
    ("starting", "fault"): _Route("M150 208 V330 H835 V270", 316, 322),
}


def _boxes() -> list[_Box]:
    return [
        _Box(*_PLACES[kind], 44 + _LINE * len(states), kind, head, _words(states)) for kind, head, states in _GROUPS
    ]


def _draw_box(box: _Box) -> list[str]:
    drawn = [
        f'<rect class="box {box.kind}" x="{box.x}" y="{box.y}" width="{box.width}" height="{box.height}"/>',
        _text(box.x + 16, box.y + 26, box.head, "head"),
    ]
    return drawn + [
        _text(box.x + 16, box.y + 28 + _LINE * number, line, "word") for number, line in enumerate(box.lines, 1)
    ]


def _text(x: int, y: int, text: str, kind: str, anchor: str = "start") -> str:
    return f'<text class="{kind}" x="{x}" y="{y}" text-anchor="{anchor}">{escape(text)}</text>'


def requested() -> dict[tuple[str, str], list[ControlMode]]:
    """Return the requests that lead from one box to another, or to another state in the same box."""
    found: dict[tuple[str, str], list[ControlMode]] = {}
    for (state, request), after in TRANSITIONS.items():
        if after is not state:
            between = found.setdefault((_GROUP_OF[state], _GROUP_OF[after]), [])
            if request not in between:
                between.append(request)
    return found


def forced() -> dict[tuple[str, str], str]:
    """Return the reasons for which a board moves a joint from one box to another."""
    found = {}
    for before, why, after in FORCED:
        for kind in (kind for kind, _, states in _GROUPS if before in states or before is None):
            if kind != _GROUP_OF[after]:
                found[kind, _GROUP_OF[after]] = why.partition(":")[0].removeprefix("the joint is ")
    return found


def _arrows() -> list[str]:
    """Draw all arrows between boxes. A KeyError means that the tables have an arrow without a path here."""
    drawn = []
    for between, requests in requested().items():
        label = "a mode" if set(USER_MODES) <= set(requests) else " ".join(f"[{one.word}]" for one in requests)
        drawn += _draw_arrow(_ON_REQUEST[between], label, "asked")
    for between, why in forced().items():
        drawn += _draw_arrow(_BY_ITSELF[between], why, "forced" if between[1] == "fault" else "own")
    return drawn


def _draw_arrow(route: _Route, label: str, kind: str) -> list[str]:
    return [
        f'<path class="arrow {kind}" d="{route.path}"/>',
        _text(route.x, route.y, label, "word" if label.startswith("[") else "small", route.anchor),
    ]


def _name(state: ControlMode) -> str:
    return state.name.lower().replace("_", " ")


def what_is_taken(state: ControlMode) -> str:
    """Return the text of what happens to the requests in a state."""
    answers = {request: answer(state, request)[0] for request in REQUESTS}
    ignored = [request for request, found in answers.items() if found is not Answer.TAKEN]
    taken = [request for request, found in answers.items() if found is Answer.TAKEN]
    if not ignored:
        return "every request is taken"
    if not taken:
        return "every request is ignored"
    return f"{_listed(taken)} is taken; ignored are {_listed(ignored)}"


def _listed(modes: list[ControlMode]) -> str:
    return " ".join(f"[{mode.word}]" for mode in modes)


def _legend(y: int) -> tuple[list[str], int]:
    """Draw the text below the boxes. Return its elements and its lower end."""
    alike: dict[str, list[str]] = {}
    for state in STATES:
        alike.setdefault(what_is_taken(state), []).append(_name(state))
    lines = [("On request", "head")]
    lines += [(f"{', '.join(states)}: {what}", "small") for what, states in alike.items()]
    lines += [("", "small"), ("By the board itself", "head")]
    lines += [
        (f"{'any state' if before is None else _name(before)} → {_name(after)}: {why}", "small")
        for before, why, after in FORCED
    ]
    drawn = [_text(_MARGIN, y + number * (_LINE + 2), text, kind) for number, (text, kind) in enumerate(lines) if text]
    return drawn, y + len(lines) * (_LINE + 2)


def draw() -> str:
    """Return the diagram as the text of an SVG file."""
    boxes = _boxes()
    legend, end = _legend(_BELOW)
    height = end + _MARGIN // 2
    body = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}">',
        "<title>Control modes of a joint</title>",
        f"<style>{_STYLE}</style>",
        _TIP,
        f'<rect width="{_WIDTH}" height="{height}" fill="#ffffff"/>',
        _text(_MARGIN, 40, "Control modes of a joint", "title"),
        _text(_MARGIN, 62, "Solid: on request. Dashed: by the board itself.", "small"),
        *(line for box in boxes for line in _draw_box(box)),
        *_arrows(),
        *legend,
        "</svg>",
    ]
    return "\n".join(body) + "\n"


def main() -> None:
    """Write the diagram to the file named on the command line."""
    Path(sys.argv[1]).write_text(draw(), encoding="utf-8")


if __name__ == "__main__":
    main()
