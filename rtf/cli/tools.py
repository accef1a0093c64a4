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

tests:
  run         run suites and tests (the same as testrunner)
  describe    what a test or fixture is for, and its parameters
  validate    everything that is wrong in suite files
  report      write reports of a run that is over
  page        the page of a run that is over, or still going on
  history     what became of tests and measurements over the runs
  where FILE  where a parameter file is looked for, and which one wins
  proof       run every robot test on every fault that it claims to find
  demo        run the demonstration suite and check every verdict

network:
{network}

robot:
  robotinterface  start a robot from its configuration, and end it in order
  simulator       start a simulated iCub, and break it on purpose

other:
  version     the version of the framework

Each tool has its own --help.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one tool; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    tool = words[0] if words else ""
    if tool in ("", "-h", "--help", "-?"):
        print(_help(), end="")
        return int(ExitCode.PASSED if tool else ExitCode.USAGE)
    if tool in ("version", "--version"):
        print(f"rtf version {rtf.__version__}")
        return int(ExitCode.PASSED)
    from rtf.cli import network

    # 'where' is asked two things: with a file where that is looked for, without one where the name server is.
    if tool in network.TOOLS and (tool != "where" or words[1:] in ([], ["-h"], ["--help"])):
        return int(network.run(tool, words[1:]))
    if tool == "robotinterface":
        from rtf.cli.robotinterface import robotinterface

        return robotinterface(words[1:])
    if tool == "simulator":
        from rtf.cli.simulator import simulator

        return simulator(words[1:])
    return _run_tests(tool, words)


def _run_tests(tool: str, words: list[str]) -> int:
    from rtf.cli import testrunner

    if tool == "demo":
        from rtf.cli.demo import demo

        return int(demo(words[1:]))
    if tool == "proof":
        from rtf.cli.proof import proof

        return int(proof(words[1:]))
    if tool == "run":
        return testrunner.main(words[1:])
    if tool in testrunner.COMMANDS:
        return testrunner.main(words)
    print(f"rtf: there is no tool {tool!r}\nTry 'rtf --help'.", file=sys.stderr)
    return int(ExitCode.USAGE)


def _help() -> str:
    from rtf.cli.network import TOOLS

    return _HELP.format(network="\n".join(f"  {word:<10}  {tool.summary}" for word, tool in TOOLS.items()))


if __name__ == "__main__":
    sys.exit(main())
