"""The history for people at a terminal: an overview, and details of the measurements that are named.

It writes the results of ``trends`` as aligned lines; colours carry nothing that the words do not. Texts of tests are
shown with their control characters escaped.
"""

from __future__ import annotations

from collections import Counter
from statistics import median
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rtf import clock
from rtf.testing.history.trends import middles
from rtf.testing.measurement import MeasurementVerdict, limits_text, margin_of, number, quantity
from rtf.testing.report import text as report_text
from rtf.testing.report.text import one_line
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

_SHOWN_RUNS = 10
#: A value that uses up this much of the room between its limits is close to one, where its author says nothing.
_CLOSE = 0.1
_GOOD, _BAD, _WARNING, _DIM, _BOLD = "green", "red", "yellow", "dim", "bold"
#: Lines are not broken, on a narrow terminal neither.
_WIDEST = 1_000_000

#: A glyph a run, and what stands for it where the output cannot carry it.
_GLYPHS = {
    Verdict.PASSED: "✓+",
    Verdict.MEASURED: "✓+",
    Verdict.EXPECTED_FAILURE: "✓+",
    Verdict.FLAKY: "~~",
    Verdict.FAILED: "✗x",
    Verdict.UNEXPECTED_PASS: "✗x",
    Verdict.ERROR: "!!",
    Verdict.FIXTURE_LOST: "!!",
    Verdict.INCONCLUSIVE: "!!",
}
_NOT_JUDGED, _NOT_THERE = "--", "·."
_BARS, _PLAIN_BARS = "▁▂▃▄▅▆▇█", "12345678"
_LEGEND = (
    (_GLYPHS[Verdict.PASSED], "good"),
    (_GLYPHS[Verdict.FAILED], "failed"),
    (_GLYPHS[Verdict.ERROR], "not testable"),
    (_GLYPHS[Verdict.FLAKY], "flaky"),
    (_NOT_JUDGED, "not run"),
    (_NOT_THERE, "not in the run"),
)

Cell = tuple[str, str]


class Sheet:
    """Writes lines and aligned tables to a stream."""

    def __init__(self, stream: TextIO, *, coloured: bool) -> None:
        self._encoding = stream.encoding or "utf-8"
        self._console = Console(
            file=stream,
            force_terminal=coloured,
            color_system="standard" if coloured else None,
            no_color=not coloured,
            width=_WIDEST,
        )
        self.plain = report_text.encodable("✓", self._encoding) != "✓"

    def line(self, text: str = "", style: str = "") -> None:
        """Write one line that is safe already."""
        self._console.print(self._text((text.rstrip(), style)))

    def title(self, text: str) -> None:
        """Begin a section."""
        self.line()
        self.line(text, _BOLD)

    def table(self, rows: Iterable[list[Cell]]) -> None:
        """Write rows of cells, each a text and its style, as columns."""
        grid = Table.grid(padding=(0, 2))
        for row in rows:
            grid.add_row(*map(self._text, row))
        self._console.print(Padding.indent(grid, 2))

    def _text(self, cell: Cell) -> Text:
        return Text(report_text.encodable(cell[0], self._encoding), style=cell[1], no_wrap=True)

    def glyph(self, pair: str) -> str:
        """Return the glyph, or its replacement in an encoding that lacks it."""
        return pair[self.plain]


def overview(sheet: Sheet, found: dict[str, Any]) -> None:
    """Write the last runs, and the tests and measurements that need attention."""
    runs, tests, measurements = found["runs"], found["tests"], found["measurements"]
    sheet.title("Runs")
    sheet.table(_run_row(index, found) for index in reversed(range(max(0, len(runs) - _SHOWN_RUNS), len(runs))))
    flaky = {name: item for name, item in tests.items() if item["flaky"]}
    failing = {name: item for name, item in tests.items() if name not in flaky and _fails(item)}
    _tests(sheet, "Flaky tests", flaky)
    _tests(sheet, "Failing tests", failing)
    drifting = {key: item for key, item in measurements.items() if item["drift"] and item["drift"]["believed"]}
    close = {key: item for key, item in measurements.items() if key not in drifting and _is_close(item)}
    _brief(sheet, "Drifting measurements", dict(sorted(drifting.items(), key=_urgency)), _drift_text)
    _brief(sheet, "Beyond a limit, or close to it", close, _limits)
    if flaky or failing:
        _legend(sheet)
    elif not drifting and not close:
        sheet.line()
        sheet.line("No flaky or failing test, no drift, nothing close to a limit.")


def details(sheet: Sheet, found: dict[str, Any]) -> None:
    """Write all tests that were named, and everything about each measurement."""
    _tests(sheet, "Tests", found["tests"])
    for key, item in found["measurements"].items():
        sheet.title(_label(key))
        for text in _about(sheet, item, len(found["runs"])):
            sheet.line(f"  {text}")
    _legend(sheet)


# Runs and tests ------------------------------------------------------------------------------------------------------


def _run_row(index: int, found: dict[str, Any]) -> list[Cell]:
    run = found["runs"][index]
    counts = Counter(item["verdicts"][index] for item in found["tests"].values() if item["verdicts"][index])
    good = run["verdict"] == Verdict.PASSED
    stamp = clock.local_stamp(run["started"])
    mixed = len({(other["robot"], other["station"]) for other in found["runs"]}) > 1
    return [
        (f"{stamp[:4]}-{stamp[4:6]}-{stamp[6:8]} {stamp[9:11]}:{stamp[11:13]}", _DIM),
        (run["verdict"].upper(), _GOOD if good else _BAD),
        (report_text.counts(counts), ""),
        ("" if run["duration"] is None else report_text.duration(run["duration"]), ""),
        *([(where(run["robot"], run["station"]), "")] if mixed else []),
        (one_line(run["run"]), _DIM),
    ]


def where(robot: str, station: str) -> str:
    """Return the robot and its place in words."""
    return f"{one_line(robot) or 'unnamed robot'} on {one_line(station) or 'unnamed station'}"


def _tests(sheet: Sheet, title: str, tests: dict[str, Any]) -> None:
    if tests:
        sheet.title(title)
        sheet.table(
            [(one_line(name), ""), (_rate(item["pass_rate"]), ""), (_strip(sheet, item["verdicts"]), "")]
            for name, item in sorted(tests.items(), key=lambda test: (test[1]["pass_rate"][0], test[0]))
        )


def _fails(item: dict[str, Any]) -> bool:
    """Return whether a test's last verdict is bad."""
    said = [verdict for verdict in item["verdicts"] if verdict is not None]
    return said[-1] in {verdict.value for verdict in Verdict if verdict.ran and not verdict.good}


def _legend(sheet: Sheet) -> None:
    sheet.line()
    sheet.line("  ".join(f"{sheet.glyph(pair)} {meaning}" for pair, meaning in _LEGEND), _DIM)


def _strip(sheet: Sheet, verdicts: list[str | None]) -> str:
    glyphs = {verdict.value: pair for verdict, pair in _GLYPHS.items()}
    return "".join(
        sheet.glyph(_NOT_THERE if verdict is None else glyphs.get(verdict, _NOT_JUDGED)) for verdict in verdicts
    )


def _rate(pass_rate: list[float]) -> str:
    rate, low, high = (100 * part for part in pass_rate)
    return "never judged" if (low, high) == (0, 100) else f"passed {rate:.0f} % ({low:.0f} to {high:.0f} %)"


# Measurements --------------------------------------------------------------------------------------------------------


def _label(key: str) -> str:
    test, subject, name = key.split("\n", 2)
    return (
        f"{one_line(test)}  {one_line(subject)}: {one_line(name)}" if subject else f"{one_line(test)}  {one_line(name)}"
    )


def _brief(sheet: Sheet, title: str, items: dict[str, Any], last_words: Any) -> None:
    """Write a line for each measurement. ``last_words`` returns the end of its line."""
    if items:
        sheet.title(title)
        sheet.table(
            [(_label(key), ""), (_newest(item), _style(item)), (_spark(sheet, item), ""), (last_words(item), "")]
            for key, item in items.items()
        )


def _urgency(measurement: tuple[str, dict[str, Any]]) -> tuple[float, str]:
    """Return a sort key: the measurement that reaches its limit first comes first."""
    after = measurement[1]["drift"]["after"]
    return float("inf") if after is None else after, measurement[0]


def _about(sheet: Sheet, item: dict[str, Any], runs: int) -> Iterable[str]:
    values = [*middles(item["points"]).values()]
    point = item["points"][-1]
    yield f"last {_newest(item)}, {point[4]}; {_limits(item)}"
    if values:
        low, middle, high = (number(value) for value in (min(values), median(values), max(values)))
        yield f"smallest {low}, median {middle}, largest {high} of {len(values)} runs"
    if any(point[4] != MeasurementVerdict.RECORDED for point in item["points"]):
        yield _rate(item["pass_rate"])
    yield _drift_text(item)
    if values:
        bottom, top = _scale(item)
        yield f"{number(bottom)} {_spark(sheet, item, runs)} {number(top)}"


def _newest(item: dict[str, Any]) -> str:
    value = item["points"][-1][1]
    return "no number" if value is None else one_line(quantity(value, item["unit"]))


def _style(item: dict[str, Any]) -> str:
    styles = {MeasurementVerdict.FAILED.value: _BAD, MeasurementVerdict.MARGINAL.value: _WARNING}
    return styles.get(item["points"][-1][4], "")


def _limits(item: dict[str, Any]) -> str:
    _, _, low, high, _ = item["points"][-1]
    return one_line(limits_text(low, high, item["unit"]))


def _is_close(item: dict[str, Any]) -> bool:
    _, value, low, high, verdict = item["points"][-1]
    if verdict in (MeasurementVerdict.MARGINAL, MeasurementVerdict.FAILED):
        return True
    if verdict != MeasurementVerdict.PASSED or value is None or low is None or high is None:
        return False
    margin = margin_of(value, low, high)
    return margin is not None and margin < _CLOSE * (high - low)


def _drift_text(item: dict[str, Any]) -> str:
    drift = item["drift"]
    if drift is None:
        return "too few runs of one robot to tell a drift"
    p = drift["p"]
    text = f"{drift['slope']:+.3g} {one_line(drift['unit'])} (p {'< 0.001' if p < 0.001 else f'{p:.3f}'})"  # noqa: PLR2004
    if not drift["believed"]:
        return f"no drift: {text}"
    if drift["after"] is None:
        return f"drifts {text}"
    limit = one_line(quantity(drift["limit"], item["unit"]))
    if drift["after"] == 0:
        return f"drifts {text}, is at its limit {limit}"
    return f"drifts {text}, reaches {limit} in about {drift['after']} run{'s' if drift['after'] != 1 else ''}"


def _scale(item: dict[str, Any]) -> tuple[float, float]:
    """Return the values of the lowest and the highest bar: the limits, or without one the extreme value."""
    values = [*middles(item["points"]).values()]
    _, _, low, high, _ = item["points"][-1]
    return min(values) if low is None else low, max(values) if high is None else high


def _spark(sheet: Sheet, item: dict[str, Any], runs: int | None = None) -> str:
    """Return a bar for each run, or a cross if it failed; with ``runs`` also a mark for each run without a value."""
    values = middles(item["points"])
    failed = {point[0] for point in item["points"] if point[4] == MeasurementVerdict.FAILED}
    bottom, top = _scale(item) if values else (0.0, 0.0)
    bars = _PLAIN_BARS if sheet.plain else _BARS

    def bar(run: int) -> str:
        if run in failed:
            return sheet.glyph(_GLYPHS[Verdict.FAILED])
        if run not in values:
            return sheet.glyph(_NOT_THERE)
        share = (
            (values[run] / 2 - bottom / 2) / (top / 2 - bottom / 2) if top > bottom else 0.5
        )  # halves never overflow
        return bars[round((len(bars) - 1) * min(1.0, max(0.0, share)))]

    return "".join(bar(run) for run in (range(runs) if runs is not None else sorted({*values, *failed})))
