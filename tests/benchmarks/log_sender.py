"""A program that logs, for the benchmark of logs: ``log_sender.py HOW COUNT RATE``; ``HOW`` is ``port`` or ``logging``.

``port`` sends records as a program of YARP does, each encoded before; ``logging`` is the handler of Python. It begins
when a line comes on its standard input, so that all begin together, and prints the CPU seconds that the records took.
"""

from __future__ import annotations

import logging
import sys
import time
from typing import TYPE_CHECKING

from rtf.logs import forwarding
from rtf.logs.record import COLLECTOR, Level, LogRecord
from rtf.middleware.ports.pipelined_port import PipelinedPort
from rtf.middleware.types.codecs import RAW

if TYPE_CHECKING:
    from collections.abc import Callable

#: Seconds between two bursts, as of a program with a periodic thread.
_PERIOD = 0.01
_TEXT = "joint %d is at 12.5 deg, which is what was asked for"


def paced(count: int, rate: float, log: Callable[[int], object], flush: Callable[[], object]) -> None:
    """Log so many records at so many a second, a burst each period; 0: as fast as possible."""
    began = time.monotonic()
    done = 0
    while done < count:
        due = count if not rate else min(count, int((time.monotonic() - began) * rate) + 1)
        for number in range(done, due):
            log(number)
        flush()
        done = due
        if done < count:
            time.sleep(_PERIOD)


def main(how: str, count: int, rate: float, pid: str) -> None:
    """Prepare, wait, log, and say what it took."""
    if how == "port":
        port = PipelinedPort(f"/log/bench/sender/{pid}", RAW, together=16, patience=60.0)
        port.add_output(COLLECTOR, "fast_tcp")
        details = '(hostname bench) (pid 12345) (cmd sender) (args "--fast") (thread_id 0x00003039)'
        records = [
            LogRecord(port.name, Level.INFO, 1795212380.5, _TEXT % number, "lab.sender", "", details).to_bytes()
            for number in range(100)
        ]

        def log(number: int) -> None:
            port.write(records[number % 100])

        flush: Callable[[], object] = port.flush
        end: Callable[[], object] = port.close
    else:
        forwarding.LIMIT = count + 1
        handler = forwarding.handler()
        logger = logging.getLogger("lab.sender")
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        logger.info("ready")

        def log(number: int) -> None:
            logger.info(_TEXT, number)

        flush, end = list, handler.close
    print("ready", flush=True)
    sys.stdin.readline()
    before = time.process_time()
    paced(count, rate, log, flush)
    end()
    print(time.process_time() - before, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[4])
