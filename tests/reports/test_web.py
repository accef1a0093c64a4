"""Tests of the live page's reporter: its address, its errors before a run, and what a run does not load."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from harness import run_command, write_files
from live_page import LiveRun
from rtf.testing.events import TestStarted
from rtf.testing.verdict import ExitCode

FINE = """
from rtf.testing import TestCase

class Fine(TestCase):
    def run(self):
        self.measure("voltage", 23.9, "V", low=23.5, high=24.5)
"""
ASKING = """
from rtf.testing import TestCase

class Asking(TestCase):
    def run(self):
        self.measure("voltage", 24.1, "V", low=23.5, high=24.5)
        self.check(self.confirm("go on?", timeout=60), "went on")
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a suite that passes and one that asks a question."""
    xml = '<suite name="s"><test name="t">{}</test></suite>'
    write_files(
        tmp_path,
        {
            "fine__py": FINE,
            "asking__py": ASKING,
            "fine__xml": xml.format("fine.py"),
            "asking__xml": xml.format("asking.py"),
        },
    )
    return tmp_path


def go_on(run: LiveRun, *, resumed: bool = False) -> None:
    """Answer the question of the run, and wait for its end. In one that is resumed, questions of before come first."""
    with run.page.follow() as stream:
        if resumed:
            stream.until(resumed=True)
        stream.until(event="asked")
        assert run.page.control("answer", test="s/t", question="s/t#1", answer="yes").status == 202
        stream.until_end()


def test_a_busy_port_is_an_error_before_the_run(folder: Path):
    """A port in use is a usage error that names the port and a hint, before any test runs."""
    with socket.create_server(("127.0.0.1", 0)) as busy:
        port = busy.getsockname()[1]
        outcome = run_command(folder, "-s", "fine.xml", "-w", "--web-port", str(port))
    assert outcome.exit_code == ExitCode.USAGE
    assert f"port {port} is in use" in outcome.stderr
    assert "--web-port 0" in outcome.stderr
    assert not outcome.of(TestStarted)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--web-port", "65536"], "no port"),
        (["--web-port", "-1"], "negative"),
        (["--web-host", "nowhere.invalid"], "name an address of this machine"),
        (["--web-host", "192.0.2.1"], "cannot listen on"),
        (["--web-port", "0", "--compare", "no-run"], "there is no run in no-run"),
    ],
)
def test_what_cannot_be_served_is_an_error_before_the_run(folder: Path, arguments: list[str], said: str):
    """A wrong port or host is a usage error that says what is wrong, before any test runs."""
    outcome = run_command(folder, "-s", "fine.xml", "-w", *arguments)
    assert outcome.exit_code == ExitCode.USAGE
    assert said in outcome.stderr
    assert not outcome.of(TestStarted)


def test_the_address_is_printed_with_the_token(folder: Path):
    """The address with the token is printed even with ``--quiet``, and each run has a token of its own."""
    runs = [LiveRun(folder, "-s", "fine.xml", "--quiet", "--no-output") for _ in range(2)]
    for run in runs:
        assert run.wait().exit_code == ExitCode.PASSED
    tokens = {run.page.token for run in runs}
    assert len(tokens) == 2
    assert all(len(token) >= 24 for token in tokens)


def test_the_token_is_not_leaked(folder: Path):
    """The token is neither in the list of processes nor in any file of the run."""
    run = LiveRun(folder, "-s", "asking.xml", "--no-output")
    lines = [" ".join(one.info["cmdline"] or []) for one in psutil.process_iter(["cmdline"])]
    go_on(run)
    run.wait()
    token = run.page.token
    assert any("asking.xml" in line for line in lines)
    assert not any(token in line for line in lines)
    assert not any(token.encode() in path.read_bytes() for path in run.run_folder.rglob("*") if path.is_file())


def test_an_earlier_run_and_the_history_are_beside_the_run(folder: Path):
    """The live page has the run of ``--compare`` and the file of ``--history``."""
    database = folder / "history.sqlite"
    first = run_command(folder, "-s", "fine.xml", "--run-folder", "first", "--history", str(database), "--no-output")
    assert first.exit_code == ExitCode.PASSED
    run = LiveRun(folder, "-s", "asking.xml", "--no-output", "--compare", "first", "--history", str(database))
    facts = run.page.get("/facts").json
    compared = run.page.get("/compare").json
    trends = run.page.get("/history").json
    go_on(run)
    assert run.wait().exit_code == ExitCode.PASSED
    assert (facts["compare"], facts["history"]) == (True, True)
    assert [record["event"] for record in compared] == [
        "run_started",
        "test_planned",
        "measured",
        "test_ended",
        "run_ended",
    ]
    assert [point[1] for point in trends["measurements"]["s/t\n\nvoltage"]["points"]] == [23.9]


def test_every_network_is_served_on_demand_only(folder: Path):
    """With ``--web-host 0.0.0.0`` the page answers under this machine's names and addresses, and under no others."""
    run = LiveRun(folder, "-s", "asking.xml", "--no-output", "--web-host", "0.0.0.0")
    assert run.page.host == socket.gethostname()
    run.page.host = "127.0.0.1"
    assert run.page.get("/facts", Host=f"192.168.7.7:{run.page.port}").status == 200
    assert run.page.get("/facts", Host=f"{socket.gethostname()}:{run.page.port}").status == 200
    assert run.page.get("/facts", Host=f"evil.example:{run.page.port}").status == 403
    go_on(run)
    run.wait()


def test_a_run_without_the_page_loads_nothing_of_it(folder: Path):
    """A run without ``-w`` loads nothing of the page; a run with it does not load the server's libraries."""
    script = (
        "import sys; from rtf.cli.testrunner import main; code = main(sys.argv[1:]); "
        "print(sorted({name.partition('.')[0] for name in sys.modules} & {'starlette', 'uvicorn', 'asyncio', 'h11'}), "
        "'rtf.page.server_process' in sys.modules); sys.exit(code)"
    )
    for arguments, loaded in (([], "[] False"), (["-w", "--web-port", "0"], "[] True")):
        done = subprocess.run(
            [sys.executable, "-c", script, "-s", "fine.xml", "--no-output", *arguments],
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.splitlines()[-1] == loaded, done.stdout


def test_the_report_of_a_run_that_is_over_has_no_live_page(folder: Path):
    """``testrunner report`` refuses ``-w``."""
    run_command(folder, "-s", "fine.xml", "--run-folder", "run", "--no-output")
    assert run_command(folder, "report", "run", "-w").exit_code == ExitCode.USAGE


def test_a_resumed_run_has_a_page_if_it_is_asked_for(folder: Path):
    """A resumed run serves a page again, and goes on in the same journal."""
    run = LiveRun(folder, "-s", "asking.xml", "--no-output")
    with run.page.follow() as stream:
        stream.until(event="asked")
    run.process.kill()
    run.wait()
    before = len((run.run_folder / "journal.jsonl").read_text().splitlines())
    again = LiveRun(folder, "--resume", "rtf-runs/latest")
    go_on(again, resumed=True)
    assert again.wait().exit_code == ExitCode.PASSED
    records = [json.loads(line) for line in (run.run_folder / "journal.jsonl").read_text().splitlines()]
    assert records[before]["resumed"]
