"""Regions of a picture: the pixels of a mask that hang together by their sides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def regions(mask: NDArray[np.bool_], least: int) -> list[NDArray[np.bool_]]:
    """Return the regions of a mask (height, width) with ``least`` pixels or more, the largest first, as masks."""
    rows, begins, ends = _runs(mask)
    roots = _joined(rows.tolist(), begins.tolist(), ends.tolist())
    sizes = np.bincount(roots, weights=ends - begins, minlength=len(roots))
    large = [root for root in np.argsort(-sizes, kind="stable") if sizes[root] >= least]
    found = []
    for root in large:
        region = np.zeros_like(mask)
        for run in np.flatnonzero(roots == root):
            region[rows[run], begins[run] : ends[run]] = True
        found.append(region)
    return found


def _runs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return the runs of each row, in order: row, first column, and the column behind the last."""
    steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, begins = np.nonzero(steps > 0)
    _, ends = np.nonzero(steps < 0)
    return rows, begins, ends


def _joined(rows: list[int], begins: list[int], ends: list[int]) -> NDArray[np.intp]:
    """Return for each run the number of one that stands for its region."""
    parents = list(range(len(rows)))

    def root(run: int) -> int:
        while parents[run] != run:
            parents[run] = parents[parents[run]]
            run = parents[run]
        return run

    above = 0  # the first run of the row before that may touch this one
    for run, row in enumerate(rows):
        while rows[above] < row - 1 or (rows[above] == row - 1 and ends[above] <= begins[run]):
            above += 1
        other = above
        while rows[other] == row - 1 and begins[other] < ends[run]:
            parents[root(other)] = root(run)
            other += 1
    return np.array([root(run) for run in range(len(rows))], dtype=np.intp)
