"""Measured series as tables, whatever they are written to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TypeAlias

    from numpy.typing import NDArray

    Column: TypeAlias = tuple[NDArray[Any], str]


class Table(NamedTuple):
    """Rows at ``time``, in seconds. ``groups`` has the columns, each with its unit, by group and name.

    In Foxglove a column is ``/topic.group.name``. All are one-dimensional and as long as ``time``.
    """

    time: NDArray[Any]
    groups: Mapping[str, Mapping[str, Column]]
