"""SkinTest on the simulated iCub, and on a robot without skin."""

import pytest

from rtf.robot.model import find_robot
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

CASES = {
    "healthy": "",
    "forearm": "taxel_dead left_forearm place=1",
    "hand": "taxel_dead right_hand",
    "noisy": "skin_noise left_forearm",
    "repeated": "skin_repeated right_hand",
    "slow": "wrong_rate /icubSim/skin/left_hand",
    "elsewhere": "ft_noise left_arm",
}
SUITE = (
    "".join(
        f'<test name="{name}"><parameter name="inject">"{inject}"</parameter> SkinTest </test>'
        for name, inject in CASES.items()
    )
    + '<test name="pressed"><parameter name="least_rest">250</parameter>'
    '<parameter name="portname">/icubSim/skin/left_forearm</parameter> SkinTest </test>'
    '<test name="tolerated"><parameter name="inject">"taxel_dead left_hand"</parameter>'
    '<parameter name="max_dead">1</parameter> SkinTest </test>'
    '<test name="sizes"><parameter name="portname">/icubSim/skin/left_hand</parameter>'
    '<parameter name="triangles">7</parameter> SkinTest </test>'
    '<test name="forces"><parameter name="portname">/icubSim/left_arm/analog:o</parameter>'
    '<parameter name="frequency">100</parameter> SkinTest </test>'
    '<test name="short"><parameter name="time">0.5</parameter>'
    '<parameter name="portname">/icubSim/skin/left_hand</parameter> SkinTest </test>'
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    return run_on_robot(SUITE, parts="left_arm")


def test_healthy_skin_passes(outcome, measured):
    """All four patches, with the taxels of their triangles."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    assert sorted(one.value for one in measured(outcome, "healthy", "taxels")) == [192, 192, 384, 384]
    rests = measured(outcome, "healthy", "lowest rest")
    assert all(238 <= one.value <= 241 for one in rests)


@pytest.mark.parametrize(("name", "taxel"), [("forearm", "taxel 383 (triangle 31)"), ("hand", "taxel 96 (triangle 8)")])
def test_a_dead_taxel_is_found_and_named(outcome, measured, name, taxel):
    """The failure names this taxel, and no other."""
    assert outcome.verdict(name) is Verdict.FAILED
    dead = [one for one in measured(outcome, name, "dead taxels") if one.verdict is MeasurementVerdict.FAILED]
    assert [one.value for one in dead] == [1]
    assert f"{taxel} of /icubSim/skin/" in outcome.detail(name)


def test_noise_and_triangles_that_are_alike_are_found(outcome):
    """Both are named."""
    assert outcome.verdict("noisy") is Verdict.FAILED
    assert "of /icubSim/skin/left_forearm: the reading is noisy" in outcome.detail("noisy")
    assert outcome.verdict("repeated") is Verdict.FAILED
    assert "/icubSim/skin/right_hand: triangles 7 and 8 have shown the same" in outcome.detail("repeated")


def test_the_rate_is_judged(outcome):
    """As of other streams."""
    assert outcome.verdict("slow") is Verdict.FAILED
    assert "/icubSim/skin/left_hand" in outcome.detail("slow")


def test_other_faults_are_not_its_business(outcome):
    """It passes with a fault of another sensor."""
    assert outcome.verdict("elsewhere") is Verdict.PASSED


def test_limits_are_parameters(outcome, measured):
    """A higher rest value fails all taxels; dead ones may be allowed."""
    assert outcome.verdict("pressed") is Verdict.FAILED
    assert sum(one.value for one in measured(outcome, "pressed", "pressed taxels")) == 384
    assert "and 374 more of /icubSim/skin/left_forearm" in outcome.detail("pressed")
    assert outcome.verdict("tolerated") is Verdict.PASSED


def test_what_is_no_skin_fails(outcome):
    """A wrong number of triangles, and another sensor."""
    assert outcome.verdict("sizes") is Verdict.FAILED
    assert "has 192 taxels" in outcome.detail("sizes")
    assert outcome.verdict("forces") is Verdict.FAILED
    assert "6 taxels, which are no triangles of 12" in outcome.detail("forces")


def test_too_few_messages_do_not_pass(outcome):
    """The test is inconclusive: healthy taxels may not have changed by chance."""
    assert outcome.verdict("short") is Verdict.INCONCLUSIVE
    assert "too few to find dead taxels" in outcome.detail("short")


def test_a_robot_without_skin_is_no_failure_of_its_skin(run_on_robot):
    """The error names the places that were searched."""
    outcome = run_on_robot('<test name="none"> SkinTest </test>', model=find_robot("bench"))
    assert outcome.verdict("none") is Verdict.ERROR
    assert "no skin below /benchSim/skin/ is registered" in outcome.detail("none")
