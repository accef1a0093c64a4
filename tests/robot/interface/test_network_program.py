"""Programs that use a robot: how they end."""

from __future__ import annotations

import signal
import subprocess
import sys

PROGRAM = """
from rtf.robot.interface.network_program import run_program
raise SystemExit(run_program("waits", lambda opened: None))
"""


def test_a_program_whose_stderr_is_closed_ends_on_a_signal():
    """As after the end of what reads its lines: that it cannot say so does not keep it from ending."""
    with subprocess.Popen([sys.executable, "-c", PROGRAM], stderr=subprocess.PIPE, text=True) as program:
        assert program.stderr is not None
        assert program.stderr.readline() == "READY waits\n"
        program.stderr.close()
        program.send_signal(signal.SIGTERM)
        try:
            program.wait(10)
        finally:
            program.kill()
    assert program.returncode == 0
