"""``rtf``: the tools of the framework under one name, each a word of its own."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import rtf
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

_HELP = """\
usage: rtf TOOL ...

tools:
  run        run suites and tests (the same as testrunner)
  describe   what a test or fixture is for, and its parameters
  validate   everything that is wrong in suite files
  report     write reports of a run that is over
  page       the page of a run that is over, or still going on
  history    what became of tests and measurements over the runs
  where      where a parameter file is looked for, and which one wins
  demo       run the demonstration suite and check every verdict
  version    the version of the framework

Each tool has its own --help.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one tool; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    tool = words[0] if words else ""
    if tool in ("", "-h", "--help", "-?"):
        print(_HELP, end="")
        return int(ExitCode.PASSED if tool else ExitCode.USAGE)
    if tool in ("version", "--version"):
        print(f"rtf version {rtf.__version__}")
        return int(ExitCode.PASSED)
    if tool == "demo":
        from rtf.cli.demo import demo

        return int(demo(words[1:]))
    from rtf.cli import testrunner

    if tool == "run":
        return testrunner.main(words[1:])
    if tool in testrunner.COMMANDS:
        return testrunner.main(words)
    print(f"rtf: there is no tool {tool!r}\nTry 'rtf --help'.", file=sys.stderr)
    return int(ExitCode.USAGE)


if __name__ == "__main__":
    sys.exit(main())
