"""Permission to move a real robot: given on the command line, for one run, and found by tests in their environment."""

from __future__ import annotations

import os

_VARIABLE = "RTF_ALLOW_MOTION"


def give_permission(*, given: bool) -> None:
    """Let the tests of this run move a robot, or not; what a shell has kept from an earlier one counts for nothing."""
    os.environ.pop(_VARIABLE, None)
    if given:
        os.environ[_VARIABLE] = "1"


def has_permission() -> bool:
    """Whether this test may move a real robot."""
    return os.environ.get(_VARIABLE) == "1"
