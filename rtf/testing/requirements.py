"""What a test requires of its surroundings, and whether it is there; checked before anything of it is started."""

from __future__ import annotations

import importlib.util
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing.suite.model import TEST_REQUIREMENT
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from rtf.testing.results import RunResult, TestResult
    from rtf.testing.suite.model import TestEntry


@dataclass(frozen=True, slots=True)
class Unmet:
    """A requirement that does not hold: what the test's verdict becomes, and the sentence for people."""

    verdict: Verdict
    text: str


def unmet(test: TestEntry, results: RunResult, features: frozenset[str]) -> Unmet | None:
    """The first requirement of a test that does not hold.

    A test that stands on another one (``test:``) is blocked when that did not pass; all else is a reason to skip:
    ``program:NAME`` on the PATH, ``module:NAME`` to import, ``env:NAME`` set, ``file:PATH`` there, or a bare word that
    the command line grants with ``--feature``.
    """
    for token in test.requires:
        kind, separator, name = token.partition(":")
        if token.startswith(TEST_REQUIREMENT):
            other = results.tests.get(name)
            if other is None or not other.good or other.verdict is Verdict.SKIPPED:
                return Unmet(Verdict.BLOCKED, f"needs test {name}, which {_state(other)}")
        elif separator and not _there(kind, name, test):
            return Unmet(Verdict.SKIPPED, f"requires {_WORDS.get(kind, kind)} {name!r}, which is not there")
        elif not separator and token not in features:
            return Unmet(Verdict.SKIPPED, f"requires {token!r}; grant it with --feature {token}")
    return None


def _state(other: TestResult | None) -> str:
    if other is None:
        return "is not in this run"
    bad = next((case for case in other.cases if not case.good), None)
    if bad is not None and other.verdict is not None and other.verdict.good:
        return f"has a case that came to: {bad.verdict} ({bad.name})"
    return f"came to: {other.verdict or 'nothing yet'}"


_WORDS = {"program": "program", "module": "Python module", "env": "environment variable", "file": "file"}


def _there(kind: str, name: str, test: TestEntry) -> bool:
    if kind == "program":
        return shutil.which(name) is not None
    if kind == "module":
        try:
            return importlib.util.find_spec(name) is not None
        except (ImportError, ValueError):
            return False
    if kind == "env":
        return name in os.environ
    if kind == "file":
        beside = Path(test.location.file).parent if test.location.file else Path()
        return (beside / Path(name).expanduser()).exists()
    return False
