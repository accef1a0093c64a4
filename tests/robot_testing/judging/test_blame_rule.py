"""The one rule of all tests: a joint fails only by evidence of its own."""

import pytest

from rtf.robot_testing.judging.blame import Evidence, Strength, accused, blame

COMPLAINT = Evidence(frozenset({0}), "elbow is late", ("weak",), strength=Strength.UNCERTAIN)
BUSY = "this machine is too busy"


def evidence(*joints, strength=Strength.CERTAIN, text="it is broken", excuse=""):
    """Evidence against joints."""
    return Evidence(frozenset(joints), text, ("frozen",), strength, excuse)


@pytest.mark.parametrize(
    ("found", "failed"),
    [
        ([], True),
        ([evidence(0)], True),
        ([evidence(0, 3)], True),
        ([evidence(1)], False),
        ([evidence(1), evidence(0, strength=Strength.UNCERTAIN)], False),
        ([evidence(1), evidence(0, strength=Strength.LIKELY)], False),
        ([evidence(1, strength=Strength.LIKELY), evidence(0, strength=Strength.UNCERTAIN)], False),
        ([evidence(1), evidence(0)], True),
        ([evidence(0, strength=Strength.UNCERTAIN)], True),
        ([evidence(1, strength=Strength.UNCERTAIN)], False),
        ([evidence(1, strength=Strength.UNCERTAIN), evidence(0, strength=Strength.UNCERTAIN)], True),
    ],
)
def test_a_joint_fails_by_the_strongest_evidence(found, failed):
    """Certain evidence comes first, then the likely; among equals own evidence comes before that on others."""
    assert blame(0, COMPLAINT, found).failed is failed


def test_a_verdict_says_what_explains_the_complaint():
    """An own cause with its likely causes, and the cause elsewhere for a joint that has not failed."""
    own = blame(0, COMPLAINT, [evidence(0)]).text
    assert own.startswith("it is broken; likely: the encoder's cable")
    assert own.endswith("(elbow is late)")
    assert blame(0, COMPLAINT, [evidence(1)]).text == "elbow is late; explained by: it is broken"
    assert blame(0, COMPLAINT).text.startswith("elbow is late; likely: a weak motor")


def test_a_sentence_is_not_said_twice():
    """A complaint that has the text of its evidence is enough."""
    for joint in (0, 1):
        text = blame(0, COMPLAINT, [evidence(joint, strength=Strength.UNCERTAIN, text="elbow is late")]).text
        assert text.count("elbow is late") == 1


@pytest.mark.parametrize("strength", [*Strength])
def test_an_excuse_keeps_a_joint_from_failing(strength):
    """It is part of the reason."""
    verdict = blame(0, COMPLAINT, [evidence(0, strength=strength, excuse=BUSY)])
    assert not verdict.failed
    assert verdict.text.endswith(f"; but {BUSY}")


def test_the_accused_are_those_of_the_strongest_evidence():
    """Uncertain evidence counts only without a certain one."""
    one, other, doubt = evidence(1, 2), evidence(2), evidence(3, strength=Strength.UNCERTAIN)
    assert accused([doubt, one, other]) == {1: one, 2: one}
    assert accused([doubt]) == {3: doubt}
    assert accused([]) == {}
