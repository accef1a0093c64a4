"""What holds for all tests of the project."""

from __future__ import annotations

import gc
import os
import signal
import zlib
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes says how busy the machine is, and nothing about what is tested. Each run has other examples;
# at night, with the long tests, each property has ten times as many.
settings.register_profile("project", deadline=None, max_examples=25)
settings.register_profile("night", deadline=None, max_examples=250)
settings.load_profile("project")

# Ten thousand tests are many objects, and none of them is garbage: searching them takes a third of the collection.
gc.disable()

# The library behind numpy would start a thread for each core in each of thousands of programs, none of which has
# matrices large enough for two.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell has what it runs in the background ignore SIGINT, and nohup SIGHUP; so would all programs that are started and
# stopped here.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

_HERE = Path(__file__).parent
#: The files that take longest: begun at the end, one of them would have all other processes wait. Nearly the longest
#: first, though by turns one that computes and one that waits, for many that wait at once would leave the cores idle.
_LONGEST = (
    "docs/test_snippets.py",
    "testing/supervision/test_supervisor.py",
    "cli/test_testrunner.py",
    "torture/test_hostile.py",
    "icub_tests/test_torque_tests.py",
    "browser/test_for_everybody.py",
    "cli/test_demo.py",
    "browser/test_live_page.py",
    "fixtures/test_robot.py",
    "page/test_live_run.py",
    "icub_tests/test_moving_joints.py",
    "torture/test_kill.py",
    "cli/test_robot.py",
    "icub_tests/test_real_boards.py",
    "icub_tests/test_optical_encoders_consistency.py",
    "middleware/test_schedules.py",
    "icub_tests/test_camera_test.py",
    "testing/test_lifecycle.py",
    "cli/test_commands.py",
    "icub_tests/test_gaze_control.py",
    "simulator/test_program.py",
    "browser/test_applications_page.py",
    "simulator/test_part.py",
    "browser/test_campaign_page.py",
    "robot_testing/guard/test_contacts.py",
    "browser/test_log_page.py",
    "icub_tests/test_optical_encoders_drift.py",
    "browser/test_archived_page.py",
    "robot_testing/proof/test_proof_fast.py",
    "pytest_plugin/test_collecting.py",
    "icub_tests/test_motor_encoders_sign_check.py",
    "fixtures/test_simulator.py",
    "icub_tests/test_step_tests.py",
    "testing/test_interrupts.py",
    "simulator/test_faults.py",
    "middleware/test_hostile_peers.py",
    "testing/test_cases.py",
    "cli/test_robotinterface.py",
    "pytest_plugin/test_running.py",
    "robot/gaze/test_controller.py",
    "red_ball/test_demo.py",
    "fixtures/test_yarpserver.py",
)


#: Files and folders of tests that repeat at length what others show, or that try the scripts of measurements.
_LONG = (
    "benchmarks/",
    "icub_tests/test_demo_red_ball.py",
    "icub_tests/test_same_seed.py",
    "icub_tests/test_stimuli.py",
    "icub_tests/test_upstream_red_ball.py",
    "icub_tests/test_yarp_4.py",
    "ros2/test_battery.py",
    "torture/test_alone.py",
    "torture/test_campaign_kills.py",
    "torture/test_can_battery.py",
    "torture/test_can_drives.py",
    "torture/test_can_frames.py",
    "torture/test_healthy_batteries.py",
    "torture/test_many_nodes.py",
    "torture/test_robot_lost.py",
)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the long ones. Where several processes share the tests, file by file, put the files into an order."""
    for item in items:
        if item.path.relative_to(_HERE).as_posix().startswith(_LONG):
            item.add_marker(pytest.mark.long)
    if hasattr(config, "workerinput"):
        items.sort(key=_turn)


def pytest_collection_finish() -> None:
    """From here on, search for garbage among what the tests make."""
    gc.freeze()
    gc.enable()


def _turn(item: pytest.Item) -> tuple[int, int, str]:
    """The longest first. The others mixed, the same in each process: what computes runs beside what waits."""
    file = item.path.relative_to(_HERE).as_posix()
    longest = _LONGEST.index(file) if file in _LONGEST else len(_LONGEST)
    return longest, zlib.crc32(file.encode()), file
