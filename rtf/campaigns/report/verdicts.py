"""What a verdict says of the robot: a fault, none, or nothing. The same reading as that of the proof.

With a fault only ``failed`` finds it, and an error says nothing. On a healthy robot an error is a false alarm as well:
somebody has to look at it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.campaigns.report.rates import Rate, exact_rate
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.campaigns.outcomes import Outcome

_FAILED = frozenset({Verdict.FAILED, Verdict.EXPECTED_FAILURE})
_QUIET = frozenset({Verdict.PASSED, Verdict.MEASURED, Verdict.FLAKY, Verdict.UNEXPECTED_PASS})


def completed(outcome: Outcome) -> bool:
    """Return whether the test came to a verdict of its own on the robot."""
    return outcome.verdict in _FAILED or outcome.verdict in _QUIET


def judged(outcome: Outcome) -> bool:
    """Return whether the outcome says something of the robot. Inconclusive and blocked tests say nothing."""
    return completed(outcome) or (outcome.healthy and outcome.verdict is Verdict.ERROR)


def found(outcome: Outcome) -> bool:
    """Return whether a judged outcome says that something is wrong: a fault is found, or a false alarm raised."""
    return outcome.verdict in _FAILED or (outcome.healthy and outcome.verdict is Verdict.ERROR)


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
