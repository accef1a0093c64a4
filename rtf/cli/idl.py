"""``rtf idl``: check interface files, and write Python modules and documentation from them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import idl
from rtf.cli.parser import Parser, UsageError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.idl.program import Program


def _parser(name: str, what: str, example: str) -> Parser:
    parser = Parser(prog=f"rtf idl {name}", description=what, epilog=f"example:\n  {example}")
    parser.add_argument("file", metavar="FILE", type=Path, help="the .thrift file")
    parser.add_argument(
        "--include", metavar="DIR", type=Path, action="append", default=[], help="where included files are, too"
    )
    return parser


def check(words: Sequence[str]) -> ExitCode:
    """Say what is in a file, or what is wrong in it."""
    options = _parser("check", "Read a file, and say what is in it.", "rtf idl check adder.thrift").parse_args(words)
    program = idl.read(options.file, options.include)
    counts = {
        "services": len(program.services),
        "structures": len(program.structs),
        "enumerations": len(program.enums),
        "constants": len(program.constants),
    }
    said = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    print(f"{options.file} is in order: {said or 'it defines nothing'}")
    return ExitCode.PASSED


def py(words: Sequence[str]) -> ExitCode:
    """Write a Python module, to a folder or to the standard output."""
    parser = _parser(
        "py",
        "Write a Python module with all that a file defines: messages, services, their clients. What it includes is in "
        "the same module.",
        "rtf idl py adder.thrift -o .\n  from adder import AdderClient",
    )
    parser.add_argument("-o", "--output", metavar="DIR", type=Path, help="write DIR/NAME.py (default: standard output)")
    options = parser.parse_args(words)
    from rtf.idl.python import python_source

    program = idl.read(options.file, options.include)
    return _write(python_source(program), program, options.output, "py")


def md(words: Sequence[str]) -> ExitCode:
    """Write documentation as Markdown."""
    return _document("md", words)


def html(words: Sequence[str]) -> ExitCode:
    """Write documentation as a page."""
    return _document("html", words)


def _document(form: str, words: Sequence[str]) -> ExitCode:
    kind = {"md": "Markdown", "html": "a page in one file"}[form]
    parser = _parser(form, f"Write the documentation of a file as {kind}.", f"rtf idl {form} adder.thrift -o docs")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help=f"write DIR/NAME.{form} (default: standard output)"
    )
    options = parser.parse_args(words)
    from rtf.idl.documentation import document

    program = idl.read(options.file, options.include)
    return _write(document(program, form), program, options.output, form)


def _write(text: str, program: Program, folder: Path | None, suffix: str) -> ExitCode:
    if folder is None:
        sys.stdout.write(text)
        return ExitCode.PASSED
    path = folder / f"{program.name}.{suffix}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    print(f"wrote {path}")
    return ExitCode.PASSED
