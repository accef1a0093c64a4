"""Faults without a claim: a test is run with all of them, and a test that does not pass needs a reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtf.robot_testing.proof import (
    Case,
    ClaimsError,
    Expectation,
    JudgedCase,
    Judgement,
    judge,
    others_of,
    read_claims,
    read_reasons,
    write_matrix,
)
from rtf.robot_testing.proof.cases import provable_kinds
from rtf.robot_testing.proof.claims import robot_of
from rtf.simulator.faults import Target, find_kind
from rtf.testing.events import Message, TestEnded, TestPlanned
from rtf.testing.plugins import shipped_folder
from rtf.testing.results import TestResult
from rtf.testing.verdict import Severity, Verdict

CLAIMS = shipped_folder("test") / "claims"
DEAD = '[[reason]]\nfaults = ["motor_dead"]\ntext = "a joint that does not move ends every test that moves it"\n'


@pytest.fixture
def reasons(tmp_path: Path):
    """Write a file of reasons, and read it."""

    def read(text: str):
        file = tmp_path / "reasons.toml"
        file.write_text(text)
        return read_reasons(file)

    return read


def test_claims_and_others_cover_every_test_with_every_fault():
    """Each pair exactly once, but those with cameras that a configured robot does not have."""
    for file in CLAIMS.glob("*.toml"):
        claims = read_claims(file)
        claimed = {claim.fault for claim in claims.claims}
        others = [case.fault for case in others_of(claims, ())]
        assert claimed.isdisjoint(others)
        kinds = [
            name
            for name in provable_kinds(robot_of(claims.robot))
            if not claims.configuration or find_kind(name).target_kind not in (Target.CAMERA, Target.DEPTH_CAMERA)
        ]
        assert claimed | {*others} >= {*kinds}
        assert len(others) == len({*others})


def test_a_fault_is_injected_where_the_test_looks(reasons):
    """The joint belongs to the part under test, and is the same as in other cases."""
    arm = {case.fault: case for case in others_of(read_claims(CLAIMS / "motor_test.toml"), reasons(DEAD))}
    assert all(case.parameters.get("part") for case in arm.values())
    assert {case.target for case in arm.values()} >= {"left_arm", "head_imu_0"}
    assert all(case.expectation is Expectation.OTHER for case in arm.values())
    head = {case.fault: case for case in others_of(read_claims(CLAIMS / "can_boards.toml"), ())}
    assert (head["latency"].target, head["motor_dead"].target) == ("/icubSim/head/stateExt:o", "neck_pitch")


def test_a_reason_holds_for_the_tests_that_it_names(reasons):
    """Without names it holds for all tests."""
    (everywhere,) = reasons(DEAD)
    assert everywhere.holds_for("JointLimits", "motor_dead")
    assert not everywhere.holds_for("JointLimits", "jam")
    (one,) = reasons(DEAD.replace("text", 'tests = ["Imu"]\ntext'))
    assert one.holds_for("Imu", "motor_dead")
    assert not one.holds_for("JointLimits", "motor_dead")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[[reason]]\nfaults = ['motor_dead']", "needs faults and a text"),
        ("[[reason]]\nfaults = ['no_such']\ntext = 'x'", "no_such"),
        ("[[reason]]\nfaults = ['jam']\ntext = 'x'\nwhy = 1", "why"),
        ("[[reasons]]\nfaults = ['jam']", "reasons"),
        ("[[", "reasons.toml"),
    ],
)
def test_a_wrong_file_of_reasons_is_refused(reasons, text: str, complaint: str):
    """The error has the problem."""
    with pytest.raises(ClaimsError, match=complaint):
        reasons(text)


@pytest.mark.parametrize(
    ("verdict", "reason", "judgement"),
    [
        (Verdict.PASSED, "", Judgement.SILENT),
        (Verdict.PASSED, "because", Judgement.SILENT),
        (Verdict.FAILED, "because", Judgement.EXPECTED),
        (Verdict.FAILED, "", Judgement.ALARM),
        (Verdict.NOT_RUN, "", Judgement.NOT_TESTED),
    ],
)
def test_a_test_that_does_not_pass_needs_a_reason(verdict: Verdict, reason: str, judgement: Judgement):
    """A test that passes needs none."""
    result = TestResult(TestPlanned(test="s/t", suite="s", name="t"), "t")
    result.verdict = verdict
    result.attempts.append(TestEnded(test="s/t", outcome=verdict, verdict=verdict))
    case = Case("Looks", Expectation.OTHER, "jam", "l_elbow", reason=reason)
    assert judge(case, result).judgement is judgement


@pytest.mark.parametrize(
    ("subjects", "judgement"),
    [
        (["l_elbow"], Judgement.FOUND),
        (["l_elbow", ""], Judgement.FOUND),
        (["l_elbow", "l_wrist_yaw"], Judgement.ALARM),
        ([""], Judgement.ALARM),
    ],
)
def test_a_failure_that_names_what_is_faulty_needs_no_reason(subjects: list[str], judgement: Judgement):
    """It is more than the test claims, and true; but not if it fails another joint, too."""
    result = TestResult(TestPlanned(test="s/t", suite="s", name="t"), "t")
    result.verdict = Verdict.FAILED
    for subject in subjects:
        result.apply(Message(severity=Severity.FAILURE, title="checks", detail="it does not move", subject=subject))
    case = Case("Looks", Expectation.OTHER, "jam", "l_elbow", names="l_elbow")
    assert judge(case, result).judgement is judgement


def test_the_page_lists_tests_that_did_not_pass():
    """The others are counted only."""
    case = Case("Looks", Expectation.OTHER, "jam", "l_elbow", reason="it cannot move")
    quiet = JudgedCase(Case("Looks", Expectation.OTHER, "ft_bias", "left_arm"), Judgement.SILENT, "passed", "", 1.0)
    page = write_matrix([quiet, JudgedCase(case, Judgement.EXPECTED, "failed", "l_elbow: it stays", 1.0)])
    assert "2 pairs: 1 passed" in page
    assert "| Looks | jam | l_elbow | torque 400 Nm | expected | it cannot move |" in page
    assert "ft_bias |" not in page.split("without a claim\n\n")[-1]
