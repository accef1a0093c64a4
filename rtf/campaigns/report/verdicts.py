"""What a verdict says of the robot: a fault was found, none was found, or nothing.

The same reading as that of the proof: only ``failed`` finds a fault, and a test that could not judge says nothing.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.campaigns.report.rates import Rate, exact_rate
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.campaigns.outcomes import Outcome

_FOUND = frozenset({Verdict.FAILED, Verdict.EXPECTED_FAILURE})
_QUIET = frozenset({Verdict.PASSED, Verdict.MEASURED, Verdict.FLAKY, Verdict.UNEXPECTED_PASS})


def found(outcome: Outcome) -> bool:
    """Return whether the test found a fault."""
    return outcome.verdict in _FOUND


def judged(outcome: Outcome) -> bool:
    """Return whether the test found a fault or none. Errors, inconclusive and blocked tests did not judge."""
    return outcome.verdict in _FOUND or outcome.verdict in _QUIET


def first_attempt_failed(outcome: Outcome) -> bool:
    """Return whether the first attempt of a judged test failed; a flaky one passed later."""
    return found(outcome) or outcome.verdict is Verdict.FLAKY


def right_joint(outcome: Outcome) -> bool:
    """Return whether the first name of a failure is that of the faulty joint; a subject may be ``left_arm/l_elbow``."""
    return outcome.joint in re.split(r"[ /]", outcome.named or "")


def found_rate(outcomes: Iterable[Outcome]) -> Rate:
    """Return how many of the judged outcomes found a fault."""
    these = [found(outcome) for outcome in outcomes if judged(outcome)]
    return exact_rate(sum(these), len(these))
