"""What all command lines share: a parser that ends with RTF's exit code, and the types of words."""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from typing import TYPE_CHECKING, NoReturn, TypeVar

from rtf import clock
from rtf.errors import RtfError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")
_LAST_PORT = 65535


class UsageError(RtfError, ValueError):
    """The command line asks for something that is not possible."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose usage errors end with RTF's exit code; its help ends with the text as it is written."""

    def __init__(self, *, prog: str, description: str, usage: str | None = None, epilog: str | None = None) -> None:
        super().__init__(
            prog=prog,
            usage=usage,
            description=description,
            epilog=epilog,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
            add_help=False,
        )
        self.add_argument("-?", "-h", "--help", action="help", help="show this text")

    def error(self, message: str) -> NoReturn:
        """Print usage and the error to stderr, and exit."""
        self.print_usage(sys.stderr)
        self.exit(int(ExitCode.USAGE), f"{self.prog}: {message}\nTry '{self.prog} --help'.\n")


def make_parser(word: str, description: str, example: str) -> Parser:
    """Return the parser of a command of ``rtf`` whose help ends with an example: commands, a line each."""
    epilog = "example:\n" + textwrap.indent(textwrap.dedent(example).strip(), "  ")
    parser = Parser(prog=f"rtf {word}", description="\n".join(textwrap.wrap(description, 100)), epilog=epilog)
    add_dialect(parser)
    return parser


def add_dialect(group: argparse._ActionsContainer) -> None:
    """Add the option that sets the dialect of this process and of the processes it starts, as RTF_DIALECT does."""
    group.add_argument(
        "--dialect",
        action=_SetDialect,
        choices=(3, 4),
        type=int,
        help="the major version of YARP that all ports speak (default: RTF_DIALECT, else each port is asked)",
    )


class _SetDialect(argparse.Action):
    """Sets the variable, because plug-ins, fixtures and their programs find the network by the environment."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,  # noqa: ARG002 - of the base class
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,  # noqa: ARG002
    ) -> None:
        setattr(namespace, self.dest, values)
        os.environ["RTF_DIALECT"] = str(values)


def key_value(text: str) -> tuple[str, str]:
    """Read ``key=value``."""
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form key=value")
    return key.strip(), value


def argument(read: Callable[[str], T]) -> Callable[[str], T]:
    """Return the reader of an option's value; the message of its ValueError is shown."""

    def convert(text: str) -> T:
        try:
            return read(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return convert


#: Reads a positive duration such as ``20``, ``500ms``, ``2min``.
seconds = argument(clock.read_duration)


def count(text: str) -> int:
    """Read a whole number, zero or more."""
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number") from None
    if number < 0:
        raise argparse.ArgumentTypeError(f"must not be negative, but is {text}")
    return number


def port(text: str) -> int:
    """Read the number of a port; 0 stands for any that is free."""
    number = count(text)
    if number > _LAST_PORT:
        raise argparse.ArgumentTypeError(f"{text} is no port; the last one is {_LAST_PORT}")
    return number


def add_place_options(group: argparse._ActionsContainer) -> None:
    """Add the options of the address at which a page is served."""
    group.add_argument(
        "--web-port", metavar="PORT", type=port, default=8080, help="its port (default 8080; 0: any that is free)"
    )
    group.add_argument(
        "--web-host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="the address it is served on (default 127.0.0.1: this machine only; 0.0.0.0: every network)",
    )


def parts(text: str) -> tuple[str, ...]:
    """Return the names of parts of a robot, which are separated by commas."""
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    if not names:
        raise argparse.ArgumentTypeError("write the names of parts, with commas between")
    return tuple(dict.fromkeys(names))
