"""The files of a report: JSON, tables as CSV, and a page that is one file.

All are made from the same plain data. The page is ``campaign.html`` of ``reports/page`` with the JSON in it; it draws
itself in the browser, offline, and parses no text as markup.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
from typing import TYPE_CHECKING, Any

from rtf.page.single_file import page_in_pieces, write_block
from rtf.testing.report.files import Target
from rtf.testing.report.text import without_surrogates

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from _typeshed import DataclassInstance

    from rtf.campaigns.outcomes import Outcome
    from rtf.campaigns.report.detection import Curve
    from rtf.campaigns.report.summary import Report

_PAGE = "campaign.html"
_BLOCK = "rtf-campaign"
#: A cell that begins so would be read as a formula by a spreadsheet.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def to_json(thing: DataclassInstance) -> bytes:
    """Return dataclasses as strict JSON; a number that is not finite is null."""
    plain = _plain(dataclasses.asdict(thing))
    return json.dumps(plain, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()


def _plain(value: Any) -> Any:  # whatever dataclasses have as members
    match value:
        case float():
            return value if math.isfinite(value) else None
        case str():
            return without_surrogates(str(value))
        case dict():
            return {name: _plain(member) for name, member in value.items()}
        case list() | tuple():
            return [_plain(member) for member in value]
    return value


def write_json(path: Path, thing: DataclassInstance) -> None:
    """Write dataclasses as JSON. Raises OSError."""
    _write(path, [to_json(thing), b"\n"])


def write_page(path: Path, report: Report) -> None:
    """Write the page. Raises OSError."""
    head, tail = page_in_pieces(index=_PAGE)
    block = io.BytesIO()
    write_block(block, {"id": _BLOCK}, [to_json(report)])
    _write(path, [head, block.getvalue(), tail])


def write_tables(folder: Path, report: Report, outcomes: Sequence[Outcome]) -> None:
    """Write the tables into a folder, which is made: ``runs.csv``, ``measurements.csv``, and one for each evaluation.

    Each has a head of names, one row a thing, and no value in a cell that is none; ``pandas.read_csv`` reads them as
    they are. Raises OSError.
    """
    for name, rows in _tables(report, outcomes):
        _write(folder / f"{name}.csv", [_csv([*rows])])


def _tables(report: Report, outcomes: Sequence[Outcome]) -> Iterator[tuple[str, Iterable[Mapping[str, Any]]]]:
    yield "runs", (_run(number, outcome) for number, outcome in enumerate(outcomes))
    yield "measurements", _measurements(outcomes)
    yield "levels", (_of_curve(curve) | _flat(level) for curve in report.detection for level in curve.levels)
    for name in ("detection", "alarms", "flakiness", "distributions", "costs"):
        yield name, map(_flat, getattr(report, name))
    yield "choices", ({"robot": choice.robot} | _flat(step) for choice in report.choices for step in choice.steps)


def _run(number: int, outcome: Outcome) -> dict[str, Any]:
    names = [field.name for field in dataclasses.fields(outcome) if field.name != "measurements"]
    return {"run": number} | {name: getattr(outcome, name) for name in names}


def _measurements(outcomes: Sequence[Outcome]) -> Iterator[dict[str, Any]]:
    for number, outcome in enumerate(outcomes):
        run = _run(number, outcome)
        for name, one in outcome.measurements.items():
            limits = {"lower": one.lower, "upper": one.upper}
            yield run | {"name": name, "value": one.value, "unit_of_value": one.unit} | limits


def _of_curve(curve: Curve) -> dict[str, Any]:
    return {"test": curve.test, "robot": curve.robot, "fault": curve.fault, "direction": curve.direction}


def _flat(thing: DataclassInstance, prefix: str = "") -> dict[str, Any]:
    """Return the members of a dataclass, those of its members as ``member.name``; lists are left out."""
    flat: dict[str, Any] = {}
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            flat |= _flat(value, f"{prefix}{field.name}.")
        elif not isinstance(value, tuple):
            flat[f"{prefix}{field.name}"] = value
    return flat


def _csv(rows: Sequence[Mapping[str, Any]]) -> bytes:
    names = dict.fromkeys(name for row in rows for name in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, [*names])
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue().encode()


def _cell(value: object) -> object:
    if not isinstance(value, str):
        return value
    text = without_surrogates(str(value))
    return f"'{text}" if text.startswith(_FORMULA) else text


def _write(path: Path, pieces: Iterable[bytes]) -> None:
    target = Target(path)
    target.check()
    with target.writing() as stream:
        stream.writelines(pieces)
