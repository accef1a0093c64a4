"""The benchmarks of the middleware themselves run; what they measure here means nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("run_middleware_benchmarks.py")


BURSTS = SCRIPT.with_name("run_burst_benchmarks.py")


def run(*arguments: str, script: Path = SCRIPT) -> list[str]:
    """What the script prints, line by line."""
    ran = subprocess.run([sys.executable, str(script), *arguments], check=True, text=True, capture_output=True)
    assert ran.stderr == ""
    return ran.stdout.splitlines()


def test_every_way_of_a_message_has_its_line():
    """The echo, against which the others are held, comes first."""
    title, _, *lines = run("speed", "--turns", "1")
    assert title.startswith("speed, load ")
    assert lines[0].startswith("  raw echo of 64 bytes")
    assert sum(" us" in line for line in lines) == len(lines) == 11


def test_every_reader_hears_everything():
    """None of them starves, by either carrier."""
    *lines, last = run("readers", "--turns", "1")
    assert sum("write of 64 bytes to" in line for line in lines) == 10
    assert last == "  messages that a reader did not hear: 0"


def test_a_crowd_uses_its_connections_and_then_nothing():
    """Each connection carried one message; a port that nobody writes to takes no processor time."""
    _, made, idle = run("crowd", "--ports", "10", "--connections", "20")
    assert "20 messages heard" in made
    assert int(idle.split()[1]) < 20_000


def test_priority_is_measured_or_refused():
    """Where this user may have no real-time priority the reason stands in the last line."""
    lines = run("priority", "--turns", "1")
    assert "both ends with priority" in lines[-1] or "CAP_SYS_NICE" in lines[-1]


def test_a_burst_has_a_line_for_each_carrier_and_pair_of_programs():
    """Ours with ours at least; few messages all arrive."""
    title, *lines = run("--messages", "20", script=BURSTS)
    assert title.startswith("bursts of 20 messages, load ")
    assert [line for line in lines if "rtf to rtf" in line] == [
        f"  {carrier:6}  rtf to rtf      20 of 20 arrived" for carrier in ("udp", "mcast")
    ]
