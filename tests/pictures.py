"""Whether pictures of a simulated robot can be made here."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end


def obstacle() -> str:
    """Return why no picture can be rendered; empty if it can."""
    if not (find_spec("mujoco") and find_spec("icub_models")):
        return "needs pip install 'rtf[sim]'"
    try:
        rendering_back_end()
    except RenderingError as error:
        return str(error)
    return ""


#: The mark of tests and files that make pictures.
needs_pictures = pytest.mark.skipif(bool(obstacle()), reason=obstacle() or "pictures can be made")
