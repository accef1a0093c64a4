"""The part of ``rtf demo`` about CAN: a test scans a bus of a simulated robot, and names the board that is broken."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.testing.events import Message
from rtf.testing.journal import as_one_run, results_of
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

#: The board that is broken, and what is wrong with it.
_BROKEN, _FAULT = "head0:2", "can_bus_off"
_SUITE = """<?xml version="1.0" encoding="UTF-8"?>
<suite name="a broken board">
    <fixture name="names" param="--namespace /demo-can"> yarpserver </fixture>
    <fixture name="robot" depends="names" param="--clock /demo-can/clock">
        <parameter name="parts">head</parameter> <parameter name="can">true</parameter> simulator
    </fixture>
    <test name="boards">
        <parameter name="part">head</parameter> <parameter name="inject">{fault} {board}</parameter> CanBoards
    </test>
</suite>
"""


class NotNamedError(RtfError):
    """The test did not name the broken board."""


def break_a_board(runs: Path) -> list[str]:
    """Run the test on a robot with a broken board; return what it says, a line each.

    Raises NotNamedError if it does not name the board.
    """
    from rtf.cli import testrunner

    folder = runs / "can"
    folder.mkdir(parents=True, exist_ok=True)
    suite = folder / "broken-board.xml"
    suite.write_text(_SUITE.format(fault=_FAULT, board=_BROKEN), encoding="utf-8")
    testrunner.main(["--suite", str(suite), "--runs", str(folder), "--answer", "default", "-q"])
    (test,) = results_of(folder / "latest").tests.values()
    wrong = [problem.detail for problem in test.problems if problem.subject == _BROKEN]
    if test.verdict is not Verdict.FAILED or not wrong:
        raise NotNamedError(f"CanBoards ended with {test.verdict}, and did not name {_BROKEN}")
    events = as_one_run(folder / "latest")
    said = [event.detail for event in events if isinstance(event, Message) and " with firmware " in event.detail]
    return [*(f"  {line}" for line in said), f"  {wrong[0]}"]
