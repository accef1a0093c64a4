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
#: The files that take longest, the longest first: begun at the end, one of them would have all other processes wait.
_LONGEST = (
    "docs/test_snippets.py",
    "testing/supervision/test_supervisor.py",
    "browser/test_for_everybody.py",
    "torture/test_kill.py",
    "icub_tests/test_real_boards.py",
    "torture/test_hostile.py",
    "cli/test_testrunner.py",
    "robot_testing/proof/test_proof_fast.py",
    "fixtures/test_robot.py",
    "browser/test_live_page.py",
    "testing/test_lifecycle.py",
    "cli/test_demo.py",
    "pytest_plugin/test_xdist.py",
    "cli/test_robot.py",
    "testing/test_interrupts.py",
    "browser/test_archived_page.py",
    "cli/test_robotinterface.py",
    "testing/test_cases.py",
    "fixtures/test_robotinterface.py",
    "fixtures/test_yarpserver.py",
    "icub_tests/test_camera_test.py",
    "icub_tests/test_torque_tests.py",
    "simulator/test_part.py",
    "simulator/test_program.py",
    "icub_tests/test_moving_joints.py",
    "browser/test_hostile_texts.py",
    "fixtures/test_simulator.py",
    "cli/network/test_talking.py",
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
