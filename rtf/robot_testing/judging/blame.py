"""Who is to blame: the one rule by which all tests fail a joint, or do not.

A joint is failed only by evidence of its own. What goes wrong with it may be the effect of another joint that shakes
or drags it, or of a motor that it shares. So what a test complains of is compared with the evidence on all joints of
the part:

====================================================  ==============================================================
the strongest evidence                                the verdict on the joint
====================================================  ==============================================================
accuses it                                            failed
accuses others only                                   inconclusive; it names what explains the complaint
there is none                                         failed: nothing else explains the complaint
====================================================  ==============================================================

Certain is what sensors of a joint or a motor show of itself, such as an encoder that stands still while its motor
turns. Likely is a motor that is driven hard and does not turn while another joint had to be stopped: it works against
its controller, or against an obstacle, and shakes the others; or a joint that sways farther than all others. A joint
that had to be stopped, or is late, is uncertain: that happens to the healthy neighbours of a fault, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, NoReturn, Self

from rtf.robot_testing.judging.failure_causes import likely_causes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.testing import TestCase


class Strength(IntEnum):
    """How much an evidence says."""

    UNCERTAIN = 1
    LIKELY = 2
    CERTAIN = 3


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks against joints of a part: their numbers, and a sentence that names them.

    ``findings`` are the keys of the likely causes. With an ``excuse`` it is no fault of the robot, see GuardError.
    """

    joints: frozenset[int]
    text: str
    findings: tuple[str, ...] = ()
    strength: Strength = Strength.CERTAIN
    excuse: str = ""

    @classmethod
    def uncertain(cls, joint: int, text: str, *findings: str, excuse: str = "") -> Self:
        """Return what speaks against a single joint, such as that it had to be stopped."""
        return cls(frozenset({joint}), text, findings, Strength.UNCERTAIN, excuse)

    def is_explained_by(self, first: Evidence, joint: int) -> bool:
        """Return whether the evidence of an earlier stop explains this on a joint, of which no more is known."""
        return self.strength is Strength.UNCERTAIN and joint not in first.joints

    @property
    def sentence(self) -> str:
        """The text with the likely causes."""
        return f"{self.text}; {likely_causes(*self.findings)}" if self.findings else self.text


@dataclass(frozen=True, slots=True)
class Blame:
    """Whether a joint has failed, and the reason of that or of the doubt."""

    failed: bool
    text: str


def blame(joint: int, complaint: Evidence, evidence: Iterable[Evidence] = ()) -> Blame:
    """Return the verdict on a joint of which a test complains, by the evidence on the joints of its part."""
    strongest = _strongest(evidence)
    own = next((one for one in strongest if joint in one.joints), None)
    if strongest and own is None:
        return Blame(failed=False, text=_explained(complaint.text, strongest[0].text))
    return _failed(own or complaint, complaint)


def accused(evidence: Iterable[Evidence]) -> dict[int, Evidence]:
    """Return the joints that the strongest evidence accuses, each with it."""
    return {joint: one for one in reversed(_strongest(evidence)) for joint in sorted(one.joints)}


def settle(test: TestCase, verdict: Blame) -> NoReturn:
    """End a test, or its sub-result, with a verdict."""
    if verdict.failed:
        test.assert_fail(verdict.text)
    test.inconclusive(verdict.text)


def _strongest(evidence: Iterable[Evidence]) -> list[Evidence]:
    found = [*evidence]
    most = max((one.strength for one in found), default=Strength.CERTAIN)
    return [one for one in found if one.strength is most]


def _failed(evidence: Evidence, complaint: Evidence) -> Blame:
    only = evidence.text in complaint.text
    if excuse := evidence.excuse or complaint.excuse:
        text = complaint.text if only else f"{evidence.text} ({complaint.text})"
        return Blame(failed=False, text=f"{text}; but {excuse}")
    return Blame(failed=True, text=complaint.sentence if only else f"{evidence.sentence} ({complaint.text})")


def _explained(complaint: str, other: str) -> str:
    return complaint if other in complaint else f"{complaint}; explained by: {other}"
