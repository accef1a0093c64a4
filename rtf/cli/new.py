"""``rtf new``: write a test, a fixture, a suite or a robot to begin with, each with a test that passes."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, UsageError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

#: The kinds, what each writes, and the file that is run first.
KINDS = {
    "test": ("a test", "{name}.py"),
    "fixture": ("a fixture, a test of it, and a suite of both", "{name}.xml"),
    "suite": ("a suite, and a test in it", "{name}.xml"),
    "robot": ("suites/robots/NAME: a configuration for robotinterface, a suite and a test", "{name}_suite.xml"),
}
_TEMPLATES = Path(__file__).parent / "templates"
_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def new(words: Sequence[str]) -> ExitCode:
    """Write the files of a kind; prints them, and the command that runs them."""
    kinds = "\n".join(f"  {kind:<9} {what}" for kind, (what, _) in KINDS.items())
    parser = Parser(
        prog="rtf new",
        description="Write files to begin with. A test that passes is among them; what exists is not overwritten.",
        epilog=f"kinds:\n{kinds}\n\nexample:\n  rtf new test left_elbow && testrunner left_elbow.py",
    )
    parser.add_argument("kind", metavar="KIND", choices=KINDS, help=", ".join(KINDS))
    parser.add_argument("name", metavar="NAME", type=_name, help="letters, digits and '_', such as left_elbow")
    parser.add_argument("--folder", metavar="DIR", type=Path, help="where (default: here; robots: suites/robots/NAME)")
    options = parser.parse_args(words)
    folder = options.folder
    if folder is None:
        folder = Path("suites", "robots", options.name) if options.kind == "robot" else Path()
    for path in _write(options.kind, options.name, folder):
        print(f"wrote {path}")
    print(f"Next: testrunner {folder / KINDS[options.kind][1].format(name=options.name)}")
    return ExitCode.PASSED


def _name(text: str) -> str:
    if not _WORD.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r} cannot be used; write a letter, then letters, digits or '_'")
    return text


def _write(kind: str, name: str, folder: Path) -> list[Path]:
    """Write all files of a kind, or none if one of them exists. Raises UsageError."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    values = {
        "name": name,
        "title": name.replace("_", " ").strip().capitalize(),
        "class_name": "".join(part[0].upper() + part[1:] for part in name.split("_") if part),
        "variable": f"{name.upper()}_FOLDER",
    }
    templates = Environment(  # noqa: S701 - the name is checked, and no template is a web page
        loader=FileSystemLoader(_TEMPLATES / kind), undefined=StrictUndefined, keep_trailing_newline=True
    )
    texts = {
        folder / template.removesuffix(".j2").replace("NAME", name): templates.get_template(template).render(values)
        for template in templates.list_templates(extensions=["j2"])
    }
    existing = [str(path) for path in texts if path.exists()]
    if existing:
        raise UsageError(f"{', '.join(existing)} exists already, and nothing was written")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in texts.items():
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
    except OSError as error:
        raise UsageError(f"{error.filename}: {error.strerror}") from None
    return [*texts]
