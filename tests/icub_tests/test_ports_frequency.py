"""PortsFrequency on the simulated robot."""

import pytest

from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

FAULTS = {
    "loss": ("loss /icubSim/head/state:o share=0.1", "/icubSim/head/state:o", "lost"),
    "duplicate": ("duplicate /icubSim/head/stateExt:o", "/icubSim/head/stateExt:o", "duplicates"),
    "rate": ("wrong_rate /icubSim/left_arm/analog:o", "/icubSim/left_arm/analog:o", "rate"),
    "jitter": ("jitter /icubSim/inertial", "/icubSim/inertial", "jitter"),
    "latency": ("latency /icubSim/FTs/measures:o", "/icubSim/FTs/measures:o", "latency"),
    "ahead": ('"old_stamps /icubSim/head/state:o share=1 behind=-1"', "/icubSim/head/state:o", "latency"),
}
FAULTY = "".join(
    f'<test name="{name}"><parameter name="inject">{inject}</parameter>'
    f'<parameter name="time">1</parameter> PortsFrequency </test>'
    for name, (inject, _, _) in FAULTS.items()
)
LINES = "((/icubSim/head/state:o 100 5) (/icubSim/absent 10 1 optional) (/icubSim/missing 10 1))"
SUITE = f"""
<test name="healthy"> PortsFrequency </test>
{FAULTY}
<test name="listed"> <parameter name="PORTS">{LINES}</parameter> PortsFrequency </test>
<test name="short"> <parameter name="PORTS">((/icubSim/head/state:o 100))</parameter> PortsFrequency </test>
<test name="nobody"> <parameter name="robot">nobody</parameter> PortsFrequency </test>
"""


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    return run_on_robot(SUITE, parts="head")


def test_a_healthy_robot_passes(outcome, measured):
    """All streams of the robot are judged without naming any, and in lockstep their rate is exact."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    rates = measured(outcome, "healthy", "rate")
    assert len(rates) == 2 + 6 + 2 + 1 + 1 + 1
    assert {round(event.value, 6) for event in rates} == {100.0}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found_at_its_port_only(outcome, measured, fault):
    """The faulty port fails in the property that the fault changes, and no other port fails."""
    _, port, name = FAULTS[fault]
    assert outcome.verdict(fault) is Verdict.FAILED
    found = [event for event in measured(outcome, fault, name) if event.verdict is MeasurementVerdict.FAILED]
    assert [event.subject for event in found] == [port]


def test_a_missing_port_fails_unless_it_is_optional(outcome):
    """A missing port fails, a missing optional one is skipped, and the others are judged."""
    assert outcome.verdict("listed") is Verdict.FAILED
    assert "/icubSim/missing" in outcome.detail("listed")
    assert "/icubSim/absent" not in outcome.detail("listed")


def test_what_cannot_be_tested_is_an_error(outcome):
    """A line without a tolerance, and a robot without streams, are errors."""
    assert outcome.verdict("short") is Verdict.ERROR
    assert "/icubSim/head/state:o" in outcome.detail("short")
    assert outcome.verdict("nobody") is Verdict.ERROR
    assert "/nobody" in outcome.detail("nobody")


#: Streams in lists for real robots, and the rate of the original simulator's states.
OTHERS = [*((f"/icubSim/face/{one}", 50) for one in ("state:o", "stateExt:o")), ("/icubSim/head/state:o", 50)]
OTHERS += [(f"/icubSim/{side}_hand/analog:o", 100) for side in ("left", "right")]


def test_face_and_hands_are_there_and_the_rate_of_states_is_a_setting(run_on_robot, measured):
    """Each stream has its rate exactly."""
    lines = " ".join(f"({name} {rate} 0.01)" for name, rate in OTHERS)
    suite = f'<test name="others"> <parameter name="PORTS">({lines})</parameter> PortsFrequency </test>'
    outcome = run_on_robot(suite, parts="head,face", state_rate=50)
    assert outcome.verdict("others") is Verdict.PASSED, outcome.detail("others")
    assert [(one.subject, round(one.value, 6)) for one in measured(outcome, "others", "rate")] == OTHERS
