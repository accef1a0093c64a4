"""Which suites wait for each other where tests are spread over several workers."""

import fcntl
from types import SimpleNamespace

import pytest

from rtf.pytest_suites.locks import locks_of


def suite(*fixtures):
    """A suite with such fixtures: a plug-in, and its ``param`` behind a blank."""
    rows = [text.partition(" ") for text in fixtures]
    return SimpleNamespace(fixtures=[SimpleNamespace(plugin=plugin, param=param) for plugin, _, param in rows])


def exclude(one, other):
    """Whether one has to wait while the other is up: both want a place, and not both would share it."""
    first, second = locks_of(one), locks_of(other)
    return any(fcntl.LOCK_EX in (first[place], second[place]) for place in first.keys() & second.keys())


@pytest.mark.parametrize(
    ("one", "other", "wait"),
    [
        (["robot"], ["robot"], True),
        (["robot --x 1"], ["robot --x 1"], True),
        (["robot --x 1"], ["robot --x 2"], False),
        (["robot"], ["robot --x 2"], True),
        (["robot"], ["simulator"], False),
        (["robot --x 1", "robot"], ["robot --x 2"], True),
        (["robot", "robot --x 1"], ["robot --x 2"], True),
        (["fixtures/robot.py"], ["Robot"], True),
    ],
)
def test_two_fixtures_of_a_plug_in_are_two_only_with_params_that_differ(one, other, wait):
    """As with lanes; a robot may be written in two ways."""
    assert exclude(suite(*one), suite(*other)) is wait
    assert exclude(suite(*other), suite(*one)) is wait
