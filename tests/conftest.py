"""What holds for all tests of the project."""

from __future__ import annotations

import signal
import zlib
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes says how busy the machine is, and nothing about what is tested.
settings.register_profile("project", deadline=None)
settings.load_profile("project")

# A shell has what it runs in the background ignore SIGINT, and so would all programs that are started and interrupted
# here.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

_HERE = Path(__file__).parent
#: The files that take longest, the longest first: begun at the end, one of them would have all other processes wait.
_LONGEST = (
    "robot_testing/test_proof_fast.py",
    "torture/test_kill.py",
    "docs/test_snippets.py",
    "torture/test_hostile.py",
    "cli/test_demo.py",
    "browser/test_for_everybody.py",
    "browser/test_live_page.py",
    "page/test_live_run.py",
    "icub_tests/test_stimuli.py",
    "icub_tests/test_torque_tests.py",
    "browser/test_hostile_texts.py",
    "simulator/test_part.py",
    "cli/test_robotinterface.py",
    "icub_tests/test_step_tests.py",
    "fixtures/test_simulator.py",
    "simulator/test_program.py",
    "browser/test_archived_page.py",
    "simulator/test_boards.py",
    "benchmarks/test_browser_benchmarks.py",
)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where several processes share the tests, file by file, put the files into the order in which they are begun."""
    if hasattr(config, "workerinput"):
        items.sort(key=_turn)


def _turn(item: pytest.Item) -> tuple[int, int, str]:
    """The longest first. The others mixed, the same in each process: what computes runs beside what waits."""
    file = item.path.relative_to(_HERE).as_posix()
    longest = _LONGEST.index(file) if file in _LONGEST else len(_LONGEST)
    return longest, zlib.crc32(file.encode()), file
