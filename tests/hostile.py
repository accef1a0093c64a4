"""Events with hostile texts in every field of every kind, made from the event classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rtf.testing.events import KINDS, RunEnded, RunStarted, SuitePlanned, TestPlanned

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.events import Event

#: Each tries to get out of another kind of cage; none may come to more than what it says.
TEXTS = (
    "<script>alert(1)</script>",
    "</script><script>alert(2)</script>",
    "<img src=x onerror=alert(3)>",
    "<!--<script>",
    "]]><iframe src='javascript:alert(4)'></iframe>",
    "\"'`><svg onload=alert(5)>",
    "${alert(6)} {{7*7}} %s %d \\u003cscript\\u003e",
    "javascript:alert(8)",
    "nul\0 bell\x07 escape\x1b[31m del\x7f csi\x9b\r\n\t\v\f\u2028\u2029",
    "\u202eright to left\u202d \u2066isolate\u2069 \u200f\u200e\ufeff",
    "lone \ud800 swapped \udc80\ud83d pair \U0001f916 zalgo " + "\u0301\u0316" * 40,
    "__proto__",
    "constructor",
    "../../etc/passwd",
    "#a/b?c=d&e%2Ff%",
    " ",
)
#: A line of a megabyte, without and with places to break it.
LONG = ("x" * 1_000_000, "long line " * 100_000)

#: Fields that say what an event belongs to; they lead to something that was planned.
_LINKS = frozenset({"suite", "test", "fixture"})
_WORDS = {
    "Severity": "failure",
    "Verdict": "failed",
    "FixtureState": "collapsed",
    "MeasurementVerdict": "failed",
    "Phase": "run",
}


def hostile_run() -> Iterator[Event]:
    """A run in which everything that can have a text has each of :data:`TEXTS`."""
    yield _start(TEXTS[0])
    homes = [(f"{number} {text}", f"{number} {text}/{text}") for number, text in enumerate(TEXTS)]
    for (suite, test), text in zip(homes, TEXTS, strict=True):
        yield SuitePlanned(suite=suite, name=text, fixtures=(text,), description=text, file=text, tags=(text,))
        yield TestPlanned(test=test, suite=suite, name=text, plugin=text, param=text, file=text, tags=(text,))
    for (suite, test), text in zip(homes, TEXTS, strict=True):
        links = {"suite": suite, "test": test, "fixture": text}
        yield from _events_with(text, links)
        yield from _events_with(text, dict.fromkeys(links, text))
    yield _end()


def long_run() -> Iterator[Event]:
    """A run in which every text is a megabyte long, but for ids, which are repeated in each event."""
    yield _start("long")
    links = {"suite": "s", "test": "s/t", "fixture": "f"}
    yield SuitePlanned(suite="s", name=LONG[0], fixtures=("f",), description=LONG[1])
    yield TestPlanned(test="s/t", suite="s", name=LONG[0], param=LONG[1])
    for number, event in enumerate(_events_with("", links)):
        yield _with_text(event, LONG[number % len(LONG)])
    yield _end()


def _start(text: str) -> Event:
    environment = {text: text}
    return RunStarted(run="hostile", version=text, command=(text,), robot=text, station=text, environment=environment)


def _end() -> Event:
    return RunEnded(verdict="failed", exit_code=1, duration=1.0)  # type: ignore[arg-type]


def _events_with(text: str, links: dict[str, str]) -> Iterator[Event]:
    """One event of each kind but the first and the last of a run."""
    for kind, cls in KINDS.items():
        if kind in ("run_started", "run_ended"):
            continue
        members = {
            name: links[name] if name in _LINKS else _value(name, annotation, text)
            for name, annotation in cls.__annotations__.items()
            if name in cls.__struct_fields__
        }
        yield cls(**members)


def _value(name: str, annotation: str, text: str) -> Any:
    if name == "form":
        return "choice"
    plain = annotation.removesuffix(" | None")
    if plain in _WORDS:
        return _WORDS[plain]
    if "str" in plain:
        row = {"name": text, "value": text, "unit": text, "source": text}
        return {
            "tuple[str, ...]": (text, text),
            "dict[str, str]": {text: text},
            "dict[str, Count]": {text: 1},
            "tuple[dict[str, str], ...]": (row, row),
        }.get(plain, text)
    return {"bool": True, "Count": 1, "float": 0.5, "dict[str, Count]": {text: 1}}.get(plain, ([0.0, 1.0], [2.0, 3.0]))


def _with_text(event: Event, text: str) -> Event:
    """Return the event with every free text made long; links and choices stay as they are."""
    texts = [name for name, annotation in type(event).__annotations__.items() if annotation in ("str", "str | None")]
    return replace(event, **{name: text for name in texts if name not in (*_LINKS, "form")})
