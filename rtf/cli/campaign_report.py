"""``rtf campaign report`` and ``compare``: what the runs of a campaign teach, as text and as files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.campaigns.errors import CampaignError
from rtf.cli.history_text import Cell, Sheet
from rtf.cli.parser import make_parser, seconds
from rtf.testing.measurement import quantity
from rtf.testing.report.text import one_line, wants_colour
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.campaigns.outcomes import Outcome
    from rtf.campaigns.report.comparison import Change, Comparison
    from rtf.campaigns.report.detection import Curve
    from rtf.campaigns.report.rates import Rate
    from rtf.campaigns.report.summary import Report

_SHOWN = 12  # rows of a section on the terminal; the files have all
_GOOD, _BAD, _WARNING, _DIM = "green", "red", "yellow", "dim"


def report(words: Sequence[str]) -> ExitCode:
    """Evaluate a campaign: print the main figures, and write the page and what else is asked for."""
    parser = make_parser(
        "campaign report",
        "Evaluate the runs of a campaign: detection curves and limits, false alarms, flakiness, distributions of"
        " measurements, costs, and the tests that find everything for the least time. Runs that are still missing are"
        " left out.",
        """
        rtf campaign report elbow.sqlite
        rtf campaign report elbow.sqlite -o report.html --json report.json --csv tables
        rtf campaign report elbow.sqlite --budget 5min
        """,
    )
    parser.add_argument("file", metavar="FILE.sqlite", type=Path, help="the results of a campaign")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, help="the page (default: FILE.html beside it)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="all of it as JSON")
    parser.add_argument("--csv", metavar="FOLDER", type=Path, help="all of it as tables, runs and measurements, too")
    parser.add_argument("--budget", metavar="TIME", type=seconds, help="the time for the tests to choose, such as 5min")
    options = parser.parse_args(words)
    outcomes, made = _evaluated(options.file, options.budget)
    from rtf.campaigns.report.files import write_json, write_page, write_tables

    page = options.output or options.file.with_suffix(".html")
    write_page(page, made)
    if options.json:
        write_json(options.json, made)
    if options.csv:
        write_tables(options.csv, made, outcomes)
    _print_report(_sheet(), made)
    print(page)
    return ExitCode.PASSED


def compare(words: Sequence[str]) -> ExitCode:
    """Compare two campaigns; returns 1 if something differs that is hardly chance."""
    parser = make_parser(
        "campaign compare",
        "Say which detection limits, rates and distributions differ between two campaigns, such as before and after a"
        " new firmware. Hundreds of comparisons find differences by chance; they are reported so that at most 5 % of"
        " them are expected to be chance (Benjamini and Hochberg).",
        """
        rtf campaign compare before.sqlite after.sqlite
        rtf campaign compare before.sqlite after.sqlite --json changes.json
        """,
    )
    parser.add_argument("before", metavar="BEFORE.sqlite", type=Path, help="the results of one campaign")
    parser.add_argument("after", metavar="AFTER.sqlite", type=Path, help="those of another one")
    parser.add_argument("--json", metavar="FILE", type=Path, help="all comparisons as JSON")
    options = parser.parse_args(words)
    first, before = _evaluated(options.before, None)
    second, after = _evaluated(options.after, None)
    from rtf.campaigns.report.comparison import compare as compare_reports
    from rtf.campaigns.report.files import write_json

    found = compare_reports(before, after, first, second)
    if options.json:
        write_json(options.json, found)
    _print_comparison(_sheet(), found)
    return ExitCode.FAILURES if any(change.significant for change in found.changes) else ExitCode.PASSED


def _evaluated(path: Path, budget: float | None) -> tuple[list[Outcome], Report]:
    try:
        from rtf.campaigns.report.summary import make_report
    except ModuleNotFoundError as error:
        raise CampaignError(f"the statistics of a campaign need {error.name}: pip install 'rtf[campaign]'") from None
    from rtf.campaigns.store import outcomes_of

    outcomes = [*outcomes_of(path)]
    if not outcomes:
        raise CampaignError(f"{path}: no run of this campaign is done yet; run it by 'rtf campaign FILE.toml'")
    return outcomes, make_report(outcomes, path.stem, budget)


# Text ----------------------------------------------------------------------------------------------------------------


def _sheet() -> Sheet:
    return Sheet(sys.stdout, coloured=wants_colour(sys.stdout, None))


def _print_report(sheet: Sheet, made: Report) -> None:
    size = made.size
    robots = one_line(", ".join(filter(None, size.robots)))
    units = f", {_count(size.units, 'unit')} of {robots}" if robots else ""
    sheet.line(
        f"{one_line(made.name)}: {_count(size.runs, 'run')}, {size.healthy} without a fault; "
        f"{_count(size.tests, 'test')}{units}"
    )
    _section(sheet, "Found in 99 % from", [_limit_row(curve) for curve in made.detection])
    alarms = sorted(made.alarms, key=lambda one: (-(one.alarms.share or 0.0), one.test))
    steady = {(one.test, one.robot): one.verdict for one in made.flakiness}
    _section(
        sheet,
        "Alarms on healthy robots",
        [
            [
                _cell(one.test),
                (_rate(one.alarms), _BAD if one.alarms.count else _GOOD),
                (steady[one.test, one.robot], _DIM),
            ]
            for one in alarms
        ],
    )
    _section(
        sheet,
        "Tight limits",
        [
            [
                _cell(one.test),
                _cell(one.name),
                (f"Cpk {one.capability.value:.2f}", _WARNING),
                (f"{one.tight} limit", ""),
            ]
            for one in made.distributions
            if one.capability is not None and one.tight
        ],
    )
    for choice in made.choices:
        _section(
            sheet,
            f"What to run on {one_line(choice.robot)}" if choice.robot else "What to run",
            [
                [_cell(step.test), (f"{step.total_seconds:.0f} s", ""), (f"{step.share:.0%} found", _GOOD)]
                for step in choice.steps
            ],
        )
    sheet.line()


def _section(sheet: Sheet, title: str, rows: Sequence[list[Cell]]) -> None:
    if rows:
        sheet.title(title)
        sheet.table(rows[:_SHOWN])
    if len(rows) > _SHOWN:
        sheet.line(f"  and {len(rows) - _SHOWN} more", _DIM)


def _limit_row(curve: Curve) -> list[Cell]:
    right = curve.right_joint
    named = f"right joint {right.count} of {right.trials}" if right.trials else ""
    return [
        _cell(curve.test),
        _cell(f"{curve.fault} {curve.direction}"),
        (_limit(curve), ""),
        (f"{curve.found.count} of {curve.found.trials} found", _DIM),
        (named, _DIM if right.count == right.trials else _WARNING),
    ]


def _limit(curve: Curve) -> str:
    limit = curve.limit
    if curve.method == "rate":
        return f"{_percent(curve.found.share)} found, of no size"
    if limit.severity is None:
        return "not reached"
    text = quantity(_short(limit.severity), curve.unit)
    if curve.method == "logistic":
        high = "?" if limit.high is None else f"{_short(limit.high):g}"
        return f"{text} ({_short(limit.low or 0.0):g} to {high})"
    return f"{text}, all found from there on"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' if number != 1 else ''}"


def _rate(rate: Rate) -> str:
    if rate.share is None:
        return "not judged"
    return f"{rate.count} of {rate.trials} ({100 * rate.low:.2g} to {100 * rate.high:.2g} %)"


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:.3g} %"


def _short(value: float) -> float:
    return float(f"{value:.3g}")


def _distinct_numbers(first: float, second: float) -> tuple[str, str]:
    """Return two numbers with three digits, or as many more, up to six, as they need to differ."""
    for digits in (3, 4, 5, 6):
        texts = f"{first:.{digits}g}", f"{second:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


def _cell(text: str) -> Cell:
    return one_line(text).strip(), ""


def _print_comparison(sheet: Sheet, found: Comparison) -> None:
    moved = [change for change in found.changes if change.significant]
    sheet.line(
        f"{one_line(found.before)} and {one_line(found.after)}: {len(moved)} of {len(found.changes)} comparisons differ"
        " by more than chance"
    )
    if moved:
        sheet.title("Moved")
        sheet.table([_change_row(change) for change in moved])
    for title, things in (("before", found.only_before), ("after", found.only_after)):
        _section(sheet, f"Only {title}", [[_cell(thing)] for thing in things])


def _change_row(change: Change) -> list[Cell]:
    p = "p < 0.001" if change.adjusted < 0.001 else f"p = {change.adjusted:.3f}"  # noqa: PLR2004 - smaller says no more
    return [
        (change.what, ""),
        _cell(change.test),
        _cell(change.subject),
        (_moved(change), _BAD),
        (p, _DIM),
    ]


def _moved(change: Change) -> str:
    if change.what == "distribution":
        before, after = _distinct_numbers(change.before, change.after)
        return f"median {before} to {quantity(float(after), change.unit)}"
    text = f"{_percent(change.before)} to {_percent(change.after)}"
    if change.limits is None:
        return text
    first, second = ("not reached" if one is None else f"{_short(one):g}" for one in change.limits)
    return f"{text}, limit {first} to {second} {change.unit}".rstrip()
