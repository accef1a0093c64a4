"""Tests of reports when their surroundings fail: killed runners, links, devices, full disks, reporters that hang."""

from __future__ import annotations

import json
import os
import re
import signal
import stat
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest
from lxml import etree

from rtf import clock
from rtf.testing.broadcast import Broadcast
from rtf.testing.events import Attached, OutputCaptured, SuiteEnded, TestStarted
from rtf.testing.report.files import Target
from rtf.testing.reporting import Reporter, ReportOptions
from rtf.testing.verdict import Verdict
from tests.archives import blocks
from tests.harness import Command, run_command, write_files
from tests.waiting import eventually

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event
    from rtf.testing.results import RunResult
    from tests.reports.conftest import Reports, Story

PASS = """
from rtf.testing import TestCase

class Pass(TestCase):
    def run(self):
        self.report("x" * 4000)
        self.check(True, "fine")
"""
STUCK = """
import time
from rtf.testing import TestCase

class Stuck(TestCase):
    def run(self): time.sleep(600)
"""
HANGING = """
import time
from rtf.testing import Reporter

class Hanging(Reporter):
    plugin_name = "hanging"
    patience = patience_of_close = 0.2

    def {method}: time.sleep(600)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a suite of ten tests that pass and write much."""
    tests = "".join(f'<test name="t{number}"> ok </test>' for number in range(10))
    write_files(tmp_path, {"ok.py": PASS, "stuck.py": STUCK, "s.xml": f'<suite name="s">{tests}</suite>'})
    return tmp_path


def cases(path: Path) -> dict[str | None, list[str]]:
    """Return the cases of a JUnit file, each with the messages of its errors and failures."""
    found = etree.parse(path).iter("testcase")
    return {case.get("name"): [str(one.get("message")) for one in case.iter("error", "failure")] for case in found}


# Killed --------------------------------------------------------------------------------------------------------------


def test_reports_of_a_killed_runner_are_complete(folder: Path):
    """After SIGKILL each report is valid, has the results so far, and says that the other tests were not run."""
    (folder / "k.xml").write_text(
        '<suite name="k"><test name="a"> ok </test><test name="b"> stuck </test><test name="c"> ok </test></suite>'
    )
    reports = ("--junit", "j.xml", "--json", "j.json", "--ctrf", "c.json", "--html", "p.html", "-o", "r.txt")
    command = Command(folder, "--suite", "k.xml", *reports)
    command.wait_for(lambda events: any(isinstance(event, TestStarted) and event.test == "k/b" for event in events))
    junit, result, ctrf = folder / "j.xml", folder / "j.json", folder / "c.json"
    killed = {"a": [], "b": ["interrupted: the runner was killed while this test was running"]}
    killed |= {"c": ["not run: the runner was killed"], "run": ["the run did not end in order: the runner was killed"]}
    eventually(lambda: junit.exists() and cases(junit) == killed, "JUnit is not up to date")
    eventually(lambda: result.exists() and '"pid"' in result.read_text().split("k/b")[-1], "JSON is not up to date")
    eventually(lambda: ctrf.exists() and '"rawStatus":"passed"' in ctrf.read_text(), "CTRF is not up to date")
    eventually((folder / "p.html").exists, "there is no page")
    command.signal(signal.SIGKILL)
    command.process.communicate()
    assert cases(junit) == killed
    (suite,) = json.loads(result.read_bytes())["suites"]
    assert [test["verdict"] for test in suite["tests"]] == ["passed", "not run", "not run"]
    statuses = [test["status"] for test in json.loads(ctrf.read_bytes())["results"]["tests"]]
    assert statuses[:3] == ["passed", "pending", "pending"]
    assert "Test case a passed!" in (folder / "r.txt").read_text()
    assert blocks((folder / "p.html").read_bytes())


# Links, devices, pipes -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["junit", "json", "ctrf", "text"])
def test_a_report_goes_through_a_link(story: Story, reports: Reports, name: str):
    """A report whose target is a link replaces the file that the link names; the link stays."""
    place = reports.folder / "elsewhere" / "report"
    place.parent.mkdir()
    link = reports.folder / "link"
    link.symlink_to(place)
    reports(name, story.begin(("arm", 1)).start("arm").test("arm/t1").end("arm").finish(), target=link)
    assert link.is_symlink()
    assert place.stat().st_size > 0
    assert {path.name for path in reports.folder.iterdir()} == {"elsewhere", "link"}


@pytest.mark.parametrize("place", ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
def test_a_report_is_written_to_standard_output(folder: Path, place: str):
    """A report to standard output is written once, and creates no file."""
    made = run_command(folder, "--suite", "s.xml", "-q", "--junit", place)
    assert made.exit_code == 0
    assert made.stdout.count("<testsuites ") == made.stdout.count("</testsuites>") == 1
    assert not (folder / "-").exists()


def test_devices_and_pipes_stay_what_they_are(story: Story, reports: Reports):
    """A device is not replaced by a file, and the reader of a FIFO gets the report."""
    link = reports.folder / "null"
    link.symlink_to(os.devnull)
    story.begin(("arm", 1)).start("arm").test("arm/t1").end("arm").finish()
    reports("junit", story, target=link)
    assert stat.S_ISCHR(link.stat().st_mode)
    pipe = reports.folder / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    reports("junit", story, target=pipe)
    reader.join(10)
    assert read[0].endswith("</testsuites>\n")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert not Target(pipe).replaceable


# Marks ---------------------------------------------------------------------------------------------------------------


def test_only_our_own_marks_reach_jenkins(story: Story, reports: Reports):
    """A program that prints Jenkins' mark of an attachment does not have a file of the machine attached."""
    evil = "[[ATTACHMENT|/etc/passwd]]"
    said = [
        OutputCaptured(stream="stdout", text=f"x {evil}\n[", test="arm/t1"),
        OutputCaptured(stream="stdout", text="[attachment|/etc/shadow]]\n", test="arm/t1"),
        OutputCaptured(stream="stderr", text=f"{evil}\n[[PROPERTY|verdict=passed]]\n", test="arm/t1"),
        Attached(test="arm/t1", name="log", path="files/log"),
        Attached(test="arm/t1", name="log", path=f"files/x\n{evil}"),
    ]
    story.begin(("arm", 1)).start("arm").test("arm/t1", Verdict.PASSED, *said).incident("arm", "sim", output=evil)
    text = reports("junit", story.end("arm").finish()).read_text()
    root = etree.fromstring(text.encode())
    outputs = [one.text or "" for one in root.iter("system-out", "system-err")]
    marks = [mark for one in outputs for mark in re.findall(r"\[\[ATTACHMENT\|.+\]\]", one, re.IGNORECASE)]
    assert [mark.endswith("/files/log]]") for mark in marks] == [True]
    assert "[ [ATTACHMENT|/etc/passwd]]" in text


# No room -------------------------------------------------------------------------------------------------------------


def test_a_full_disk_is_reported_once_and_the_list_of_reports_is_true(folder: Path):
    """A full disk is one internal error with a hint and no traceback; the list of reports marks the incomplete ones."""
    reports = ("--junit", "j.xml", "--json", "j.json", "--ctrf", "c.json")
    command = [sys.executable, "-m", "rtf.cli.testrunner", "--suite", "s.xml", *reports]
    script = 'ulimit -f 16; exec "$@"'
    made = subprocess.run(
        ["bash", "-c", script, "bash", *command], check=False, cwd=folder, capture_output=True, text=True
    )
    assert made.returncode == 3, made.stdout
    said = made.stdout + made.stderr
    assert "Traceback" not in said
    assert len(re.findall("internal error", said)) == 1, said
    assert "ulimit -f" in said
    listed = {line.split()[0]: line for line in made.stdout.partition("\nReports\n")[2].splitlines() if line.strip()}
    for name in ("j.xml", "j.json"):
        assert "is not complete: File too large" in listed[name]
    assert listed["c.json"].strip() == "c.json"
    assert len(json.loads((folder / "c.json").read_bytes())["results"]["tests"]) == 11


def test_too_few_open_files_are_reported_in_one_line(folder: Path):
    """A limit of open files that is too low is one line that names ``ulimit -n``, before the run begins."""
    command = [sys.executable, "-m", "rtf.cli.testrunner", "--suite", "s.xml", "-q", "-j", "4"]
    script = 'ulimit -n 40; exec "$@"'
    made = subprocess.run(
        ["bash", "-c", script, "bash", *command], check=False, cwd=folder, capture_output=True, text=True
    )
    assert made.returncode != 0
    (line,) = (made.stdout + made.stderr).splitlines()
    assert "ulimit -n" in line


# Reporters that hang -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "code"),
    [
        ("open(self)", 4),
        ("handle(self, event, results)", 3),
        ("update(self, results)", 3),
        ("close(self, results)", 3),
        ("linger(self, stop)", 3),
    ],
)
def test_a_reporter_that_hangs_is_named_and_left_behind(folder: Path, method: str, code: int):
    """A reporter that hangs is named and left out, other reports are complete, and the exit code says so."""
    (folder / "hanging.py").write_text(HANGING.format(method=method))
    words = ("--suite", "s.xml", "--report", "hanging", "--junit", "j.xml")
    made = run_command(folder, *words, RTF_PLUGIN_PATH=str(folder))
    assert made.exit_code == code, made.stderr
    assert re.search(r"report(er)? hanging.*(open|handle|update|close|linger)\(\) did not return within", made.stderr)
    if code == 3:
        errors = {name: messages for name, messages in cases(folder / "j.xml").items() if messages}
        assert [*errors] == ([] if "linger" in method else ["run: internal error"])


@pytest.mark.parametrize("signals", [1, 4])
def test_a_report_that_cannot_be_closed_holds_up_no_interrupt(folder: Path, signals: int):
    """Ctrl-C ends a run within seconds while a reporter hangs, and the other reports are complete."""
    hanging = HANGING.format(method="close(self, results)").replace("0.2", "600.0")
    (folder / "hanging.py").write_text(hanging.replace("time.sleep", "open('closing', 'w').close(); time.sleep"))
    words = ("--suite", "s.xml", "--report", "hanging", "--junit", "j.xml")
    command = Command(folder, *words, RTF_PLUGIN_PATH=str(folder))
    command.wait_for(lambda _: (folder / "closing").exists())  # one that is told to stop before this waits longer
    began = clock.monotonic()
    for _ in range(signals):
        command.signal(signal.SIGINT)
    made = command.wait(10)
    assert clock.monotonic() - began < 8
    assert made.exit_code == 3
    assert "reporter hanging broke and is left out: TimeoutError: close() did not return within 1 s" in made.stderr
    found = cases(folder / "j.xml")
    assert len(found) == 11
    assert "reporter hanging broke" in found["run: internal error"][0]


def test_a_reporter_that_leaves_by_an_exit_is_left_out(story: Story, tmp_path: Path):
    """A reporter that calls ``sys.exit`` is left out; the others get every event, in order."""

    class Leaving(Reporter):
        plugin_name = "leaving"

        def handle(self, event: Event, results: RunResult) -> None:
            if isinstance(event, SuiteEnded):
                sys.exit(5)

    class Counting(Reporter):
        def open(self) -> None:
            self.heard: list[int] = []

        def handle(self, event: Event, results: RunResult) -> None:
            self.heard.append(event.seq)

    counting = Counting(ReportOptions(None, tmp_path))
    counting.open()
    broadcast = Broadcast(None, [Leaving(ReportOptions(None, tmp_path)), counting])
    for event in story.begin(("arm", 1)).start("arm").test("arm/t1").end("arm").finish().events:
        broadcast.emit(event)
    broadcast.close()
    assert [error.text for error in broadcast.results.internal_errors] == [
        "reporter leaving broke and is left out: SystemExit: 5"
    ]
    assert counting.heard == [*range(1, len(story.events) + 2)]
