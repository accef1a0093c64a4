"""Following a run: nothing is missing or doubled, and run and server do not end each other."""

from __future__ import annotations

import asyncio
import json
import random
import signal
import socket
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from harness import read_back, write_files
from live_page import WAITING, LiveRun, Page
from rtf.page import server
from rtf.testing.events import Answered, Interrupted, RunEnded, TestEnded
from rtf.testing.verdict import ExitCode, Verdict

if TYPE_CHECKING:
    from pathlib import Path

TALKING = """
import time
from rtf.testing import TestCase

class Talking(TestCase):
    def run(self):
        for number in range(400):
            self.report(f"step {number} " + "x" * (number % 7 * 40))
            if number % 10 == 0:
                time.sleep(0.005)
        self.report("long " + "y" * 200_000)
        self.check(True, "said it all")
"""
LOUD = """
from rtf.testing import TestCase

class Loud(TestCase):
    def run(self):
        for _ in range(30):
            self.report("y" * 200_000)
"""
GATED = """
from pathlib import Path
from rtf import clock
from rtf.testing import TestCase

class Gated(TestCase):
    def run(self):
        while not Path(__file__).with_name("gate").exists():
            clock.sleep(0.01)
        self.check(True, "the gate is open")
"""
SLEEPING = """
import time
from rtf.testing import TestCase

class Sleeping(TestCase):
    def run(self):
        self.report("asleep")
        time.sleep(60)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with plug-ins and suites."""
    write_files(
        tmp_path,
        {
            "talking__py": TALKING,
            "loud__py": LOUD,
            "gated__py": GATED,
            "waiting__py": WAITING,
            "sleeping__py": SLEEPING,
            "talking__xml": '<suite name="s"><test>talking.py</test><test name="b">talking.py</test></suite>',
            "loud__xml": '<suite name="s"><test>loud.py</test><test>loud.py</test><test>gated.py</test></suite>',
            "gated__xml": '<suite name="s"><test>gated.py</test></suite>',
            "waiting__xml": '<suite name="s"><test>waiting.py</test><test name="more">waiting.py</test></suite>',
            "sleeping__xml": '<suite name="s"><test>sleeping.py</test><test name="more">sleeping.py</test></suite>',
        },
    )
    return tmp_path


def journal_of(run: LiveRun) -> list[dict[str, Any]]:
    """Return the records of a run's journal."""
    return [json.loads(line) for line in (run.run_folder / "journal.jsonl").read_text().splitlines()]


def server_of(run: LiveRun) -> psutil.Process:
    """Return the process that serves the page."""
    (found,) = [
        child for child in psutil.Process(run.process.pid).children() if "rtf.page" in " ".join(child.cmdline())
    ]
    return found


def follow_to_end(page: Page) -> list[dict[str, Any]]:
    """Follow a run from its beginning."""
    with page.follow() as stream:
        return stream.until_end()


def follow_restlessly(page: Page, seed: int) -> list[dict[str, Any]]:
    """Follow a run with many disconnections."""
    luck = random.Random(seed)
    records: list[dict[str, Any]] = []
    while True:
        with page.follow(len(records) or None) as stream:
            stay = luck.randrange(1, 6)
            for message in stream:
                if message.event == "end":
                    return records
                if message.event != "message":
                    continue
                records += message.data
                assert message.id == len(records)
                stay -= 1
                if not stay:
                    break


def test_each_client_gets_each_line_once(folder: Path):
    """Clients that stay, come late, or reconnect all get the whole journal once."""
    run = LiveRun(folder, "-s", "talking.xml", "--no-output", "--web-keep")  # a client may come back after the end
    with ThreadPoolExecutor(12) as pool:
        staying = [pool.submit(follow_to_end, run.page) for _ in range(3)]
        restless = [pool.submit(follow_restlessly, run.page, seed) for seed in range(8)]
        with run.page.follow() as stream:
            stream.until(event="test_started", test="s/b")
        late = pool.submit(follow_to_end, run.page)
        seen = [future.result() for future in [*staying, *restless, late]]
    run.signal()
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.PASSED
    journal = journal_of(run)
    assert journal[-1]["event"] == "run_ended"
    assert all(records == journal for records in seen)
    assert not run.left_over()


def test_a_client_that_stalls_delays_no_other(folder: Path):
    """A client that does not read costs a limited buffer, and delays no other client."""
    run = LiveRun(folder, "-s", "loud.xml", "--no-output")
    with socket.create_connection((run.page.host, run.page.port)) as stalled:
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        stalled.sendall(f"GET /events HTTP/1.1\r\nHost: {run.page.host}:{run.page.port}\r\n\r\n".encode())
        with run.page.follow() as stream:
            stream.until(event="test_started", test="s/gated")
            assert server_of(run).memory_info().rss < 100 << 20
            (folder / "gate").touch()
            records = stream.until_end()
        outcome = run.wait()
    assert records[-1]["event"] == "run_ended"
    assert outcome.exit_code == ExitCode.PASSED
    assert len((run.run_folder / "journal.jsonl").read_bytes()) > 10 << 20
    assert not run.left_over()


def test_many_clients_at_once(folder: Path):
    """150 clients can follow a run."""
    run = LiveRun(folder, "-s", "waiting.xml", "--no-output")
    streams = [run.page.follow() for _ in range(150)]
    for stream in streams:
        stream.until(event="asked", test="s/waiting")
    run.page.control("stop", stage=2)
    with ThreadPoolExecutor(8) as pool:
        ends = [*pool.map(lambda stream: stream.until_end()[-1]["event"], streams)]
    assert ends == ["run_ended"] * len(streams)
    assert run.wait().exit_code == ExitCode.INTERRUPTED
    assert not run.left_over()
    for stream in streams:
        stream.close()


def test_a_resumed_run_is_one_run_on_the_page(folder: Path):
    """A client that returns to a resumed run gets the rest of the journal."""
    run = LiveRun(folder, "-s", "waiting.xml", "--no-output")
    with run.page.follow() as stream:
        stream.until(event="asked")
    run.signal(signal.SIGKILL)
    run.wait()
    with (run.run_folder / "journal.jsonl").open("ab") as journal:
        journal.write(b'{"event":"message","torn')
    lines = len(journal_of_whole_lines(run))
    again = LiveRun(folder, "--resume", "rtf-runs/latest", "--no-output")
    with again.page.follow(lines) as stream:
        for test in ("s/waiting", "s/more"):
            stream.until(event="asked", test=test)
            assert again.page.control("answer", test=test, question=f"{test}#1", answer="1").status == 202
        assert stream.until_end()[-1]["event"] == "run_ended"
    assert again.wait().exit_code == ExitCode.PASSED
    assert not again.left_over()
    assert not run.left_over()


def journal_of_whole_lines(run: LiveRun) -> list[bytes]:
    """Return the complete lines of a journal."""
    return (run.run_folder / "journal.jsonl").read_bytes().split(b"\n")[:-1]


# One side dies --------------------------------------------------------------------------------------------------------


def test_the_server_ends_with_a_runner_that_is_killed(folder: Path):
    """After a kill of the runner clients get the rest and the end of the stream."""
    run = LiveRun(folder, "-s", "waiting.xml", "--no-output", "--web-keep")
    with run.page.follow() as stream:
        stream.until(event="asked")
        run.signal(signal.SIGKILL)
        assert all(record["event"] != "run_ended" for record in stream.until_end())
    run.wait()
    assert not run.left_over()


@pytest.mark.parametrize("signum", [signal.SIGKILL, signal.SIGSEGV, signal.SIGTERM])
def test_a_server_that_dies_changes_nothing(folder: Path, signum: signal.Signals):
    """If the server dies, the run reports it and goes on."""
    run = LiveRun(folder, "-s", "gated.xml", "--no-output")
    with run.page.follow() as stream:
        stream.until(event="test_started")
        server_of(run).send_signal(signum)
    assert "the server of the web page has ended; the run continues" in run.line()
    (folder / "gate").touch()
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.PASSED
    assert not run.left_over()


def test_a_short_run_is_not_held_up(folder: Path):
    """A run that ends before the server is up does not wait for it."""
    write_files(folder, {"quick__py": TALKING.replace("400", "1").replace("200_000", "1")})
    for _ in range(3):
        run = LiveRun(folder, "-t", "quick.py", "--no-output")
        assert run.wait().exit_code == ExitCode.PASSED
        assert not run.left_over()
        assert not (run.run_folder / "web-server.log").exists()


# Control --------------------------------------------------------------------------------------------------------------


def test_stop_after_the_running_test(folder: Path):
    """Stage 1 lets the running test end, starts no other, and is recorded with its source."""
    run = LiveRun(folder, "-s", "waiting.xml", "--no-output")
    with run.page.follow() as stream:
        stream.until(event="asked")
        assert run.page.control("stop", stage=1).status == 202
        stream.until(event="interrupted", stage=1, source="the web page")
        assert run.page.control("answer", test="s/waiting", question="s/waiting#1", answer="yes").status == 202
        stream.until_end()
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.INTERRUPTED
    assert outcome.verdict("waiting") is Verdict.PASSED
    assert outcome.verdict("more") is Verdict.NOT_RUN


def test_stop_now(folder: Path):
    """Stage 2 stops the running test, also if it is requested twice."""
    run = LiveRun(folder, "-s", "sleeping.xml", "--no-output", "--web-keep")
    with run.page.follow() as stream:
        stream.until(event="message", detail="asleep")
        assert run.page.control("stop", stage=2).status == 202
        assert run.page.control("stop", stage=2).status in (202, 409)  # it may be over already
        stream.until_end()
    run.signal()
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.INTERRUPTED
    assert {event.stage for event in outcome.of(Interrupted)} == {2}
    assert outcome.verdict("sleeping") is Verdict.INTERRUPTED


def test_the_first_answer_counts(folder: Path):
    """Of several answers the first counts, and the others get an error."""
    run = LiveRun(folder, "-s", "waiting.xml", "--no-output", "-k", "waiting", "--web-keep")
    with run.page.follow() as stream, ThreadPoolExecutor(8) as pool:
        stream.until(event="asked")
        command = {"test": "s/waiting", "question": "s/waiting#1", "answer": "yes"}
        said = [*pool.map(lambda _: run.page.control("answer", **command), range(8))]
        assert sorted(answer.status for answer in said) == [202] + [409] * 7
        assert {answer.json["error"] for answer in said if answer.status == 409} == {"it is answered already (web)"}
        assert stream.until(event="answered")["source"] == "web"
        stream.until_end()
    run.signal()
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.PASSED
    assert len(outcome.of(Answered)) == 1


# Afterwards -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_the_page_stays_until_it_is_ended(folder: Path, signum: signal.Signals):
    """With ``--web-keep`` the page stays without control, and the exit code is that of the run."""
    run = LiveRun(folder, "-s", "talking.xml", "--no-output", "-k", "b", "--web-keep")
    page = run.page
    with page.follow() as stream:
        records = stream.until_end()
    stays = run.line()
    while "stays" not in stays:
        stays = run.line()
    assert f"http://127.0.0.1:{page.port}/" in stays
    with page.follow() as stream:
        assert stream.until_end() == records == journal_of(run)
    with page.follow(len(records)) as stream:
        assert stream.until_end() == []
    assert page.control("stop", stage=1).status == 409
    assert page.control("stop", stage=1).json == {"error": "the run is over"}
    assert run.process.poll() is None
    run.signal(signum)
    outcome = run.wait()
    assert outcome.exit_code == ExitCode.PASSED
    assert not run.left_over()


def test_a_page_that_stays_ends_when_its_server_does(folder: Path):
    """A kept page ends with its server."""
    run = LiveRun(folder, "-s", "talking.xml", "--no-output", "-k", "b", "--web-keep")
    while "stays" not in run.line():
        pass
    server_of(run).kill()
    assert run.wait().exit_code == ExitCode.PASSED
    assert not run.left_over()


def test_the_run_leaves_the_archived_page(folder: Path):
    """The run writes the archived page into its folder."""
    run = LiveRun(folder, "-s", "talking.xml", "--no-output", "-k", "b")
    assert run.wait().exit_code == ExitCode.PASSED
    assert (run.run_folder / "report.html").read_bytes().startswith(b"<!doctype html>")


def test_everything_that_was_said_is_in_the_last_records(folder: Path):
    """The stream ends with the end of the run."""
    run = LiveRun(folder, "-s", "talking.xml", "--no-output", "-k", "b")
    with run.page.follow() as stream:
        last = stream.until_end()[-1]
    run.wait()
    events, _ = read_back(run.run_folder)
    assert isinstance(events[-1], RunEnded)
    assert (last["event"], last["verdict"]) == ("run_ended", "passed")
    assert [event.final for event in events if isinstance(event, TestEnded)] == [True]


def test_an_answer_that_is_just_too_late_is_left(monkeypatch: pytest.MonkeyPatch):
    """One that is read in the moment in which its time ends; the server hears of what follows."""
    monkeypatch.setattr(server, "_ANSWER_TIME", 0.0)
    over: list[bool] = []

    async def converse() -> None:
        reader = asyncio.StreamReader()
        runner = server.Runner(reader, SimpleNamespace(write=str))  # type: ignore[arg-type]  # what is used of it
        watch = SimpleNamespace(finish=lambda: over.append(True))
        listening = asyncio.create_task(runner.listen(watch))  # type: ignore[arg-type]  # what is used of it
        asking = asyncio.create_task(runner.command({"stop": 1}))
        await asyncio.sleep(0)  # both wait now, and the time of the request ends in the next turn
        reader.feed_data(b'{"id": 1}\n{"over": true}\n')
        reader.feed_eof()
        await listening
        with pytest.raises(TimeoutError):
            await asking

    with ThreadPoolExecutor(1) as pool:  # this thread may have a loop, of a browser
        pool.submit(asyncio.run, converse()).result()
    assert over == [True]
