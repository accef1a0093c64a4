"""The command ``testrunner``, each call in a process."""

from __future__ import annotations

import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from lxml import etree

from harness import Command, run_command, write_files
from rtf.cli.arguments import build_parser
from rtf.testing import journal
from rtf.testing.events import RunStarted, TestStarted
from rtf.testing.verdict import ExitCode, Verdict
from waiting import eventually

FINE = """
from rtf.testing import TestCase, Parameter
class Fine(TestCase):
    "Always passes."
    tags = ("quick",)
    level = Parameter(int, "a level", default=1, low=0, high=9)
    def run(self):
        self.check(True, f"level {self.level}")
"""
BAD = """
from rtf.testing import TestCase
class Bad(TestCase):
    "Always fails."
    def run(self):
        self.check(False, "this is wrong")
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two plug-ins and a suite of both."""
    write_files(
        tmp_path,
        {
            "fine__py": FINE,
            "bad__py": BAD,
            "both__xml": '<suite name="both"><test tags="one"> fine.py </test><test> bad.py </test></suite>',
            "fine__xml": '<suite name="good"><test> fine.py </test></suite>',
        },
    )
    return tmp_path


def test_every_flag_of_the_cpp_framework_is_known():
    """Every option of the C++ framework's runner is known, so that scripts keep working."""
    known = {name for action in build_parser()._actions for name in action.option_strings}
    cpp_framework = (
        "-t --test --tests -s --suite --suites -r --recursive -p --param -e --environment --repetition -o --output "
        "--output-type --no-output --no-summary -w --web-reporter --web-port -d --detail -v --verbose --version -? "
        "--help"
    )
    assert set(cpp_framework.split()) <= known


def test_help_teaches_and_is_no_error(folder: Path):
    """Help goes to standard output, names the exit codes, and exits with 0."""
    done = run_command(folder, "--help")
    assert done.exit_code == 0
    assert "exit codes" in done.stdout
    assert not done.stderr


def test_without_a_selection_help_is_shown_and_it_is_an_error(folder: Path):
    """Without a selection the command prints its help, and ends with 4."""
    done = run_command(folder)
    assert done.exit_code == ExitCode.USAGE
    assert "usage: testrunner" in done.stdout
    assert "  describe [NAME] " in done.stdout


def test_a_list_of_nothing_says_what_lists_all(folder: Path):
    """``--list`` without a selection is wrong usage, with a hint to ``describe``."""
    done = run_command(folder, "--list")
    assert done.exit_code == ExitCode.USAGE
    assert "'testrunner describe' says which tests there are" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--siute", "x.xml"], "did you mean --suite"),
        (["both.xnl"], "there is no file or folder 'both.xnl'; did you mean both.xml?"),
        (["fine.xml", "Elbow"], "a test is named by --test, or by its file"),
        (["fine.xml", "Fine.py"], "did you mean fine.py?"),
        (["fine.xml", "-q", "descrbe"], "did you mean describe?"),
        (["fine.xml", "lost.py::Class"], "there is no file or folder"),
        (["empty"], "the folder empty has neither suites nor tests in it"),
        (["-s", "fine.xml", "--timeout", "never"], "is no duration"),
        (["-s", "fine.xml", "--repetition", "-2"], "must not be negative"),
        (["-s", "fine.xml", "--set", "level"], "key=value"),
        (["-s", "fine.xml", "-k", "left and"], "column"),
        (["-s", "missing.xml"], "missing.xml"),
        (["-s", "fine.xml", "--junit", "/proc/no/x.xml"], "/proc/no"),
        (["-s", "fine.xml", "--report", "nonesuch"], "no report plug-in 'nonesuch'"),
        (["--suites", "nowhere"], "no folder"),
        (["-s", "fine.xml", "--last-failed"], "no earlier run"),
        ([""], "an empty word names no test, suite or folder"),
        (["fine.xml", "-t", ""], "an empty word names no test, suite or folder"),
        (["fine.xml", "-p", "--level 3"], "--param is for tests that the command line names"),
        (["fine.xml", "-e", "--robotname icub"], "--environment is for tests that the command line names"),
        (["fine.xml", "--type", "gtest"], "--type is for tests that the command line names"),
    ],
)
def test_wrong_usage_is_reported_before_anything_runs(folder: Path, arguments: list[str], said: str):
    """Wrong usage ends with 4 and a message, and no run begins."""
    (folder / "empty").mkdir()
    done = run_command(folder, *arguments)
    assert done.exit_code == ExitCode.USAGE
    assert said in done.stderr
    assert not done.events


def test_passing_and_failing_runs(folder: Path):
    """The exit codes are 0 and 1, and the last line has the verdict."""
    good = run_command(folder, "-s", "fine.xml")
    assert good.exit_code == ExitCode.PASSED
    assert good.stdout.rstrip().splitlines()[-1].startswith("PASSED  1 passed")
    both = run_command(folder, "-s", "both.xml")
    assert both.exit_code == ExitCode.FAILURES
    assert both.stdout.rstrip().splitlines()[-1].startswith("FAILED")
    assert (both.verdict("fine"), both.verdict("bad")) == (Verdict.PASSED, Verdict.FAILED)


def test_the_dialect_reaches_the_tests(folder: Path):
    """``--dialect`` is the dialect of the tests' ports, and an unknown one is wrong usage."""
    write_files(
        folder,
        {
            "asks__py": """
from rtf.middleware.naming.configuration import find_dialect
from rtf.testing import TestCase
class Asks(TestCase):
    def run(self):
        self.check(find_dialect() == 4, f"the dialect is {find_dialect()}")
"""
        },
    )
    assert run_command(folder, "asks.py", "--dialect", "4").exit_code == ExitCode.PASSED
    assert run_command(folder, "asks.py", "--dialect", "3").exit_code == ExitCode.FAILURES
    assert run_command(folder, "asks.py", "--dialect", "5").exit_code == ExitCode.USAGE


def test_a_plugin_that_is_missing_is_a_failed_entry(folder: Path):
    """A missing plug-in is an error in the results, unlike in the C++ framework, which omits it."""
    (folder / "x.xml").write_text('<suite name="x"><test>Nonesuch</test><test>fine.py</test></suite>')
    done = run_command(folder, "-s", "x.xml", "--junit", "out.xml")
    assert done.exit_code == ExitCode.FAILURES
    assert done.verdict("Nonesuch") is Verdict.ERROR
    assert "tried" in done.detail("Nonesuch")
    assert "Nonesuch" in (folder / "out.xml").read_text()


def test_an_empty_run_is_not_a_success(folder: Path):
    """A run without tests has its own exit code, unless ``--allow-empty`` is given."""
    (folder / "empty.xml").write_text('<suite name="empty"/>')
    assert run_command(folder, "-s", "empty.xml").exit_code == ExitCode.NOTHING_RAN
    assert run_command(folder, "-s", "empty.xml", "--allow-empty").exit_code == ExitCode.PASSED


def test_a_suite_that_cannot_be_read_whole_is_not_run(folder: Path):
    """All problems of a suite are reported with line and column, and no test runs."""
    (folder / "wrong.xml").write_text('<suite name="w">\n <test retries="-3">fine.py</test>\n <test/>\n</suite>')
    done = run_command(folder, "-s", "wrong.xml")
    assert done.exit_code == ExitCode.USAGE
    assert re.search(r"wrong\.xml:2:\d+: error", done.stderr)
    assert re.search(r"wrong\.xml:3:\d+: error", done.stderr)
    assert not done.events


def test_one_test_with_parameters(folder: Path):
    """``--test`` runs a test with ``--param``, ``--set`` and ``--repetition`` as in the C++ framework."""
    done = run_command(folder, "-t", "fine.py", "-p", "--level 3", "--repetition", "2", "-v")
    assert done.exit_code == ExitCode.PASSED
    assert done.stdout.count("level 3") >= 3
    assert run_command(folder, "-t", "Fine", "--set", "level=12").exit_code == ExitCode.FAILURES


def test_folders_of_tests_and_suites_are_sorted(folder: Path):
    """Files of a folder are sorted by name, and sub-folders are searched with ``-r``."""
    (folder / "sub").mkdir()
    (folder / "sub" / "a.xml").write_text('<suite name="deep"><test>../fine.py</test></suite>')
    (folder / "notes.xml").write_text("<notes/>")
    listed = run_command(folder, "--suites", ".", "-r", "--list")
    assert listed.exit_code == 0
    assert [line.split("  ")[0] for line in listed.stdout.splitlines() if line.endswith(")")] == [
        "both",
        "good",
        "deep",
    ]
    tests = run_command(folder, "--tests", ".", "--list")
    assert re.findall(r"^  \S+/(\w+)", tests.stdout, re.MULTILINE) == ["bad", "fine"]


def test_selection(folder: Path):
    """Tests are selected by name, by tags of suite and author, and by failures of the last run."""
    names = ["-s", "both.xml", "--list"]
    assert "bad" not in run_command(folder, *names, "-k", "fine").stdout
    assert "bad" not in run_command(folder, *names, "--tags", "one").stdout
    assert "bad" not in run_command(folder, *names, "--tags", "quick").stdout
    run_command(folder, "-s", "both.xml")
    again = run_command(folder, "-s", "both.xml", "--last-failed")
    assert [*again.results.tests] == ["both/bad"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-k", "nose"), "none of 1 test is selected by -k 'nose'\n"),
        (("-k", "fine", "--tags", "two"), "none of 1 test is selected by -k 'fine' and --tags 'two'\n"),
    ],
)
def test_what_selected_nothing_is_named(folder: Path, words: tuple[str, ...], said: str):
    """If no test is selected, the message names the options that select none."""
    assert run_command(folder, "-s", "fine.xml", *words, "--list").stderr == f"testrunner: {said}"


def test_a_last_run_without_failures_is_named(folder: Path):
    """If nothing failed in the last run, the message names its folder."""
    last = run_command(folder, "-s", "fine.xml").folder.resolve()
    done = run_command(folder, "-s", "both.xml", "--last-failed")
    assert f"none of 2 tests is selected by --last-failed (what did not pass in {last})" in done.stderr


def test_a_list_reports_what_is_not_found(folder: Path):
    """``--list`` reports each missing test and fixture, and ends with 4."""
    (folder / "lost.xml").write_text('<suite name="lost"><fixture>proces</fixture><test>Fin</test></suite>')
    done = run_command(folder, "-s", "lost.xml", "--list")
    assert done.exit_code == ExitCode.USAGE
    assert done.stdout.count("NOT FOUND") == 2
    fixture, test = done.stderr.splitlines()
    assert fixture.startswith("lost.xml:1:20: error: no fixture plug-in 'proces'; did you mean ")
    assert test.startswith("lost.xml:1:")
    assert "error: no test plug-in 'Fin'; did you mean Fine" in test


@pytest.mark.parametrize("option", ["--list", "--dry-run"])
def test_what_is_wrong_with_the_command_line_says_so(folder: Path, option: str):
    """A missing test of the command line is reported as such, without a file's name."""
    done = run_command(folder, "--test", "Fin", option)
    assert done.exit_code == ExitCode.USAGE
    assert done.stderr.startswith("command line: error: no test plug-in 'Fin'; did you mean Fine")
    assert done.stderr.count("no test plug-in") == 1


def test_shuffling_is_reproducible(folder: Path):
    """The same seed gives the same order."""
    many = "".join(f'<test name="t{index}">fine.py</test>' for index in range(9))
    (folder / "many.xml").write_text(f'<suite name="many">{many}</suite>')
    first = run_command(folder, "-s", "many.xml", "--list", "--shuffle", "7").stdout
    assert first == run_command(folder, "-s", "many.xml", "--list", "--shuffle", "7").stdout
    assert first != run_command(folder, "-s", "many.xml", "--list").stdout


def test_a_dry_run_finds_what_is_wrong_and_runs_nothing(folder: Path):
    """A dry run loads plug-ins and checks parameters, and runs no test."""
    (folder / "dry.xml").write_text(
        '<suite name="dry"><test param="--level 99">fine.py</test><test>boom.py</test><test>fine.py</test></suite>',
    )
    (folder / "boom.py").write_text("import os\nos._exit(3)\n")
    done = run_command(folder, "-s", "dry.xml", "--dry-run")
    assert done.exit_code == ExitCode.USAGE
    assert "99 is not within [0, 9]" in done.stderr
    assert "exit status 3" in done.stderr
    assert "nothing was run, 2 errors found" in done.stdout
    assert run_command(folder, "-s", "fine.xml", "--dry-run").exit_code == ExitCode.PASSED


def test_the_result_file_is_where_it_was_asked_for(folder: Path):
    """The result is written as ``-o`` and ``--output-type`` say, by default into the run folder."""
    done = run_command(folder, "-s", "fine.xml")
    assert "Number of passed test cases  : 1" in (done.folder / "result.txt").read_text()
    run_command(folder, "-s", "fine.xml", "-o", "mine.txt")
    assert "Test case" in (folder / "mine.txt").read_text()
    run_command(folder, "-s", "fine.xml", "--output-type", "junit", "-o", "mine.xml")
    assert "<testsuites" in (folder / "mine.xml").read_text()
    before = {path.name for path in folder.iterdir()}
    run_command(folder, "-s", "fine.xml", "--no-output")
    assert {path.name for path in folder.iterdir()} == before


def test_classic_style_writes_the_cpp_lines(folder: Path):
    """``--style classic`` prints the lines of the C++ framework."""
    done = run_command(folder, "-s", "both.xml", "--style", "classic", "-v")
    lines = done.stdout.splitlines()
    assert lines[0] == "Starting test runner."
    assert "Test suite both started..." in lines
    assert "[FAIL]  (bad) checks: this is wrong" in lines
    assert "Test case bad failed!" in lines


def test_version(folder: Path):
    """``--version`` prints the version."""
    done = run_command(folder, "--version")
    assert re.fullmatch(r"testrunner version \d+\.\d+\.\d+\n", done.stdout)


def test_run_of_a_suite_that_was_edited_is_resumed(folder: Path):
    """A resumed run of an edited suite runs new and changed tests, and omits removed and finished ones."""
    suite = folder / "edited.xml"
    suite.write_text(
        '<suite name="e"><test name="a">fine.py</test><test name="first">fine.py</test><test>bad.py</test>'
        "<test>fine.py</test><test>fine.py</test></suite>"
    )
    assert run_command(folder, "-s", "edited.xml", "--maxfail", "1").exit_code == ExitCode.FAILURES
    suite.write_text(
        '<suite name="e"><test name="new">fine.py</test><test name="first">fine.py</test>'
        '<test>fine.py</test><test>bad.py</test><test name="a" retries="1">fine.py</test></suite>'
    )
    resumed = run_command(folder, "--resume", "rtf-runs/latest", "--junit", "j.xml")
    assert "added: e/new; removed: e/fine+2; changed: e/a" in resumed.stdout + resumed.stderr
    events = [*journal.read(folder / "rtf-runs" / "latest")]
    second = max(index for index, event in enumerate(events) if isinstance(event, RunStarted))
    assert {event.test for event in events[second:] if isinstance(event, TestStarted)} == {"e/new", "e/fine", "e/a"}
    results = journal.results_of(folder / "rtf-runs" / "latest")
    verdicts = {test.id: test.verdict for test in results.tests.values()}
    assert verdicts.pop("e/bad") is Verdict.FAILED
    assert verdicts == dict.fromkeys(("e/first", "e/new", "e/fine", "e/a"), Verdict.PASSED)
    cases = {case.get("name") for case in etree.parse(folder / "j.xml").iter("testcase")}
    assert cases == {"first", "bad", "new", "fine", "a"}


@pytest.mark.parametrize(
    ("arguments", "named"), [(["both.xml"], "both.xml"), (["-k", "bad"], "-k"), (["-j", "2"], "--jobs")]
)
def test_resumed_run_takes_nothing_that_it_would_not_heed(folder: Path, arguments: list[str], named: str):
    """A resumed run refuses suites, selections and numbers of jobs."""
    run_command(folder, "-s", "fine.xml")
    done = run_command(folder, "--resume", "rtf-runs/latest", *arguments)
    assert done.exit_code == ExitCode.USAGE
    assert f"{named}: a run that is resumed consists of what it was begun with" in done.stderr


def test_suite_that_was_done_before_has_its_time_in_a_resumed_run(folder: Path):
    """A suite without remaining tests keeps its time in a resumed run."""
    slow = FINE.replace("def run(self):", "def run(self):\n        import time; time.sleep(0.2)")
    (folder / "slow.py").write_text(slow)
    (folder / "one.xml").write_text('<suite name="one"><test>slow.py</test></suite>')
    (folder / "two.xml").write_text('<suite name="two"><test>bad.py</test><test>fine.py</test></suite>')
    run_command(folder, "-s", "one.xml", "-s", "two.xml", "--maxfail", "1")
    run_command(folder, "--resume", "rtf-runs/latest", "--junit", "j.xml")
    times = {suite.get("name"): float(suite.get("time")) for suite in etree.parse(folder / "j.xml").iter("testsuite")}
    assert times["one"] >= 0.2


def test_what_failed_last_can_be_interrupted_and_resumed(folder: Path):
    """A resumed run has the tests that it was begun with, also those that ``--last-failed`` selected."""
    begun = folder / "begun"
    (folder / "slow.py").write_text(
        FINE.replace(
            "def run(self):", f"def run(self):\n        import time; open({str(begun)!r}, 'w').close(); time.sleep(60)"
        )
    )
    (folder / "mixed.xml").write_text(
        '<suite name="mixed"><test>fine.py</test><test>bad.py</test><test timeout="0.1">slow.py</test></suite>',
    )
    run_command(folder, "-s", "mixed.xml")
    begun.unlink(missing_ok=True)
    run = Command(folder, "-s", "mixed.xml", "--last-failed", "--timeout", "50", "--retries", "2")
    eventually(begun.exists, "it did not come to the slow test")
    run.signal(signal.SIGINT)
    run.signal(signal.SIGTERM)  # two of one kind may become one on their way
    assert run.wait().exit_code == ExitCode.INTERRUPTED
    (folder / "slow.py").write_text(FINE.replace("Fine", "Slow"))
    resumed = run_command(folder, "--resume", "rtf-runs/latest")
    assert set(resumed.results.tests) == {"mixed/bad", "mixed/slow"}
    assert resumed.exit_code == ExitCode.FAILURES


@pytest.mark.parametrize(
    "refused", [("--junit", "/proc/no/x.xml"), ("-k", "nonesuch"), ("-w", "--web-host", "192.0.2.1")]
)
def test_a_run_that_did_not_start_is_not_the_latest(folder: Path, refused: tuple[str, ...]):
    """A run that did not start does not change ``latest``."""
    before = run_command(folder, "-s", "both.xml").folder.resolve()
    assert run_command(folder, "-s", "both.xml", *refused).exit_code in (ExitCode.USAGE, ExitCode.NOTHING_RAN)
    assert (folder / "rtf-runs" / "latest").resolve() == before
    assert [*run_command(folder, "-s", "both.xml", "--last-failed").results.tests] == ["both/bad"]


@pytest.fixture
def steps(folder: Path) -> Path:
    """A suite of four tests; the second and the third fail while a file exists."""
    for name in ("b", "c"):
        (folder / f"{name}.py").write_text(
            f"from pathlib import Path\nfrom rtf.testing import TestCase\nclass {name.upper()}(TestCase):\n"
            f"    def run(self):\n        self.check(not Path({str(folder / name)!r}).exists(), 'is mended')\n"
        )
        (folder / name).touch()
    tests = "".join(f"<test>{name}</test>" for name in ("fine.py", "b.py", "c.py", "bad.py"))
    (folder / "steps.xml").write_text(f'<suite name="steps">{tests}</suite>')
    return folder


def test_stepwise_goes_on_where_it_stopped(steps: Path):
    """``--stepwise`` stops at the first failure, continues there, and begins anew after a good run."""

    def ran() -> list[str]:
        tests = run_command(steps, "-s", "steps.xml", "--stepwise").results.tests.values()
        return [test.name for test in tests if test.verdict is not Verdict.NOT_RUN]

    assert ran() == ["fine", "b"]
    assert ran() == ["b"]
    (steps / "b").unlink()
    assert ran() == ["b", "c"]
    (steps / "c").unlink()
    (steps / "bad.py").write_text((steps / "bad.py").read_text().replace("False", "True"))
    assert ran() == ["c", "bad"]
    assert ran() == ["fine", "b", "c", "bad"]


def test_maxfail_stops_after_so_many(steps: Path):
    """``--maxfail`` stops after this number of failures; ``-x`` means 1."""
    for words, ran in ((("--maxfail", "2"), 3), (("-x",), 2), ((), 4)):
        done = run_command(steps, "-s", "steps.xml", *words)
        assert sum(test.verdict is not Verdict.NOT_RUN for test in done.results.tests.values()) == ran


def test_the_device_is_recorded(folder: Path):
    """The device under test is read from a file and from options, which take precedence."""
    (folder / "device.toml").write_text('serial = "old"\nfirmware = 1.5\n')
    words = ("--device-file", "device.toml", "--device", "serial=A7", "--device", "bench=3")
    (started,) = run_command(folder, "-s", "fine.xml", *words).of(RunStarted)
    assert started.device == {"serial": "A7", "firmware": "1.5", "bench": "3"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--device", "serial"), "not of the form key=value"),
        (("--device", "serial="), "serial: the value must be printable text"),
        (("--device", "a b=1"), "'a b' is no key"),
        (("--device-file", "lost.toml"), "--device-file lost.toml: No such file"),
        (("--device-file", "fine.xml"), "--device-file fine.xml: "),
        (("--device-ask",), "--device-ask needs a terminal"),
    ],
)
def test_a_wrong_record_of_the_device_is_reported(folder: Path, words: tuple[str, ...], said: str):
    """A wrong record of the device is wrong usage."""
    done = run_command(folder, "-s", "fine.xml", *words)
    assert done.exit_code == ExitCode.USAGE
    assert said in done.stderr
    assert not done.events


def test_the_operator_is_asked_for_the_device(folder: Path):
    """``--device-ask`` asks at the terminal for missing properties; Enter omits one."""
    near, far = pty.openpty()
    os.write(near, b"A7\n\n1.5\n\n\n")
    command = [sys.executable, "-m", "rtf.cli.testrunner", "fine.xml", "--device", "batch=9", "--device-ask"]
    command[3:4] = ["-s", "fine.xml"]
    done = subprocess.run(command, cwd=folder, stdin=far, capture_output=True, text=True, timeout=60, check=False)
    os.close(near)
    os.close(far)
    assert "serial number of the device (Enter: not recorded)? " in done.stdout
    started = next(event for event in journal.read(folder / "rtf-runs" / "latest") if isinstance(event, RunStarted))
    assert started.device == {"serial": "A7", "firmware": "1.5", "batch": "9"}


@pytest.mark.parametrize(
    ("words", "ids"),
    [
        (("--suite", "both.xml", "fine.xml"), ["both/fine", "both/bad", "good/fine"]),
        (("both.xml", "fine.xml"), ["both/fine", "both/bad", "good/fine"]),
        (("fine.xml", "-q", "both.xml"), ["good/fine", "both/fine", "both/bad"]),
        (("-s", "fine.xml", "-q", "both.xml"), ["both/fine", "both/bad", "good/fine"]),
        (("fine.xml", "bad.py"), ["test/bad", "good/fine"]),
        (("--test", "bad.py", "fine.py"), ["test/bad", "test/fine"]),
        (("tests", "fine.xml"), ["tests/other", "good/fine"]),
        ((".",), ["both/fine", "both/bad", "good/fine"]),
    ],
    ids=" ".join,
)
def test_every_word_is_run(folder: Path, words: tuple[str, ...], ids: list[str]):
    """Suite files, tests, and folders of both are run as arguments."""
    write_files(folder, {"tests/other__py": FINE})
    done = run_command(folder, *words)
    assert [*done.results.tests] == ids


@pytest.mark.parametrize("command", [[], ["validate"]])
def test_a_variable_that_no_suite_uses_is_reported(tmp_path: Path, command: list[str]):
    """A variable that no suite uses is a warning, with the nearest name."""
    text = '<suite name="s"><test param="--level ${level}">fine.py</test></suite>'
    fine = "from rtf.testing import Parameter, TestCase\nclass Fine(TestCase):\n    level = Parameter(int, 'a level')\n"
    write_files(tmp_path, {"s__xml": text, "fine__py": f"{fine}    def run(self): pass\n"})
    done = run_command(tmp_path, *command, "s.xml", "--define", "level=3", "--define", "levle=4")
    assert done.exit_code == ExitCode.PASSED, done.stderr
    assert "warning: --define levle: no suite has ${levle} in it" in done.stdout + done.stderr
    assert "did you mean 'level'?" in done.stdout + done.stderr
    assert "--define level:" not in done.stdout + done.stderr
