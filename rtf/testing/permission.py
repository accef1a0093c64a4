"""What the command line says for one run to all of its tests and fixtures, which find it in their environment."""

from __future__ import annotations

import os

_MOTION = "RTF_ALLOW_MOTION"
_WAIT = "RTF_WAIT_FOR_ROBOT"
_RUNNER = "RTF_RUNNER_PID"


def give_permission(*, given: bool, wait: float = 0.0) -> None:
    """Let the tests of this run move a robot, or not, and its fixtures wait so many seconds for one that is in use.

    What a shell has kept from an earlier run counts for nothing.
    """
    os.environ[_RUNNER] = str(os.getpid())
    for name, value in ((_MOTION, "1" if given else ""), (_WAIT, repr(wait) if wait else "")):
        os.environ.pop(name, None)
        if value:
            os.environ[name] = value


def has_permission() -> bool:
    """Whether this test may move a real robot."""
    return os.environ.get(_MOTION) == "1"


def seconds_to_wait() -> float:
    """How long a fixture may wait for a robot that another run works with; infinite where there is no limit."""
    return float(os.environ.get(_WAIT, "0"))


def runner_pid() -> int:
    """The number of the process of the runner; without one, of this process."""
    return int(os.environ.get(_RUNNER, os.getpid()))
