"""What is known of a test as names and values, for JUnit XML and other reports that carry ``user_properties``.

Values are text and names are stable, because the readers are scripts. A number stands alone, so that it can be read
as one; its unit, limits and verdict are properties of their own, named like it with a word behind a colon.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.events import Attached, Measured, ParametersResolved, SeriesRecorded, SubResultEnded
from rtf.testing.report.text import incident, shown

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.pytest_suites.listener import FinishedTest

#: More than these are in the record of the run.
_LIMIT = 1000


def properties(finished: FinishedTest, run_folder: Path) -> list[tuple[str, str]]:
    """The properties of a test that has ended: plain text, which is all that reaches pytest from a worker of xdist."""
    found = [(name, str(shown(value))) for name, value in _all(finished, run_folder) if value]
    if len(found) > _LIMIT:
        found = [*found[:_LIMIT], ("rtf:left out", str(len(found) - _LIMIT))]
    return found


def _all(finished: FinishedTest, run_folder: Path) -> Iterator[tuple[str, str]]:
    result, ended = finished.result, finished.ended
    yield "rtf:test", result.id
    yield "rtf:verdict", finished.verdict
    yield "rtf:reason", ended.reason
    yield "rtf:attempts", str(ended.attempt) if ended.attempt > 1 else ""
    yield "rtf:run", str(run_folder)
    for fact in finished.incidents:
        yield "rtf:incident", incident(fact)
    for event in finished.last.events:
        if isinstance(event, Measured):
            yield from _measurement(event)
        elif isinstance(event, SubResultEnded):
            yield f"part.{shown(event.subject)}", event.verdict
        elif isinstance(event, ParametersResolved):
            for row in event.parameters:
                text = " ".join(part for part in (row.get("value", ""), row.get("unit", "")) if part)
                yield f"parameter.{shown(row.get('name', ''))}", text
        elif isinstance(event, Attached):
            yield f"attachment.{shown(event.name)}", str(run_folder / event.path)
        elif isinstance(event, SeriesRecorded):
            yield f"series.{_name(event)}", str(run_folder / event.path)


def _measurement(event: Measured) -> Iterator[tuple[str, str]]:
    name = f"measurement.{_name(event)}"
    yield name, repr(event.value)
    yield f"{name}:unit", event.unit
    yield f"{name}:low", "" if event.low is None else repr(event.low)
    yield f"{name}:high", "" if event.high is None else repr(event.high)
    yield f"{name}:margin", "" if event.margin is None else repr(event.margin)
    yield f"{name}:verdict", event.verdict


def _name(event: Measured | SeriesRecorded) -> str:
    return shown(f"{event.subject}.{event.name}" if event.subject else event.name)
