"""Locks of fixtures among several workers."""

import fcntl
import subprocess
import sys

import pytest

from rtf.pytest_suites.locks import FixtureLocks, locks_of
from rtf.testing.dispatch import Use

ROBOT, FIRST, SECOND = Use("robot", ""), Use("robot", "--x 1"), Use("robot", "--x 2")


def exclude(one, other):
    """Return whether two suites exclude each other."""
    first, second = locks_of(one), locks_of(other)
    return any(fcntl.LOCK_EX in (first[place], second[place]) for place in first.keys() & second.keys())


@pytest.mark.parametrize(
    ("one", "other", "wait"),
    [
        ([ROBOT], [ROBOT], True),
        ([FIRST], [FIRST], True),
        ([FIRST], [SECOND], False),
        ([ROBOT], [SECOND], True),
        ([ROBOT], [Use("simulator", "")], False),
        ([FIRST, ROBOT], [SECOND], True),
        ([ROBOT, FIRST], [SECOND], True),
    ],
)
def test_two_fixtures_of_a_plug_in_are_two_only_with_params_that_differ(one, other, wait):
    """Fixtures of one plug-in exclude each other unless their params differ, as with suite workers."""
    assert exclude(one, other) is wait
    assert exclude(other, one) is wait


#: Another worker, which gets a fixture.
OTHER = """
import sys
from pathlib import Path
from rtf.pytest_suites.locks import FixtureLocks
from rtf.testing.dispatch import Use
FixtureLocks(Path(sys.argv[1])).acquire([Use(sys.argv[2], "")])
"""


def test_a_wait_that_is_interrupted_holds_nothing(tmp_path, monkeypatch):
    """A worker that has one of two fixtures, and is interrupted while it waits for the other, leaves it to others."""
    first, second = sorted(["robot", "simulator"], key=lambda name: [*locks_of([Use(name, "")])])
    path, lock = tmp_path / "locks", fcntl.lockf

    def interrupted(descriptor, kind, length, offset):
        if kind != fcntl.LOCK_UN and offset in locks_of([Use(second, "")]):
            raise KeyboardInterrupt
        lock(descriptor, kind, length, offset)

    monkeypatch.setattr(fcntl, "lockf", interrupted)
    locks = FixtureLocks(path)
    with pytest.raises(KeyboardInterrupt):
        locks.acquire([Use(first, ""), Use(second, "")])
    subprocess.run([sys.executable, "-c", OTHER, path, first], timeout=10, check=True)
    locks.close()
