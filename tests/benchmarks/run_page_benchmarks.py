"""Run the benchmarks of the live page and print their tables: ``python tests/benchmarks/run_page_benchmarks.py``.

Clients run on this machine and take processor time from the run that browsers elsewhere would not; ratios are therefore
upper bounds, most of all on few cores.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import page_server


def main(arguments: list[str] | None = None) -> None:
    """Measure what was asked for, in a folder that is gone afterwards."""
    parser = argparse.ArgumentParser(description="Benchmarks of the live page; all of them take some minutes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="start, clients (default: both)")
    parser.add_argument("--rounds", type=int, default=9, help="measured runs of each command")
    parser.add_argument("--tests", type=int, default=150, help="number of tests that are followed")
    parser.add_argument("--events", type=int, default=100, help="events of each of them")
    options = parser.parse_args(arguments)
    known = {
        "start": page_server.start(),
        "clients": page_server.clients(options.tests, options.events),
    }
    with tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as folder:
        for name in options.names or known:
            known[name].measure(Path(folder) / name, options.rounds)
            print(known[name].table(), flush=True)


if __name__ == "__main__":
    main()
