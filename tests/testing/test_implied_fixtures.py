"""Implied fixtures of tests: a test that may move something names its fixtures, or is not run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness import run_command, write_files
from rtf.testing.events import FixtureChanged, TestStarted
from rtf.testing.verdict import ExitCode, FixtureState, Verdict

if TYPE_CHECKING:
    from pathlib import Path

RIG = """
from rtf.testing import FixtureManager
class Rig(FixtureManager):
    \"\"\"Is there.\"\"\"
"""
MOVES = """
from rtf.testing import TestCase
class Moves(TestCase):
    \"\"\"Wants a rig.\"\"\"
    safety = "motion"
    def implied_fixtures(self): return (("rig", {}),)
    def run(self): pass
"""
BESIDE = "from typing import NamedTuple\nclass Step(NamedTuple):\n    size: int\n"


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(MOVES.replace("class", BESIDE + "class", 1), id="a helper beside it"),
        pytest.param(MOVES.replace("class", "SAFE = 'motion'\nclass", 1).replace('"motion"', "SAFE"), id="a name"),
        pytest.param("from moves import Moves\nclass Inherits(Moves):\n    pass\n", id="inherited"),
    ],
)
def test_it_is_asked_unless_it_plainly_moves_nothing(tmp_path: Path, text: str):
    """A test whose text does not say ``still`` is asked for its implied fixtures."""
    write_files(tmp_path, {"rig.py": RIG, "moves.py": MOVES, "tests/subject.py": text})
    outcome = run_command(tmp_path, "--test", "tests/subject.py", PYTHONPATH=str(tmp_path))
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert [event.fixture for event in outcome.of(FixtureChanged, state=FixtureState.READY)] == ["rig"]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("import os; os._exit(3)", "exit status 3"),
        ("import os; os.abort()", "SIGABRT"),
        ("raise OSError('no idea')", "OSError: no idea"),
        ("return (('rig', {'height': object()}),)", "Expected `str`, got `object`"),
    ],
)
def test_without_an_answer_it_is_not_run(tmp_path: Path, how: str, reason: str):
    """A test that cannot be asked is an error with the reason, and the others run."""
    silent = MOVES.replace("class Moves", "class Silent").replace('return (("rig", {}),)', how)
    write_files(tmp_path, {"rig.py": RIG, "tests/moves.py": MOVES, "tests/silent.py": silent})
    outcome = run_command(tmp_path, "--tests", "tests")
    assert (outcome.verdict("silent"), outcome.verdict("moves")) == (Verdict.ERROR, Verdict.PASSED)
    assert "was not asked what puts right what it may leave behind" in outcome.detail("silent")
    assert reason in outcome.detail("silent")
    assert [event.test for event in outcome.of(TestStarted)] == ["tests/moves"]  # type: ignore[attr-defined]
