"""Simplification of the robot's published meshes, for rendering on a machine without graphics hardware.

Vertices that share a cell of a grid become one; a face remains if its vertices are in three different cells. The cost
of rendering in software grows with the number of faces: the quarter of a million of the published meshes cost 100 ms
more a picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

#: Edge of the grid's cells (m).
CELL = 0.012

_HEADER = 80
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path) -> NDArray[np.float32]:
    """Read a binary STL file: one row of three corners a face, shape (faces, 3, 3), in the file's unit.

    Raises ValueError for a file whose length does not agree with its header.
    """
    content = path.read_bytes()
    count = int.from_bytes(content[_HEADER : _HEADER + 4], "little")
    if len(content) != _HEADER + 4 + count * _FACET.itemsize:
        raise ValueError(f"{path}: not a binary STL file of {count} faces")
    facets = np.frombuffer(content, _FACET, offset=_HEADER + 4, count=count)
    return np.ascontiguousarray(facets["corners"])


def clustered(corners: NDArray[np.float32], cell: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Merge the vertices of each cell of a grid with edge ``cell``; return vertices (n, 3) and faces (m, 3).

    A merged vertex is the mean of the vertices in its cell. Degenerate and duplicate faces are removed.
    """
    points = corners.reshape(-1, 3).astype(np.float64)
    cells = np.floor(points / cell).astype(np.int64)
    cells -= cells.min(axis=0)
    size = cells.max(axis=0) + 1
    keys = (cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2]
    _, owner = np.unique(keys, return_inverse=True)
    counts = np.bincount(owner)
    vertices = np.column_stack([np.bincount(owner, points[:, column]) / counts for column in range(3)])
    faces = owner.reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices, np.unique(faces[whole], axis=0).astype(np.int32)
