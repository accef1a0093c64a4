"""A network of this process, and a file for the log."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.logs.store import LogReader
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.logs.query import Query
    from rtf.logs.record import LogRecord


@pytest.fixture
def network() -> Network:
    """A network of this process alone."""
    return Network(LocalNames())


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Where a log is written."""
    return tmp_path / "logs.sqlite"


def stored(file: Path, query: Query | None = None) -> list[LogRecord]:
    """The records of a file."""
    with LogReader(file) as reader:
        return [record for _, _, record in reader.read(query)]
