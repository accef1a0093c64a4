"""Measured series as an MCAP file: a topic for each table, its rows as JSON, which Foxglove plots by their names."""

from __future__ import annotations

import io
from math import isfinite
from typing import TYPE_CHECKING, Any

import msgspec

from rtf.recording.errors import MissingPackageError
from rtf.recording.mcap_messages import nanoseconds

try:
    from mcap.writer import Writer
except ImportError as missing:
    raise MissingPackageError(f"MCAP needs the package mcap: pip install 'rtf[mcap]' ({missing})") from missing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.recording.tables import Table

MEDIA_TYPE = "application/vnd.mcap"


def write_tables(tables: Mapping[str, Table]) -> bytes:
    """Return an MCAP file, a topic for each table. What is not a number is null; a row without a time is left out."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(library="rtf")
    rows: list[tuple[int, int, bytes]] = []
    for topic, table in tables.items():
        schema = writer.register_schema(f"rtf.{topic.strip('/')}", "jsonschema", msgspec.json.encode(_schema(table)))
        channel = writer.register_channel(topic, "json", schema)
        columns = [
            (group, name, values.tolist())
            for group, named in table.groups.items()
            for name, (values, _) in named.items()
        ]
        for row, time in enumerate(table.time.tolist()):
            if not isfinite(time):
                continue
            message: dict[str, dict[str, Any]] = {group: {} for group in table.groups}
            for group, name, values in columns:
                message[group][name] = values[row]
            rows.append((max(nanoseconds(time), 0), channel, msgspec.json.encode(message)))
    for stamp, channel, data in sorted(rows, key=lambda one: one[0]):
        writer.add_message(channel, stamp, data, stamp)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


def _schema(table: Table) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": {
            group: {
                "type": "object",
                "properties": {name: {"type": "number", "description": unit} for name, (_, unit) in named.items()},
            }
            for group, named in table.groups.items()
        },
    }
