"""The tests of machines, and of the wrapper of the skin, which need no robot."""

import struct
import threading
from contextlib import closing
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, socket

import psutil
import pytest

from harness import run_command, write_files
from rtf import clock
from rtf.testing.events import Measured, Message, SubResultEnded
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

#: Does on this machine what ssh would do on another; hosts that are down and that ask for a password are known, too.
SSH = """#!/bin/sh
while [ "$1" != "--" ]; do echo "$1" >> "$ASKED"; shift; done
host=$2; shift 2
echo "$host: $*" >> "$ASKED"
case $host in
  down) echo "ssh: connect to host down port 22: No route to host" >&2; exit 255;;
  slow) exec sleep 60;;
  wrong) echo 20;;
  odd) echo what;;
  *) case "$*" in ulimit*) echo 99;; *) echo 8388608;; esac;;
esac
"""


SKIN_WRAPPER = Path(__file__).parents[2] / "icub_tests" / "skin_wrapper_test.py"
#: A wrapper that publishes four times as often as the test has asked it to.
HASTY = f"""import runpy

class HastySkin(runpy.run_path({str(SKIN_WRAPPER)!r})["SkinWrapperTest"]):
    def _open(self, configuration):
        due, self.period = self.period, self.period / 4
        try:
            return super()._open(configuration)
        finally:
            self.period = due
"""


class TimeServer(threading.Thread):
    """A time server whose clock is a second behind."""

    def __init__(self):
        super().__init__(daemon=True)
        self.socket = socket(AF_INET, SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.place = f"127.0.0.1:{self.socket.getsockname()[1]}"

    def run(self):
        """Answer requests until a message arrives that is none."""
        while True:
            question, asker = self.socket.recvfrom(100)
            if len(question) != 48:
                return
            stamp = struct.pack(">II", int(clock.now() + 1.0) + 2_208_988_800, int((clock.now() % 1) * 2**32))
            self.socket.sendto(bytes([0x24, 1]) + bytes(22) + question[40:48] + stamp + stamp, asker)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    """One run of all of them."""
    folder = tmp_path_factory.mktemp("machines")
    server = TimeServer()
    server.start()
    tests = {
        "cluster": ("cluster-tests", {"hosts": "(pc104 icub@icub16)"}),
        "nobody": ("cluster-tests", {}),
        "down": ("ClusterTests", {"hosts": "(down wrong)"}),
        "slow": ("ClusterTests", {"hosts": "(slow)", "timeout_per_question": 0.3}),
        "odd": ("ClusterTests", {"hosts": "(odd)"}),
        "option": ("ClusterTests", {"hosts": "(-oProxyCommand=x)"}),
        "status": ("system-status", {"time": 0.2}),
        "hosts": ("SystemStatus", {"time": 0.2, "hosts": "((/pc104 40))"}),
        "full": ("SystemStatus", {"time": 0.2, "disk": 100}),
        "loaded": ("SystemStatus", {"time": 0.2, "cpu": 99, "cpu_mean": 99}),
        "crowded": ("SystemStatus", {"time": 0.2, "load": 1e-6}),
        "clock": ("SystemStatus", {"time": 0.2, "time_server": server.place}),
        "skin": ("skinWrapperTest", {}),
        "hasty-skin": ("hasty.py", {"prefix": "/hasty", "time": 1}),
        "slow-skin": ("skinWrapperTest", {"prefix": "/slow", "period": 60000, "time": 0.1}),
    }
    entries = "".join(
        f'<test name="{name}">'
        + "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in given.items())
        + f" {test} </test>"
        for name, (test, given) in tests.items()
    )
    suite = f'<suite name="s"><fixture name="names"> yarpserver </fixture>{entries}</suite>'
    write_files(folder, {"suite.xml": suite, "bin/ssh": SSH, "hasty.py": HASTY})
    path = f"{folder / 'bin'}:/usr/bin:/bin"
    try:
        yield run_command(folder, "--suite", "suite.xml", PATH=path, ASKED=str(folder / "asked"))
    finally:
        with closing(server.socket), socket(AF_INET, SOCK_DGRAM) as ending:
            ending.sendto(b"end", server.socket.getsockname())
            server.join()


def test_machines_are_asked_without_anybody_being_asked(outcome):
    """Each machine is asked three questions by ssh in batch mode, with a time-out, and the answers are measured."""
    assert outcome.verdict("cluster") is Verdict.PASSED
    assert {event.subject for event in outcome.of(Measured, test="s/cluster")} == {"pc104", "icub@icub16"}
    asked = (outcome.folder.parents[1] / "asked").read_text()
    for host in ("pc104", "icub@icub16"):
        for question in ("ulimit -S -r", "ulimit -H -r", "cat /proc/sys/net/core/rmem_max"):
            assert f"{host}: {question}\n" in asked
    assert "BatchMode=yes\n" in asked
    assert "ConnectTimeout=10\n" in asked


def test_without_machines_there_is_nothing_to_test(outcome):
    """Without hosts the test is skipped; the reason names the parameter."""
    assert outcome.verdict("nobody") is Verdict.SKIPPED
    assert "hosts=" in outcome.detail("nobody")


def test_a_machine_that_is_down_hides_no_other(outcome):
    """It is an error, and wrong limits of another machine are still a failure."""
    said = {event.subject: event for event in outcome.of(Message, test="s/down") if event.severity.name == "ERROR"}
    assert "No route to host" in said["down"].detail
    low = [event for event in outcome.of(Measured, test="s/down") if event.subject == "wrong"]
    assert [event.value for event in low] == [20.0, 20.0, 20.0]
    assert outcome.verdict("down") in {Verdict.ERROR, Verdict.FAILED}


@pytest.mark.parametrize(("name", "said"), [("slow", "within 0.3 s"), ("odd", "'what'"), ("option", "ProxyCommand")])
def test_what_cannot_be_asked_is_an_error(outcome, name, said):
    """A machine that does not answer in time or answers nonsense, and a host that would be an option, are errors."""
    assert outcome.verdict(name) is Verdict.ERROR
    assert said in outcome.detail(name)


def test_this_machine_is_measured(outcome):
    """Each processor, memory and disk are measured; other machines are passed over with a reason."""
    assert outcome.verdict("status") in {Verdict.PASSED, Verdict.FAILED}
    names = {event.name for event in outcome.of(Measured, test="s/status")}
    assert {"processor 0", "all processors", "available memory", "used swap space", "free space"} <= names
    (other,) = (one for one in outcome.of(SubResultEnded, test="s/hosts") if one.subject == "/pc104")
    assert other.verdict is Verdict.SKIPPED
    assert "run there: testrunner --test SystemStatus --set cpu_mean=40" in other.reason


LOAD = "processes that want to run, mean of 1 min"


def test_more_than_the_processors_can_do_fails(outcome):
    """Without a limit, as many processes as processors may run; a failure has likely causes."""
    (usual,) = outcome.of(Measured, test="s/status", name=LOAD)
    assert usual.high == psutil.cpu_count()
    (crowded,) = outcome.of(Measured, test="s/crowded", name=LOAD)
    assert crowded.verdict is MeasurementVerdict.FAILED
    said = [one.detail for one in outcome.of(Message, test="s/crowded") if one.detail.startswith(LOAD)]
    assert "likely: a runaway program" in said[0]


def test_a_busy_machine_fails_no_simulated_robot(run_on_robot):
    """There it delays nothing, unless a limit is given."""
    entries = "<test name='usual'> SystemStatus </test>"
    entries += "<test name='given'> <parameter name='load'>0.000001</parameter> SystemStatus </test>"
    outcome = run_on_robot(entries, parts="head")
    (usual,) = outcome.of(Measured, test="s/usual", name=LOAD)
    (given,) = outcome.of(Measured, test="s/given", name=LOAD)
    assert (usual.verdict, given.verdict) == (MeasurementVerdict.RECORDED, MeasurementVerdict.FAILED)


def test_loads_without_a_limit_are_only_recorded(outcome):
    """No processor can be loaded by more than 100 %: that is no limit, and no verdict."""
    verdicts = {event.name: event.verdict for event in outcome.of(Measured, test="s/status")}
    assert verdicts["processor 0"] is verdicts["all processors"] is MeasurementVerdict.RECORDED
    verdicts = {event.name: event.verdict for event in outcome.of(Measured, test="s/loaded")}
    assert verdicts["processor 0"] is not MeasurementVerdict.RECORDED
    assert verdicts["all processors"] is not MeasurementVerdict.RECORDED


def test_limits_are_judged(outcome):
    """A disk that is not all free fails where it has to be."""
    assert outcome.verdict("full") is Verdict.FAILED
    said = [one.detail for one in outcome.of(Message, test="s/full") if one.detail.startswith("free space")]
    assert "fills up; likely: " in said[0]


def test_the_clock_is_compared_with_a_server(outcome):
    """A clock that is a second ahead of the server's fails."""
    assert outcome.verdict("clock") is Verdict.FAILED
    (ahead,) = outcome.of(Measured, test="s/clock", name="clock is ahead by")
    assert ahead.value == pytest.approx(-1000.0, abs=30.0)


def test_the_skin_wrapper_keeps_to_its_names(outcome):
    """It opens, publishes, refuses names that are taken, and gives its names back."""
    assert outcome.verdict("skin") is Verdict.PASSED
    refused = [event.detail for event in outcome.of(Message, test="s/skin") if event.detail.startswith("refused")]
    assert len(refused) == 6
    assert all("the port /testSkinWrapper" in one for one in refused)


def test_a_skin_that_sends_too_little_fails(outcome):
    """The failure has port, received and expected messages, and likely causes."""
    assert outcome.verdict("slow-skin") is Verdict.FAILED
    said = [one.detail for one in outcome.of(Message, test="s/slow-skin") if one.detail.startswith("messages of")]
    assert "/slow/one/skin sends 0 messages in 0.1 s, " in said[0]


def test_a_skin_that_sends_too_much_fails(outcome):
    """However long it took to connect: more than was due since the wrapper was opened is too much."""
    assert outcome.verdict("hasty-skin") is Verdict.FAILED
    failed = {
        one.subject for one in outcome.of(Measured, test="s/hasty-skin") if one.verdict is MeasurementVerdict.FAILED
    }
    assert failed == {"one port", "several ports"}
    said = [one.detail for one in outcome.of(Message, test="s/hasty-skin") if one.detail.startswith("messages of")]
    assert "with a period of 20 ms; likely: a sensor slower than its publisher" in said[0]
