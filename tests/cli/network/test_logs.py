"""``rtf logger`` and ``rtf log``: what a program logs is stored, shown, filtered and followed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from typing import TYPE_CHECKING
from urllib.request import urlopen

import pytest

from rtf import clock
from rtf.cli.command_tree import RTF, main
from rtf.logs.record import Level, LogRecord
from rtf.logs.store import LogStore

if TYPE_CHECKING:
    from pathlib import Path

RECORDS = (
    LogRecord("/log/vm/yarpdev/7", Level.INFO, 1.0, "ready", "yarp.dev", "left", '(line 88) (function "f()") (pid 7)'),
    LogRecord("/log/vm/yarpdev/7", Level.ERROR, 2.0, "no \x1b[2J camera\n", "yarp.dev", backtrace="main.cpp:1"),
    LogRecord("/log/pc104/tool/8", Level.WARNING, 1e300, "line 1\nline 2"),
)


@pytest.fixture
def file(tmp_path: Path) -> str:
    """A log with some records, of which the last arrived just now."""
    path = tmp_path / "logs.sqlite"
    with LogStore(path) as store:
        store.add([*zip((1.0, 2.0, clock.now()), RECORDS, strict=True)])
    return str(path)


def shown(capsys: pytest.CaptureFixture[str], *words: str) -> list[str]:
    """What ``rtf log`` prints."""
    assert main(RTF, ["log", *words]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_record_is_a_line_as_yarp_prints_it(file: str, capsys):
    """Time, sender, level, component and message are in a line; what would harm a terminal is written out."""
    lines = shown(capsys, "--file", file)
    assert re.fullmatch(
        r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} vm/yarpdev/7 \[INFO\] \|yarp.dev\|left\| ready", lines[0]
    )
    assert lines[1].endswith(r"vm/yarpdev/7 [ERROR] |yarp.dev| no \x1b[2J camera")
    assert lines[2] == "main.cpp:1"
    assert lines[3].endswith("1e+300 pc104/tool/8 [WARNING] line 1")


def test_filters_leave_what_is_asked_for(file: str, capsys):
    """Each option reaches the query."""
    for words, wanted in (
        (("--level", "warning", "--host", "vm"), 1),
        (("--process", "yarpdev", "--component", "yarp", "--text", "READY"), 1),
        (("--since", "1h"), 1),
        (("--since", "1980-01-01"), 1),
        (("--last", "2"), 2),
        (("--text", "nothing"), 0),
    ):
        assert len(shown(capsys, "--file", file, "--json", *words)) == wanted, words


def test_json_has_everything(file: str, capsys):
    """A record as JSON has all its fields, and the other groups by key."""
    first = json.loads(shown(capsys, "--file", file, "--json")[0])
    assert first == {
        "number": 1,
        "arrived": 1.0,
        "sender": "/log/vm/yarpdev/7",
        "level": "INFO",
        "time": 1.0,
        "message": "ready",
        "component": "yarp.dev",
        "id": "left",
        "details": {"line": 88, "function": "f()", "pid": 7},
        "backtrace": "",
    }


def test_levels_have_colours_on_request(file: str, capsys):
    """The level alone is coloured, an error in red."""
    assert "\x1b[31m[ERROR]\x1b[0m |yarp.dev|" in shown(capsys, "--file", file, "--color", "always")[1]


def test_wrong_words_are_usage_errors(file: str, tmp_path: Path, capsys):
    """A level, time or size that is none is refused with an example, and a file that is no log by its name."""
    for words in (("log", "--level", "bad"), ("log", "--since", "noon"), ("logger", "--max-size", "big")):
        with pytest.raises(SystemExit) as ended:
            main(RTF, [*words, "--file", file])
        assert ended.value.code == 4, words
    assert main(RTF, ["log", "--file", str(tmp_path / "none")]) == 1
    assert "'rtf logger' writes one" in capsys.readouterr().err


def test_both_commands_serve_the_page(net, tmp_path: Path):
    """``--page`` prints the address of a page of the log, which is served until the end of the command."""
    file = str(tmp_path / "lab.sqlite")
    for name in ("logger", "log"):
        command = net.start(name, "--file", file, "--page", "--web-port", "0")
        command.until(lambda command=command: "  (Ctrl-C ends it)\n" in command.stdout, "the address")
        address = re.search(r"web page: (http://127.0.0.1:\d+/) ", command.stdout)
        assert address is not None
        with urlopen(f"{address[1]}records") as answer:
            assert json.load(answer)["newest"] == 0
        assert command.end() == 0


PROGRAM = """
import logging, rtf.logs
rtf.logs.forwarding._CLOSING = 30.0  # a busy machine may take longer than a program should wait at its end
logging.getLogger().addHandler(rtf.logs.handler())
logging.getLogger("lab.arm").warning("it is %s", "hot")
"""


def test_a_program_is_logged_and_followed(net, tmp_path: Path):
    """A program that forwards is followed while the logger runs; a command of ours forwards if YARP's variable asks."""
    file = str(tmp_path / "lab.sqlite")
    logger = net.start("logger", "--file", file)
    logger.until_printed(f"/yarplogger is open; records go to {file}")
    follower = net.start("log", "--file", file, "--follow")
    second = net.run("logger", "--file", file)
    assert "There is a logger already" in second.stderr
    script = tmp_path / "arm.py"
    script.write_text(PROGRAM)
    subprocess.run([sys.executable, script], env=net.environment, timeout=60, check=True)
    net.run("disconnect", "/a", "/b", YARP_FORWARD_LOG_ENABLE="1")
    follower.until(lambda: follower.stdout.count("Execution terminated") == 2, "the last records")
    assert logger.end() == 0
    assert follower.end() == 0
    assert re.search(r"/arm\.py/\d+ \[WARNING\] \|lab\.arm\| it is hot\n", follower.stdout)
    assert re.search(r"/rtf-disconnect/\d+ \[ERROR\] \|rtf\| .*/a", follower.stdout)
