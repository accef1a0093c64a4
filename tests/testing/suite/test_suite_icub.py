"""The iCub's suites of the C++ framework load with their tests, order and parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf.testing.suite.xml import load_suite

if TYPE_CHECKING:
    from collections.abc import Iterable

FOLDER = Path(__file__).parents[2] / "data" / "upstream" / "suites"
PARTS = ("right_arm", "left_arm", "right_leg", "left_leg", "torso", "head")
DRIFT_PARTS = ("left_arm", "right_arm", "left_leg", "right_leg", "torso")


def runs(plugin: str, *files: str) -> list[tuple[str, str]]:
    """Return a test of a plug-in for each parameter file."""
    return [(plugin, f"--from {file}.ini") for file in files]


def per_part(plugin: str, prefix: str, parts: Iterable[str] = PARTS) -> list[tuple[str, str]]:
    """Return a test of a plug-in for each part of the robot."""
    return runs(plugin, *(f"{prefix}_{part}" for part in parts))


CAMERAS = runs("CameraTest", "camera_right", "camera_left")
STREAM = runs("PortsFrequency", "robinterface_stream")
MOTOR_TESTS = runs("MotorTest", "test_motortest_right_arm", "test_motortest_left_arm")
LIMITS = per_part("JointLimits", "joint_limits")
STICTION = per_part("MotorStiction", "motor_stiction")
FACE_HEAD = runs("MotorEncodersConsistency", "motorEncodersConsistency_face", "motorEncodersConsistency_head")
FT = per_part("FtSensorTest", "test_ft", ("left_arm", "left_foot", "left_leg", "right_arm", "right_foot", "right_leg"))
CARTESIAN = [
    (f"CartesianControl{kind}Test", f"--arm-type {arm}")
    for kind in ("SimpleP2pMovement", "ReachingTolerance")
    for arm in ("left", "right")
]
GAZE = [("GazeControlSimpleLookTest", "")]

SUITES = {
    "basics-icubGazeboSim.xml": ("Basic Tests Suite", "--robotname icubSim --context icubGazeboSim", FT),
    "basics-icubSim.xml": ("Basic Tests Suite", "--robotname icubSim", CAMERAS + STREAM),
    "camera-icubSim.xml": (
        "Basic Camera Tests Suite",
        "--robotname icubSim",
        runs("PortsFrequency", "cam_stream") + CAMERAS,
    ),
    "cartesian-control-icubGazeboSim.xml": ("Cartesian Control Tests Suite", "--robotname icubSim", CARTESIAN),
    "gaze-control-icubSim.xml": ("Gaze Control Tests Suite", "--robotname icubSim", GAZE),
    "gaze-control-icubGazeboSim.xml": ("Gaze Control Tests Suite", "--robotname icubSim", GAZE),
    "controlModes.xml": (
        "Control modes Tests Suite",
        "--robotname icub",
        per_part("ControlModes", "controlModes", ("head", "face", "left_leg")),
    ),
    "encoders-icubGazeboSim.xml": (
        "Encoders Test Suite",
        "--robotname icubSim",
        per_part(
            "MotorEncodersConsistency",
            "optical_encoders_consistency",
            ("left_arm", "right_arm", "left_leg", "right_leg", "torso"),
        ),
    ),
    "ftSensorTests.xml": ("ft sensor tests", "--robotname icub", FT),
    "imu.xml": ("IMU sensor test", "--robotname icub --context icub", runs("imu", "test_imu")),
    "imu-icubGazeboSim.xml": ("IMU sensor test", "--robotname icubSim --context icub", runs("imu", "test_imu")),
    "positionDirect-icubSim.xml": (
        "Position Direct Test Suite",
        "--robotname icub",
        runs("PositionDirect.so", "positionDirect"),
    ),
    "streamingChecks.xml": ("robot's stream frequency test", "--robotname icub", STREAM),
    "torqueStiffDampCheck_example.xml": (
        "Motor Control Interfaces Suite",
        "--robotname icub",
        runs("TorqueControlStiffDampCheck", "torque_stiffDampCheck_elbown"),
    ),
    "camera-icub.xml": ("Basic Camera Tests Suite", "--robotname icub", CAMERAS),
    "cartesian-control-icubSim.xml": ("Cartesian Control Tests Suite", "--robotname icubSim", CARTESIAN),
    "demoRedBall-icubSim.xml": (
        "Demo Red Ball Test Suite",
        "--robotname icubSim",
        [("DemoRedBallTest", "--context demoRedBall --from config-test.ini")],
    ),
    "encoders-icub.xml": (
        "Encoders Test Suite",
        "--robotname icub",
        per_part("OpticalEncodersDrift", "optical_encoders_drift", DRIFT_PARTS)
        + per_part("MotorEncodersConsistency", "motorEncoderConsistency", DRIFT_PARTS)
        + FACE_HEAD,
    ),
    "encoders-icubV3.xml": ("Encoders Test Suite", "--robotname icub --context icubV3", FACE_HEAD),
    "encoders-icubSim.xml": (
        "Encoders Test Suite",
        "--robotname icubSim",
        runs("MotorEncodersConsistency", "contexts/icubSim/optical_encoders_consistency_left_arm"),
    ),
    "jointsLimits_robotCan.xml": ("Motor Control Suite", "--robotname icub --context icubCan", LIMITS),
    "jointsLimits_robotEth.xml": ("Motor Control Suite", "--robotname icub --context icubEth", LIMITS),
    "motorControlInterfaces-icub.xml": (
        "Motor Control Interfaces Suite",
        "--robotname icub",
        runs("movementReferencesTest", "motorControlInterf_rightArm", "motorControlInterf_head")
        + per_part("MotorTest", "motortest", ("head", "face", "right_arm", "left_arm"))
        + runs("OpenLoopConsistency", "openloopConsistency_head")
        + runs("OpenloopConsistency", "openLoopConsistency_face", "openLoopConsistency_left_leg"),
    ),
    "motorStiction.xml": (
        "Motor Stiction",
        "--robotname icub",
        per_part("MotorStiction", "motorStiction", (*PARTS, "face")),
    ),
    "motors-icubSim.xml": (
        "Motor Control Suite",
        "--robotname icubSim",
        MOTOR_TESTS + LIMITS + per_part("OpenloopConsistency", "openloop_consistency") + STICTION,
    ),
    "motors-icubGazeboSim.xml": (
        "Motor Control Suite",
        "--robotname icubSim",
        LIMITS + per_part("OpenLoopConsistency", "openloop_consistency") + STICTION,
    ),
    "positionDirect-icub.xml": (
        "Position Direct Test Suite",
        "--robotname icub",
        runs("PositionDirect.so", "positionDirect_head"),
    ),
    "skinWrapper-YarpPluginFixture.xml": ("SkinWrapper Tests Suite", "", [("SkinWrapperTest", "")]),
    "jenkins/basics-icubSim.xml": (
        "Basic Tests Suite",
        "--robotname icubSim",
        CAMERAS + STREAM + MOTOR_TESTS + LIMITS + STICTION,
    ),
    "../example/suit/test_suit.xml": ("Test Suite", "", [("ExampleTest", f"--name Example{n}") for n in range(1, 5)]),
}
DASHES_IN_COMMENTS = {
    "basics-icubGazeboSim.xml",
    "encoders-icubV3.xml",
    "encoders-icubSim.xml",
    "jointsLimits_robotCan.xml",
    "jointsLimits_robotEth.xml",
    "motorStiction.xml",
    "motors-icubGazeboSim.xml",
    "jenkins/basics-icubSim.xml",
}
FIXTURES = {
    "basics-icubGazeboSim.xml": ("yarpmanager", "--fixture icubgazebosim-fixture.xml"),
    "basics-icubSim.xml": ("yarpmanager", "--fixture icubsim-fixture.xml"),
    "camera-icubSim.xml": ("yarpmanager", "--fixture icubsim-fixture.xml"),
    "cartesian-control-icubGazeboSim.xml": ("yarpmanager", "--fixture icubgazebosim-cartesian-control-fixture.xml"),
    "gaze-control-icubSim.xml": ("yarpmanager", "--fixture icubsim-cartesian-control-fixture.xml"),
    "gaze-control-icubGazeboSim.xml": ("yarpmanager", "--fixture icubgazebosim-cartesian-control-fixture.xml"),
    "cartesian-control-icubSim.xml": ("yarpmanager", "--fixture icubsim-cartesian-control-fixture.xml"),
    "demoRedBall-icubSim.xml": ("yarpmanager", "--fixture icubsim-demoRedBall-fixture.xml"),
    "encoders-icubSim.xml": ("yarpmanager", "--fixture icubsim-fixture.xml"),
    "motors-icubSim.xml": ("yarpmanager", "--fixture icubsim-fixture.xml"),
    "motors-icubGazeboSim.xml": ("yarpmanager", "--fixture icubgazebosim-fixture.xml"),
    "jenkins/basics-icubSim.xml": ("yarpmanager", "--fixture icubsim-fixture-jenkins.xml"),
    "skinWrapper-YarpPluginFixture.xml": ("yarpplugin", "--devices fakeAnalogSensor analogServer skinWrapper"),
    "../example/suit/test_suit.xml": ("ExampleFixture", "--probability 0.5"),
}


def test_every_sample_is_listed_here():
    """Every sample is checked."""
    found = {path.relative_to(FOLDER).as_posix() for path in [*FOLDER.glob("*.xml"), *FOLDER.glob("jenkins/*.xml")]}
    assert set(SUITES) == {*found, "../example/suit/test_suit.xml"}


@pytest.mark.parametrize("file", SUITES)
def test_a_suite_in_use_loads_as_it_is(file: str):
    """A suite has its name, environment, fixture, and tests with parameters, in order."""
    name, environment, tests = SUITES[file]
    suite = load_suite(FOLDER / file).suite
    assert name == suite.name
    assert tests == [(test.plugin, test.param) for test in suite.tests]
    assert {environment} == {test.environment for test in suite.tests}
    expected = [FIXTURES[file]] if file in FIXTURES else []
    assert expected == [(fixture.plugin, fixture.param) for fixture in suite.fixtures]


@pytest.mark.parametrize("file", SUITES)
def test_only_the_files_with_dashes_in_comments_are_warned_about(file: str):
    """Only files with double dashes in comments give a warning."""
    messages = [diagnostic.text for diagnostic in load_suite(FOLDER / file).diagnostics]
    assert (file in DASHES_IN_COMMENTS) == (len(messages) == 1)
    assert all("contains '--'" in message for message in messages)


def test_tests_of_one_plugin_are_told_apart_by_their_file():
    """Tests of one plug-in have their parameter file in name and id."""
    suite = load_suite(FOLDER / "jointsLimits_robotCan.xml").suite
    assert [f"JointLimits [joint_limits_{part}]" for part in PARTS] == [test.name for test in suite.tests]
    assert suite.tests[0].id == "motor-control-suite/JointLimits[joint_limits_right_arm]"
