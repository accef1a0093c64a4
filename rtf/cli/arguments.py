"""The command line of ``testrunner``: the C++ framework's flags with their names and meaning, and RTF's own."""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import TYPE_CHECKING

import rtf
from rtf.cli.command_tree import EXIT_CODES, TESTRUNNER
from rtf.cli.device import add_device_options
from rtf.cli.parser import Parser, add_dialect, add_place_options, count, key_value, seconds
from rtf.errors import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

_EPILOG = f"""\
commands (each has its own --help):
{TESTRUNNER.listing()}

examples:
  testrunner suites/demo/demo.xml                        run a suite; several, and folders of them, likewise
  testrunner demo.xml -k "left and not leg"              only some of its tests
  testrunner my_test.py --set speed=20                   one test, with a parameter
  testrunner my_suites -r -j 2 --junit out.xml           all suites of a folder, two at a time
  testrunner                                             what rtf.toml says
  testrunner --resume rtf-runs/latest                    only the tests that an interrupted run has not done

{EXIT_CODES}"""


def build_parser() -> Parser:
    """Return the parser of the run command."""
    parser = Parser(
        prog="testrunner",
        usage="testrunner [options] [SUITE|TEST|DIR ...]   or   testrunner COMMAND ...",
        description="Run robot tests: isolated, supervised, truthful.",
        epilog=_EPILOG,
    )
    _what(parser.add_argument_group("what to run"))
    _which(parser.add_argument_group("which of it"))
    _how(parser.add_argument_group("how"))
    _limits(parser.add_argument_group("limits"))
    _robot(parser.add_argument_group("the robot, its operator and its station"))
    add_report_options(parser.add_argument_group("what is said and written"))
    add_page_options(parser.add_argument_group("the live page"))
    parser.add_argument("--show-config", action="store_true", help="print the settings, and where each is from")
    parser.add_argument("--no-config", action="store_true", help="leave rtf.toml and pyproject.toml alone")
    parser.add_argument("--version", action="version", version=f"testrunner version {rtf.__version__}")
    return parser


def parse_run(words: Sequence[str]) -> argparse.Namespace:
    """Read the words of a run. Options and targets come in any order; a word that is neither is an error."""
    parser = build_parser()
    options, unknown = parser.parse_known_intermixed_args(words)
    if unknown:
        known = [name for action in parser._actions for name in action.option_strings]  # noqa: SLF001 - no public way
        parser.error(f"unknown option {unknown[0]}{did_you_mean(unknown[0].partition('=')[0], known)}")
    return options


def blank_options(words: Sequence[str]) -> argparse.Namespace:
    """Return the options in the words of a run, and None for each option that they do not have."""
    parser = build_parser()
    blank = argparse.Namespace(**dict.fromkeys(action.dest for action in parser._actions))  # noqa: SLF001
    return parser.parse_known_intermixed_args(words, blank)[0]


def _what(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "targets",
        metavar="SUITE|TEST|DIR",
        nargs="*",
        help="suite files, tests (file.py, file.py::Class), folders of suites or of tests",
    )
    group.add_argument("-t", "--test", metavar="FILE", help="one test plug-in, by file or name")
    group.add_argument(
        "--type", metavar="TYPE", help="its type where the name does not tell: python, lua, tap, gtest, exit …"
    )
    group.add_argument("--tests", metavar="DIR", help="every test plug-in of a folder")
    group.add_argument("-s", "--suite", metavar="XML", nargs="+", action="extend", default=[], help="suite files")
    group.add_argument("--suites", metavar="DIR", help="every suite file of a folder, in sorted order")
    group.add_argument("-r", "--recursive", action="store_true", help="--tests and --suites descend into sub-folders")
    group.add_argument("-p", "--param", metavar="STRING", default="", help="parameter string for --test")
    group.add_argument("-e", "--environment", metavar="STRING", default="", help="environment string for --test")
    group.add_argument("--repetition", metavar="N", type=count, help="run the body of each test N more times")
    add_reading_options(group)
    group.add_argument("--resume", metavar="RUN", help="go on with an interrupted run: the tests that are not done")


def add_reading_options(group: argparse._ActionsContainer) -> None:
    """Add the options for reading suites and for values of their tests, which running and validating share."""
    add_pair = partial(group.add_argument, metavar="NAME=VALUE", type=key_value, action="append", default=[])
    add_pair("--define", help="replace ${NAME} in suite files")
    add_pair("--set", dest="overrides", help="set a parameter of every test; beats all other sources")
    group.add_argument(
        "--lenient", action="store_true", help="an unknown element or attribute of a suite is a warning, not an error"
    )


def _which(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "-k", metavar="EXPRESSION", dest="names", help='tests whose name matches, such as "left and not leg"'
    )
    group.add_argument("--tags", metavar="EXPRESSION", help="tests whose tags match")
    group.add_argument("--last-failed", action="store_true", help="tests that did not pass in the last run")
    group.add_argument(
        "--stepwise",
        action="store_true",
        help="begin with the first test that did not pass in the last run, and stop at the first that does not pass",
    )
    group.add_argument("--shuffle", metavar="SEED", type=int, help="shuffle the tests of each suite, reproducibly")
    group.add_argument("--list", action="store_true", help="list the tests of what is to be run, and run nothing")
    group.add_argument("--dry-run", action="store_true", help="load plug-ins, check parameters, and run nothing")


def _how(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "-j",
        "--jobs",
        metavar="N",
        type=count,
        default=1,
        help="run up to N suites at a time, if they share no fixture, and tests of suites that have copies",
    )
    group.add_argument(
        "--retries", metavar="N", type=count, help="try a test that did not pass N more times; a late pass is 'flaky'"
    )
    group.add_argument(
        "--maxfail", metavar="N", type=count, default=0, help="start no further test after N that did not pass"
    )
    group.add_argument(
        "-x", "--fail-fast", action="store_const", const=1, dest="maxfail", help="the same as --maxfail 1"
    )
    group.add_argument("--allow-empty", action="store_true", help="exit with 0 even when no test was run")
    group.add_argument(
        "--feature", metavar="WORD", action="append", default=[], help="grant what tests require by a bare word"
    )
    group.add_argument(
        "--isolation",
        choices=("test", "suite", "none"),
        help="a process per test (default), per suite, or none, for debugging",
    )
    group.add_argument(
        "--debug",
        action="store_true",
        help="open the debugger at breakpoint() and where a test raises; one test at a time, without limits",
    )
    group.add_argument(
        "--core-dumps", action="store_true", help="keep core dumps of programs that crash with the files of their test"
    )


def _limits(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--timeout", metavar="S", type=seconds, help="limit of one run() where the suite says none (default 300)"
    )
    group.add_argument("--setup-timeout", metavar="S", type=seconds, help="limit of one setup() (default 60)")
    group.add_argument("--teardown-timeout", metavar="S", type=seconds, help="limit of one teardown() (default 30)")
    group.add_argument("--run-timeout", metavar="S", type=seconds, help="limit of the whole run")
    group.add_argument(
        "--grace",
        metavar="S",
        type=seconds,
        help="what a test that is stopped may take to react, before a kill (default 2)",
    )
    group.add_argument(
        "--memory",
        metavar="MIB",
        type=count,
        help="private memory a test may use (default: 3/4 of the machine's; 0: no limit)",
    )


def _robot(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--allow-motion",
        action="store_true",
        help="let tests move a real robot (a simulated one needs no permission); the operator is asked before each",
    )
    group.add_argument(
        "--answer",
        metavar="TEXT",
        help="answer operator questions with this, instead of asking ('default': their defaults)",
    )
    group.add_argument(
        "--wait",
        metavar="SECONDS",
        nargs="?",
        type=seconds,
        const=math.inf,
        default=0.0,
        help="wait for a robot that another run works with, at most so long (without SECONDS: until it is free)",
    )
    add_dialect(group)
    group.add_argument("--robot", metavar="NAME", default="", help="name of the robot, for the record")
    group.add_argument(
        "--station", metavar="NAME", default="", help="name of the test station, for the record (default: host name)"
    )
    add_device_options(group)


def add_report_options(group: argparse._ArgumentGroup) -> None:
    """Add the options that select reports; the run and the report command share them."""
    group.add_argument("-q", "--quiet", action="store_true", help="only what did not pass, and the verdict")
    group.add_argument(
        "-v", "--verbose", action="count", default=0, help="messages and measurements too; -vv: captured output too"
    )
    group.add_argument("-d", "--detail", action="store_true", help="file and line of each message")
    group.add_argument(
        "--style", choices=("console", "classic"), default="console", help="'classic' writes the C++ framework's lines"
    )
    group.add_argument(
        "--color",
        "--colour",
        choices=("auto", "always", "never"),
        default="auto",
        help="colours (default: on a terminal)",
    )
    group.add_argument("--no-summary", action="store_true", help="no summary at the end")
    group.add_argument("-o", "--output", metavar="FILE", help="result file (default: result.txt in the run's folder)")
    group.add_argument("--output-type", choices=("text", "junit"), default="text", help="what the result file is")
    group.add_argument("--no-output", action="store_true", help="no result file")
    formats = {"junit": "JUnit XML", "json": "our JSON record", "ctrf": "CTRF JSON", "html": "the page as one file"}
    for name, text in formats.items():
        group.add_argument(f"--{name}", metavar="FILE", help=f"write {text}")
    group.add_argument("--compare", metavar="RUN", help="show an earlier run beside this one in the page")
    group.add_argument(
        "--history",
        metavar="FILE",
        nargs="?",
        const="",
        help="put the run into the history of all runs, and show trends in the page (default file: the user's own)",
    )
    group.add_argument(
        "--junit-family",
        choices=("strict", "rich"),
        default="strict",
        help="'strict' is valid for Jenkins' xunit plug-in; 'rich' has properties and lines",
    )
    group.add_argument(
        "--report", metavar="NAME[=FILE]", action="append", default=[], help="any other reporter plug-in"
    )
    group.add_argument(
        "--runs", metavar="DIR", default="rtf-runs", help="where the folders of runs are made (default: rtf-runs)"
    )
    group.add_argument("--run-folder", metavar="DIR", help="the folder of this run (default: named by time and suite)")


def add_page_options(group: argparse._ArgumentGroup) -> None:
    """Add the options of the live page."""
    group.add_argument(
        "-w",
        "--web-reporter",
        action="store_true",
        help="serve it; report.html in the run's folder is what stays of it",
    )
    add_place_options(group)
    group.add_argument("--web-keep", action="store_true", help="leave it up when the run is over, until Ctrl-C")
