"""ModelsConsistency, which compares descriptions and needs no robot."""

import pytest

from harness import run_command, write_files
from icub import robot_description
from rtf.testing.events import Measured
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

ELBOW = '<joint name="l_elbow"'


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    """One run: equal models, one with a longer forearm, and models that cannot be read."""
    folder = tmp_path_factory.mktemp("models")
    text = robot_description().read_text(encoding="utf-8")
    begin = text.index('xyz="', text.index(ELBOW)) + len('xyz="')
    numbers = text[begin : text.index('"', begin)].split()
    numbers[2] = str(float(numbers[2]) + 0.005)
    longer = f"{text[:begin]}{' '.join(numbers)}{text[text.index(chr(34), begin) :]}"
    suite = """<suite name="s">
<test name="same"> ModelsConsistency </test>
<test name="longer"> <parameter name="model">longer.urdf</parameter> ModelsConsistency </test>
<test name="two"> <parameter name="model">longer.urdf</parameter> <parameter name="other">longer.urdf</parameter>
  ModelsConsistency </test>
<test name="absent"> <parameter name="model">absent.urdf</parameter> ModelsConsistency </test>
<test name="link"> <parameter name="links">(l_hand tail)</parameter> ModelsConsistency </test>
</suite>"""
    write_files(folder, {"suite.xml": suite, "longer.urdf": longer})
    return run_command(folder, "--suite", "suite.xml")


def distances(outcome, test):
    """The greatest distance of each link (m)."""
    return {event.subject: event for event in outcome.of(Measured, test=f"s/{test}", name="greatest distance")}


def test_the_description_and_the_simulator_agree(outcome):
    """Kinematics that do not use the engine give the same places of all links."""
    assert outcome.verdict("same") is Verdict.PASSED
    found = distances(outcome, "same")
    assert set(found) == {"l_hand", "r_hand", "l_foot", "r_foot", "head", "chest"}
    assert all(event.value < 1e-9 for event in found.values())


def test_a_changed_length_is_found_where_it_matters(outcome):
    """A forearm that is 5 mm longer moves its hand by 5 mm, and no other link."""
    assert outcome.verdict("longer") is Verdict.FAILED
    found = distances(outcome, "longer")
    assert [name for name, event in found.items() if event.verdict is MeasurementVerdict.FAILED] == ["l_hand"]
    assert found["l_hand"].value == pytest.approx(0.005, abs=1e-6)


def test_two_descriptions_may_be_compared(outcome):
    """The other model may be a file as well."""
    assert outcome.verdict("two") is Verdict.PASSED


def test_what_is_not_there_is_an_error(outcome):
    """A file that cannot be read and a link that a model lacks are errors that name them."""
    assert outcome.verdict("absent") is Verdict.ERROR
    assert "absent.urdf" in outcome.detail("absent")
    assert outcome.verdict("link") is Verdict.ERROR
    assert "'tail'" in outcome.detail("link")
