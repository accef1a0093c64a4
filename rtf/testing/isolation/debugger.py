"""A debugger in the process of a test: ``breakpoint()`` and exceptions open Python's at the terminal of the run."""

from __future__ import annotations

import os
import pdb  # noqa: T100 - this is the place where a debugger is meant
import sys
from bdb import BdbQuit
from types import TracebackType

from rtf.testing.session import OWN_FOLDER
from rtf.testing.verdict import Inconclusive, SkipTest


def take_terminal(path: str) -> None:
    """Connect input and output of this process to a terminal; its output is not recorded then."""
    terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
    for descriptor in (0, 1, 2):
        os.dup2(terminal, descriptor)
    os.close(terminal)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115 - for as long as the process lives
    sys.stdout = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115


def examine(error: Exception) -> None:
    """Open the debugger where an exception was raised, in the author's code if the traceback has any."""
    if isinstance(error, SkipTest | Inconclusive | BdbQuit):
        return
    sys.stderr.write(f"{type(error).__name__}: {error}\nThe debugger is where it was raised; 'c' goes on.\n")
    pdb.post_mortem(_to_author(error.__traceback__))


def _to_author(trace: TracebackType | None) -> TracebackType | None:
    """Return the traceback up to the last frame that is not RTF's own."""
    steps = []
    while trace is not None:
        steps.append(trace)
        trace = trace.tb_next
    inner = steps
    while inner and inner[-1].tb_frame.f_code.co_filename.startswith(OWN_FOLDER):
        inner = inner[:-1]
    made: TracebackType | None = None
    for step in reversed(inner or steps):
        made = TracebackType(made, step.tb_frame, step.tb_lasti, step.tb_lineno)
    return made
