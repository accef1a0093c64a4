"""Messages of robot tests, and the joints or ports that failed, from the events of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.events import Message, SubResultEnded
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from harness import Outcome


def said(outcome: Outcome, test: str) -> str:
    """Return all messages of a test, one a line."""
    return "\n".join(event.detail for event in outcome.of(Message) if event.test.rpartition("/")[2] == test)


def failed_parts(outcome: Outcome, test: str) -> list[str]:
    """Return the subjects of a test's failed sub-results, in order."""
    ended = outcome.of(SubResultEnded, verdict=Verdict.FAILED)
    return [event.subject for event in ended if event.test.rpartition("/")[2] == test]
