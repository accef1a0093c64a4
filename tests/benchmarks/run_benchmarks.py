"""Run the benchmarks and print their tables: ``python tests/benchmarks/run_benchmarks.py [trivial|start|events …]``.

Numbers of a busy machine mean little; the ratios against pytest in the same run mean more.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import many_events
import start
import trivial


def main(arguments: list[str] | None = None) -> None:
    """Measure what was asked for, in a folder that is gone afterwards."""
    parser = argparse.ArgumentParser(description="Benchmarks of testrunner; all of them take some minutes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="start, trivial, events (default: all)")
    parser.add_argument("--rounds", type=int, default=7, help="measured runs of each command (events: one)")
    parser.add_argument("--tests", type=int, default=1000, help="number of trivial tests; events: ten times as many")
    options = parser.parse_args(arguments)
    known = {
        "start": (start.benchmark(), options.rounds),
        "trivial": (trivial.benchmark(options.tests), options.rounds),
        "events": (many_events.benchmark(options.tests * 10, 100), 1),
    }
    with tempfile.TemporaryDirectory(prefix="rtf-benchmark-") as folder:
        for name in options.names or known:
            benchmark, rounds = known[name]
            benchmark.measure(Path(folder) / name, rounds)
            print(benchmark.table(), flush=True)


if __name__ == "__main__":
    main()
