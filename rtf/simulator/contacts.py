"""Contacts between links of the robot."""

from __future__ import annotations

from typing import Any

import numpy as np


def touching(model: Any, data: Any) -> list[tuple[str, str]]:
    """Return the sorted pairs of names of links whose shapes overlap at this moment; each pair once."""
    geoms = np.asarray(data.contact.geom[: data.ncon]).reshape(-1, 2)
    overlapping = np.asarray(data.contact.dist[: data.ncon]) <= 0
    bodies = model.geom_bodyid[geoms[overlapping]]
    named = ((model.body(first).name, model.body(second).name) for first, second in bodies.tolist())
    return sorted({(min(pair), max(pair)) for pair in named})
