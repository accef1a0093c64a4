"""Options of the command line for all tests and fixtures of a run, which read them from their environment."""

from __future__ import annotations

import os

_MOTION = "RTF_ALLOW_MOTION"
_WAIT = "RTF_WAIT_FOR_ROBOT"
_RUNNER = "RTF_RUNNER_PID"


def give_permission(*, given: bool, wait: float = 0.0) -> None:
    """Permit or forbid the tests of this run to move a robot, and set how long its fixtures wait for one in use.

    What a shell has kept from an earlier run is ignored.
    """
    os.environ[_RUNNER] = str(os.getpid())
    for name, value in ((_MOTION, "1" if given else ""), (_WAIT, repr(wait) if wait else "")):
        os.environ.pop(name, None)
        if value:
            os.environ[name] = value


def has_permission() -> bool:
    """Return whether this test may move a real robot."""
    return os.environ.get(_MOTION) == "1"


def seconds_to_wait() -> float:
    """Return how long a fixture may wait for a robot in use by another run; infinite without a limit."""
    return float(os.environ.get(_WAIT, "0"))


def runner_pid() -> int:
    """Return the process number of the runner; without a runner, of this process."""
    return int(os.environ.get(_RUNNER, os.getpid()))
