"""``testrunner describe``: the list of plug-ins, and the description of one."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.plugin_spec import ParameterSpec, PluginSpec
    from rtf.testing.plugins import PluginRef


def describe(words: Sequence[str]) -> ExitCode:
    """Print the description of a plug-in, and its parameters."""
    from rtf.testing import plugins
    from rtf.testing.inspection import inspect_plugin, inspect_plugins

    parser = Parser(
        prog="testrunner describe",
        description="Which tests or fixtures there are; or of one, by its name, what it is for and its parameters.",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="name or file of a plug-in; without it all are listed")
    parser.add_argument("--fixture", action="store_true", help="fixture managers, not tests")
    parser.add_argument("--markdown", action="store_true", help="the parameters as a Markdown table")
    options = parser.parse_args(words)
    kind = "fixture" if options.fixture else "test"
    if options.name is None:
        return _list_plugins(kind)
    ref = plugins.find(kind, options.name, beside=Path.cwd())
    whole = inspect_plugin(ref)
    classes = inspect_plugins({ref._replace(class_name=name): () for name in whole.spec.classes})
    for found in classes.values() or [whole]:
        if found.problems:
            print(f"{ref.path}: {'; '.join(found.problems)}", file=sys.stderr)
            return ExitCode.USAGE
        print(_markdown(found.spec) if options.markdown else "\n".join(_in_text(ref, found.spec)))
    return ExitCode.PASSED


def _list_plugins(kind: str) -> ExitCode:
    from rtf.testing import plugin_source, plugins

    for path in plugins.all_files(kind, Path.cwd()):
        for spec in plugin_source.specs_in(path):
            print(f"{spec.class_name}  {spec.summary}")
    return ExitCode.PASSED


def _in_text(ref: PluginRef, spec: PluginSpec) -> list[str]:
    """Return the description for a terminal, as lines."""
    title = spec.class_name or Path(ref.path).name
    also = [name for name in spec.names if name != title]
    others = f" (also: {', '.join(also)})" if also else ""
    lines = [f"{title}{others}", f"  {ref.path}"]
    if spec.safety:
        lines.append(f"  safety: {spec.safety}")
    lines += [f"  {line}".rstrip() for line in spec.description.splitlines()]
    for label, words in (("tags", spec.tags), ("requires", spec.requires)):
        if words:
            lines.append(f"  {label}: {', '.join(words)}")
    if spec.timeout:
        lines.append(f"  run() is given {spec.timeout:g} s")
    lines += [f"  matrix: {axis.name} = {', '.join(axis.labels)}" for axis in spec.matrix]
    return [*lines, "", *(_table(spec.parameters) if spec.parameters else ["  no declared parameters"])]


def _table(rows: Sequence[ParameterSpec]) -> list[str]:
    """Return parameters as an aligned table; columns that are empty throughout are left out."""
    columns = ("name", "type", "unit", "default", "range", "description")
    padded = []
    for column in columns:
        words = [str(getattr(row, column)) for row in rows]
        if any(words):
            width = max(map(len, (column, *words)))
            padded.append([word.ljust(width) for word in (column, "-" * width, *words)])
    return ["  " + "  ".join(line).rstrip() for line in zip(*padded, strict=True)]


def _markdown(spec: PluginSpec) -> str:
    """Return the parameters as a Markdown table, for the documentation."""
    head = "| parameter | type | unit | default | range | meaning |\n| --- | --- | --- | --- | --- | --- |\n"
    rows = [
        f"| `{row.name}` | {row.type} | {row.unit} | {_value_cell(row.default)} | {row.range} | {row.description} |"
        for row in spec.parameters
    ]
    return head + "\n".join(rows) + "\n"


def _value_cell(text: str) -> str:
    return text if text in ("", "required") else f"`{text}`"
