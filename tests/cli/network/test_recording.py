"""``rtf record`` and ``rtf play`` as processes: ends of all kinds leave what can be played."""

from __future__ import annotations

import resource
import signal
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.recording import open_recording

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.recording import Sample

    from .conftest import Net, Tool

PLACES = ("run", "run.mcap")


def read_all(path: Path) -> list[Sample]:
    """All messages of a recording."""
    recording = open_recording(path)
    return [*recording.samples([stream.source for stream in recording.streams])]


def recording(net: Net, place: str, source: Tool, *words: str) -> Tool:
    """Start recording /arm:o, and return when something is in the file."""
    recorder = net.start("record", "/arm:o", "-o", place, "--port", "/recorder", *words)
    recorder.until_printed(f"recording 1 ports into {place}")
    source.type("[pos] 0 1.5", "[pos] 1 1.5")
    path = net.folder / place
    recorder.until(lambda: (path.suffix or any(path.rglob("info.log"))) and len(read_all(path)) == 2, "two messages")
    return recorder


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGKILL])
def test_a_recording_is_whole_however_it_ends(net: Net, place: str, signum: int):
    """What was written before Ctrl-C or kill -9 is played afterwards, from a port of the same name."""
    place = f"{signum}-{place}"
    source = net.opened("/arm:o", "write", "/arm:o")
    recorder = recording(net, place, source)
    assert recorder.end(signum) == (0 if signum == signal.SIGINT else -signum)
    if signum == signal.SIGKILL:
        net.names.unregister("/recorder")
    else:
        assert recorder.stdout.splitlines()[-1].split() == ["2", "messages", "of", "/arm:o"]
    assert source.wait() == 0

    reader = net.opened("/reader", "read", "/reader")
    player = net.start("play", place, "--await-reader", "30")
    net.run("wait", "/arm:o", "--timeout", "30")
    net.run("connect", "/arm:o", "/reader")
    assert player.process.wait(30) == 0, player.stderr
    assert player.stdout.splitlines()[-1].startswith("2 messages were sent")
    reader.until_printed("[pos] 1 1.5")
    assert reader.stdout.splitlines() == ["[pos] 0 1.5", "[pos] 1 1.5"]
    assert ("was not finished" in player.stderr) == (signum == signal.SIGKILL and place.endswith(".mcap"))
    reader.end()


@pytest.mark.parametrize("place", PLACES)
def test_a_full_disk_ends_the_recording_with_its_file(net: Net, place: str):
    """The file is named, the exit code is 1, and what was written before can be read."""
    place = f"full-{place}"
    source = net.opened("/arm:o", "write", "/arm:o")
    recorder = recording(net, place, source)
    resource.prlimit(recorder.process.pid, resource.RLIMIT_FSIZE, (3000, 3000))
    numbers = np.random.default_rng(1).random((20, 600))  # which nothing compresses
    source.type(*[" ".join(map(repr, row)) for row in numbers.tolist()])
    assert recorder.process.wait(30) == 1
    assert f"[ERROR] rtf record: {place}" in recorder.stderr
    assert "cannot be written: File too large" in recorder.stderr
    assert source.wait() == 0
    assert [sample.value.to_text() for sample in read_all(net.folder / place)][:2] == ["[pos] 0 1.5", "[pos] 1 1.5"]


def test_mistakes_are_reported_before_anything_is_written(net: Net):
    """A port that is not there, a folder that is used, a broken line with its place, and a name that is taken."""
    nobody = net.run("record", "/nobody", "-o", "none")
    assert "[ERROR] There is no port /nobody." in nobody.stderr
    assert not (net.folder / "none").exists()
    broken = net.folder / "broken" / "arm"
    broken.mkdir(parents=True)
    (broken / "info.log").write_text("Type: Bottle;\nStamp: rx;\n[1.0] /arm:o [connected]\n")
    (broken / "data.log").write_text("0 1.0 1\n1 soon 2\n")
    player = net.run("play", "broken")
    assert player.process.returncode == 1
    assert "[ERROR] rtf play: broken/arm/data.log:2: 'soon' is not a time in seconds" in player.stderr
    source = net.opened("/arm:o", "write", "/arm:o")
    taken = net.run("play", "broken")
    assert "there is a port /arm:o already; play with --prefix" in taken.stderr
    used = net.run("record", "/arm:o", "-o", "broken")
    assert "broken is not empty; give a folder that is new" in used.stderr
    assert source.wait() == 0


def test_a_recording_is_ended_by_its_time_and_played_in_a_loop(net: Net):
    """``--time`` ends it, ``--loop`` begins it again until Ctrl-C."""
    source = net.opened("/arm:o", "write", "/arm:o")
    recorder = recording(net, "timed.mcap", source, "--time", "4")
    assert recorder.process.wait(30) == 0
    assert source.wait() == 0
    reader = net.opened("/reader", "read", "/reader")
    player = net.start("play", "timed.mcap", "--loop", "--prefix", "/again", "--rate", "100", "--await-reader", "30")
    net.run("wait", "/again/arm:o", "--timeout", "30")
    net.run("connect", "/again/arm:o", "/reader")
    reader.until(lambda: reader.stdout.count("[pos] 0 1.5") >= 3, "the third time")
    assert player.end() == 0
    reader.end()
