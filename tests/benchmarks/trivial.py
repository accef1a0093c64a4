"""Many trivial tests, each in a process of its own, against pytest in one process and against ``pytest --forked``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from measuring import PYTEST, TESTRUNNER, TRIVIAL, Benchmark, Command, suite_of

if TYPE_CHECKING:
    from pathlib import Path


#: The same test as a script of the C++ framework.
SCRIPT = """
import robottestingframework

class TestCase:
    def setup(self, param):
        return True

    def run(self):
        robottestingframework.testCheck(True, "holds")
"""


def benchmark(count: int) -> Benchmark:
    """The benchmark with so many tests."""

    def prepare(folder: Path) -> None:
        (folder / "trivial.py").write_text(TRIVIAL)
        (folder / "suite.xml").write_text(suite_of(count, "trivial.py"))
        (folder / "script.py").write_text(SCRIPT)
        (folder / "scripts.xml").write_text(suite_of(count, "script.py"))
        (folder / "test_trivial.py").write_text(
            f"import pytest\n@pytest.mark.parametrize('i', range({count}))\ndef test_trivial(i):\n    assert True\n"
        )
        (folder / "pytest.ini").write_text("[pytest]\n")  # nothing of ours

    run = (*TESTRUNNER, "--suite", "suite.xml", "--quiet")
    scripts = (*TESTRUNNER, "--suite", "scripts.xml", "--quiet")
    return Benchmark(
        f"{count} trivial tests",
        [
            Command("pytest, in one process", (*PYTEST, "test_trivial.py")),
            # pytest-forked 1.7.5 runs each test in its process, but cannot report it to pytest 9
            Command(
                "pytest --forked", (*PYTEST, "--forked", "test_trivial.py"), "pytest, in one process", may_fail=True
            ),
            Command("testrunner, a process per test", run, "pytest, in one process", limit="goal: 2.5"),
            Command("testrunner, scripts of the C++ framework", scripts, "pytest, in one process", limit="goal: 2.5"),
            Command("testrunner --isolation suite", (*run, "--isolation", "suite"), "pytest, in one process"),
        ],
        prepare,
    )
