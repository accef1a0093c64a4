"""The proof: claims are read strictly, cases become suites of the runner, and results are judged as claimed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from rtf.robot_testing.proof import (
    Case,
    ClaimsError,
    Expectation,
    JudgedCase,
    Judgement,
    cases_of,
    judge,
    limits_of,
    on_units,
    read_claims,
    read_suites,
    write_matrix,
    write_suites,
)
from rtf.testing.dispatch import groups_sharing_fixtures
from rtf.testing.events import Message, TestEnded, TestPlanned
from rtf.testing.plan import Planner
from rtf.testing.plugins import shipped_folder
from rtf.testing.results import TestResult
from rtf.testing.suite.xml import load_suite
from rtf.testing.verdict import Severity, Verdict

TEST = '''
from rtf.robot_testing import RobotTest
from rtf.testing import Parameter


class Looks(RobotTest):
    """Looks at a part."""

    part = Parameter(str, "the part", default="head")

    def run(self):
        self.check(True, "it is there")
'''


@pytest.fixture
def claims(tmp_path: Path):
    """Write the claims of the test ``Looks``, and read them."""
    (tmp_path / "claims").mkdir()
    (tmp_path / "looks.py").write_text(TEST)

    def read(text: str):
        file = tmp_path / "claims" / "looks.toml"
        file.write_text(text)
        return read_claims(file)

    return read


def test_claims_become_cases(claims):
    """The healthy robot, each severity, the part of the faulty joint, and the reason."""
    found = claims("""
        parameters = { inject = "" }
        fast_parameters = { joints = [1] }
        [[finds]]
        fault = "jam"
        target = "l_elbow"
        values = [{ torque = 10 }, { torque = 400 }]
        fast = true
        [[silent]]
        fault = "ft_bias"
        target = "left_arm"
        [[expected]]
        fault = "crash"
        reason = "there is no robot any more"
        """)
    assert found.test == "Looks"
    cases = [*cases_of(found)]
    assert [case.expectation for case in cases] == [
        Expectation.HEALTHY,
        Expectation.FOUND,
        Expectation.FOUND,
        Expectation.SILENT,
    ], "what ends the program is no case of a suite"
    assert cases[1].parameters["part"] == "left_arm"
    assert cases[1].names == "l_elbow"
    assert cases[2].injection == "jam l_elbow torque=400"
    assert "part" not in cases[3].parameters
    fast = [*cases_of(found, fast=True)]
    assert [case.fault for case in fast] == ["", "jam", "jam"]
    assert cases[0].parameters == {"inject": ""}
    assert fast[0].parameters == {"inject": "", "joints": [1]}
    assert "joints" not in fast[1].parameters


def test_smaller_faults_show_the_detection_limit(claims):
    """A half and a quarter of the smallest claimed deviation from what is healthy; found or not, the proof holds."""
    found = claims("""
        [[finds]]
        fault = "encoder_eccentric"
        target = "l_elbow"
        values = [{ amplitude = 2, phase = 10 }, { amplitude = 1, phase = 10 }]
        [[finds]]
        fault = "encoder_scale"
        target = "l_elbow"
        values = { factor = 0.8 }
        [[finds]]
        fault = "encoder_frozen"
        target = "l_elbow"
        [[silent]]
        fault = "ft_bias"
        target = "left_arm"
        """)
    smaller = [*limits_of(found)]
    assert [case.values for case in smaller] == [
        {"amplitude": 0.5, "phase": 10},
        {"amplitude": 0.25, "phase": 10},
        pytest.approx({"factor": 0.9}),
        pytest.approx({"factor": 0.95}),
    ]
    assert {case.expectation for case in smaller} == {Expectation.LIMIT}
    judged = [JudgedCase(case, Judgement.FOUND, "failed", "", 0.0) for case in cases_of(found) if case.fault]
    judged += [
        JudgedCase(case, result, "", "", 0.0)
        for case, result in zip(smaller, [Judgement.FOUND, *[Judgement.SILENT] * 3], strict=True)
    ]
    page = write_matrix(judged)
    assert "| Looks | encoder_eccentric | l_elbow | amplitude 0.5 deg, phase 10 deg | amplitude 0.25 deg" in page
    assert "| Looks | encoder_scale | l_elbow | factor 0.8 | factor 0.9 |" in page


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[finds]]\nfault = 'jamm'", "there is no fault 'jamm'"),
        ("[[finds]]\nfault = 'jam'\ntargt = 'l_elbow'", "[[finds]] has unknown keys targt"),
        ("[[expected]]\nfault = 'jam'", "a reason is missing"),
        ("[finds", "looks.toml"),
        ("claims = 1", "the file has unknown keys claims"),
    ],
)
def test_invalid_claims_are_refused(claims, text: str, said: str):
    """The error has the file and the problem."""
    with pytest.raises(ClaimsError, match=r"looks\.toml") as caught:
        claims(text)
    assert said in str(caught.value)


def test_suites_are_those_of_the_runner(tmp_path: Path):
    """Each case is a test of one of the suites, with its fault and its parameters, whatever their characters."""
    cases = [
        Case("JointLimits", Expectation.FOUND, "jam", "l_elbow", {"torque": 400.0}, "l_elbow", {"part": "left_arm"}),
        Case("JointLimits", Expectation.HEALTHY, parameters={"part": "head", "joints": [0, 1], "name": '<&">'}),
        Case("CameraTest", Expectation.FOUND, "camera_black", "left"),
    ]
    files, by_test = write_suites(cases, tmp_path)
    loaded = {test.id: test for file in files for test in load_suite(file).suite.tests}
    assert {*loaded} == {*by_test}
    assert {case.name for case in by_test.values()} == {case.name for case in cases}
    given = {by_test[name].name: dict(test.parameters) for name, test in loaded.items()}
    assert given[cases[0].name] == {"inject": "jam l_elbow torque=400.0", "part": "left_arm"}
    assert given[cases[1].name] == {"part": "head", "joints": "(0 1)", "name": '<&">'}
    assert any('name="cameras">auto<' in file.read_text() for file in files)


def healthy(count: int) -> list[Case]:
    """Return this number of cases without a fault."""
    return [Case("Imu", Expectation.HEALTHY, parameters={"name": '<&">', "n": n}) for n in range(count)]


def test_each_suite_has_a_robot_of_its_own(tmp_path: Path):
    """So the runner can run all suites at the same time, each with some of the cases."""
    files, by_test = write_suites(healthy(14), tmp_path)
    planned = Planner().plan([load_suite(file).suite for file in files])
    assert [len(suite.tests) for suite in planned] == [6, 6, 2]
    assert len(groups_sharing_fixtures(planned)) == 3
    assert [*by_test.values()] == healthy(14)


def test_the_cases_are_read_from_written_suites(tmp_path: Path):
    """A proof is resumed as it was begun, and the folder has no files of an earlier one."""
    write_suites(healthy(20), tmp_path)
    _, by_test = write_suites(healthy(8), tmp_path)
    assert read_suites(tmp_path, healthy(9)) == by_test
    with pytest.raises(ClaimsError, match=r"proof-1\.xml: no claim has the case 'Imu on the healthy robot n=6"):
        read_suites(tmp_path, healthy(6))


def test_each_case_is_run_on_the_next_unit(tmp_path: Path):
    """A case and its unit are read back from the suites; a robot that a configuration starts has none."""
    configured = Case("Imu", Expectation.HEALTHY, configuration="icubSim")
    cases = on_units([*healthy(9), configured], range(3, 5))
    assert [case.unit for case in cases] == [3, 4, 3, 4, 3, 4, 3, 4, 3, 0]
    files, by_test = write_suites(cases, tmp_path)
    assert len(files) == 3
    assert read_suites(tmp_path, [*healthy(9), configured]) == by_test
    assert sorted(case.name for case in by_test.values()) == sorted(case.name for case in cases)
    page = write_matrix([JudgedCase(case, Judgement.HEALTHY, "passed", "", 0.0) for case in cases])
    assert "Each on one of the units 0, 3, 4 of the population." in page
    assert page.count("healthy on unit 4") == 4


def result(verdict: Verdict, *failures: str) -> TestResult:
    """Return the result of a test."""
    made = TestResult(TestPlanned(test="s/t", suite="s", name="t"), "t")
    made.verdict = verdict
    made.attempts.append(TestEnded(test="s/t", outcome=verdict, verdict=verdict))
    made.problems = [Message(severity=Severity.FAILURE, title="checks", detail=text, test="s/t") for text in failures]
    return made


@pytest.mark.parametrize(
    ("expectation", "verdict", "failures", "said"),
    [
        (Expectation.FOUND, Verdict.FAILED, ["l_elbow stops early"], Judgement.FOUND),
        (Expectation.FOUND, Verdict.FAILED, ["r_elbow stops early"], Judgement.UNNAMED),
        (Expectation.FOUND, Verdict.PASSED, [], Judgement.MISSED),
        (Expectation.FOUND, Verdict.ERROR, ["l_elbow is gone"], Judgement.NOT_TESTED),
        (Expectation.SILENT, Verdict.PASSED, [], Judgement.SILENT),
        (Expectation.SILENT, Verdict.FAILED, ["l_elbow"], Judgement.ALARM),
        (Expectation.SILENT, Verdict.ERROR, ["l_elbow"], Judgement.ALARM),
        (Expectation.HEALTHY, Verdict.PASSED, [], Judgement.HEALTHY),
        (Expectation.HEALTHY, Verdict.FAILED, ["l_elbow"], Judgement.ALARM),
        (Expectation.EXPECTED, Verdict.ERROR, [], Judgement.EXPECTED),
        (Expectation.EXPECTED, Verdict.PASSED, [], Judgement.MISSED),
        (Expectation.HEALTHY, Verdict.SKIPPED, [], Judgement.NOT_TESTED),
        (Expectation.FOUND, Verdict.FIXTURE_LOST, ["l_elbow"], Judgement.NOT_TESTED),
    ],
)
def test_the_judgement_of_a_case(expectation: Expectation, verdict: Verdict, failures: list[str], said: Judgement):
    """Found if it failed and named the joint, silent if it passed; neither if it was not run."""
    case = Case("JointLimits", expectation, "jam", "l_elbow", names="l_elbow")
    assert judge(case, result(verdict, *failures)).judgement is said
    assert judge(case, None).judgement is Judgement.NOT_TESTED


@pytest.mark.parametrize(
    ("fault", "subject", "said"),
    [
        ("motors_swapped", "torso_roll", Judgement.FOUND),
        ("motors_swapped", "torso_pitch", Judgement.FOUND),
        ("motors_swapped", "torso_yaw", Judgement.UNNAMED),
        ("motors_swapped", "", Judgement.FOUND),
        ("motor_dead", "torso_pitch", Judgement.UNNAMED),
        ("motor_dead", "", Judgement.UNNAMED),
    ],
)
def test_a_fault_that_exchanges_two_is_found_at_either(fault: str, subject: str, said: Judgement):
    """Both are faulty; any other fault is that of its target."""
    case = Case("MotorTest", Expectation.FOUND, fault, "torso_roll", {"by": 1.0}, names="torso_roll")
    found = result(Verdict.FAILED, "torso_pitch is beyond its limits" if not subject else "it does not move")
    found.problems = [replace(found.problems[0], subject=subject)]
    assert judge(case, found).judgement is said


@pytest.mark.parametrize(
    ("names", "subject", "detail", "said"),
    [
        ("l_knee", "l_hip_pitch", "l_knee turns at 153 deg/s, too fast", Judgement.UNNAMED),
        ("l_knee", "l_knee single", "it stops early", Judgement.FOUND),
        ("l_knee", "", "l_knee draws 20 A, too much", Judgement.FOUND),
        ("l_knee", "left_leg", "l_knee does not move", Judgement.FOUND),
        ("/icubSim/left_leg/analog:o", "l_knee", "states of /icubSim/left_leg/analog:o came late", Judgement.FOUND),
    ],
)
def test_a_joint_is_found_only_by_its_own_failure(names: str, subject: str, detail: str, said: Judgement):
    """Not by being mentioned in that of another joint, but by one of its part or of a port."""
    found = result(Verdict.FAILED, detail)
    found.problems = [replace(problem, subject=subject) for problem in found.problems]
    case = Case("JointLimits", Expectation.FOUND, "motor_dead", names, names=names)
    assert judge(case, found).judgement is said


def test_the_matrix_shows_claims_that_do_not_hold():
    """A fault that no test finds is marked, and a cell cannot break the table."""
    case = Case("JointLimits", Expectation.FOUND, "jam", "l_elbow", {"torque": 400.0})
    page = write_matrix([JudgedCase(case, Judgement.MISSED, "passed", "a | b\nc", 1.0)])
    assert "0 of 1 claims hold" in page
    assert "| jam | plant | **nothing** |" in page
    assert "| JointLimits | jam | l_elbow | torque 400 Nm | **missed** | a \\| b c |" in page


@pytest.mark.parametrize(
    ("case", "severity"),
    [
        (Case("JointLimits", Expectation.FOUND, "backlash", "l_elbow"), "play 3 deg"),
        (Case("JointLimits", Expectation.FOUND, "ft_bias", "x", {"force": 2.5}), "force 2.5 N, torque 0 Nm"),
        (
            Case("JointLimits", Expectation.FOUND, "jam", "x", delay=0.5, duration=2.0),
            "torque 400 Nm, after 0.5 s, for 2 s",
        ),
        (Case("JointLimits", Expectation.HEALTHY), ""),
    ],
)
def test_the_matrix_has_the_severity_of_a_fault(case: Case, severity: str):
    """Also if the claim does not change the default values."""
    assert f" | {severity} | found | " in write_matrix([JudgedCase(case, Judgement.FOUND, "failed", "", 0.0)])


def test_every_shipped_claim_can_be_tried():
    """All claims are valid, every test has a healthy case, and every permanent fault is claimed."""
    files = sorted((shipped_folder("test") / "claims").glob("*.toml"))
    cases = [case for file in files for case in cases_of(read_claims(file))]
    assert len({case.name for case in cases}) == len(cases)
    assert sum(case.expectation is Expectation.HEALTHY for case in cases) == len(files)
    page = write_matrix([JudgedCase(case, Judgement.FOUND, "failed", "", 0.0) for case in cases if case.fault])
    assert "**nothing**" not in page


def test_a_part_of_the_proof_can_be_selected(tmp_path: Path):
    """The cases of one test with one fault; test_proof_fast.py runs such cases."""
    words = ["proof", "--list", "--test", "SensorsDuplicateReadings", "--fault", "duplicate"]
    command = [sys.executable, "-m", "rtf", *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    *cases, count = done.stdout.splitlines()
    assert count == f"{len(cases)} cases"
    assert cases
    assert all(case.split()[:4] == ["found", "SensorsDuplicateReadings", "on", "duplicate"] for case in cases)


def test_a_proof_on_units_says_which_case_is_of_which(tmp_path: Path):
    """Units are given as a range; anything else is refused."""
    proof = [sys.executable, "-m", "rtf", "proof", "--list", "--test", "SensorsDuplicateReadings", "--units"]
    done = subprocess.run([*proof, "7-8"], capture_output=True, text=True, timeout=100, cwd=tmp_path, check=False)
    cases = done.stdout.splitlines()[:-1]
    assert [line.rpartition(" on ")[2] for line in cases] == [f"unit {7 + n % 2}" for n in range(len(cases))]
    for text in ("8-7", "-7", "7-", "1-2-3", "seven"):
        command = [*proof[:-1], f"--units={text}"]
        wrong = subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=tmp_path, check=False)
        assert wrong.returncode == 4
        assert f"--units: {text!r} is no range of units" in wrong.stderr


def test_an_empty_proof_is_refused(tmp_path: Path):
    """The files of an earlier proof are kept."""
    kept = tmp_path / "rtf-runs" / "proof" / "run"
    kept.mkdir(parents=True)
    command = [sys.executable, "-m", "rtf", "proof"]
    for words, said in (
        (["--test", "JointLimit"], "there is no claim of a test 'JointLimit'; did you mean JointLimits?"),
        (["--test", "JointLimit", "--list"], "there is no claim of a test 'JointLimit'; did you mean JointLimits?"),
        (["--test", "JointLimits", "--fault", "rust"], "there is no case of JointLimits with rust"),
    ):
        done = subprocess.run(
            [*command, *words], capture_output=True, text=True, timeout=100, cwd=tmp_path, check=False
        )
        assert (done.returncode, done.stderr) == (4, f"rtf proof: {said}\n")
    assert kept.exists()
