"""Look into a plug-in without letting it near the process that asks: what it declares, and whether its values fit.

Each look happens in an isolated child that is given a limited time and then ended, with all that it started; a plug-in
that crashes or hangs while it is loaded is a finding, not an accident.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.testing import plugins
from rtf.testing.isolation.isolated_child import run_isolated
from rtf.testing.parameters import Declared, Parameter, ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.testing.plugins import PluginRef

#: Seconds a plug-in may take to load.
LOAD_LIMIT = 30.0


@dataclass(frozen=True, slots=True)
class Inspection:
    """What was found: the class, its text, its declarations (rows of strings), and every problem."""

    class_name: str = ""
    description: str = ""
    names: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    timeout: float | None = None
    parameters: tuple[dict[str, str], ...] = ()
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    values: tuple[dict[str, str], ...] = field(default=())


def inspect_plugin(ref: PluginRef, **values: Any) -> Inspection:  # whatever resolve_parameters takes
    """Load a plug-in and, with ``values`` (those of ``resolve_parameters``), try what would be given to it."""
    return inspect_uses(ref, [values])[0]


def inspect_uses(ref: PluginRef, uses: Sequence[dict[str, Any]]) -> list[Inspection]:
    """Load a plug-in once, and try what would be given to it at each of its uses.

    Each has a fresh test or fixture. When the process ends meanwhile, each use is looked at in a process of its own, so
    that the others have their findings.
    """
    answer = run_isolated(lambda: {"uses": [_look(ref, values or None) for values in uses]}, LOAD_LIMIT)
    if isinstance(answer, str):
        if len(uses) == 1:
            return [Inspection(problems=(answer,))]
        return [found for values in uses for found in inspect_uses(ref, [values])]
    return [_inspection(found) for found in answer["uses"]]


def _inspection(found: dict[str, Any]) -> Inspection:
    tupled: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in found.items()}
    return Inspection(**tupled)


def _look(ref: PluginRef, values: dict[str, Any] | None) -> dict[str, Any]:
    load: Callable[[PluginRef], Declared] = plugins.load_fixture if ref.kind == "fixture" else plugins.load_test
    try:
        plugin = load(ref)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever keeps a plug-in from loading is the finding
        return {"problems": [f"{type(error).__name__}: {error}"]}
    cls = type(plugin)
    found: dict[str, Any] = {
        "class_name": cls.__name__,
        "description": (cls.__doc__ or "").strip(),
        "names": [name for name in (getattr(cls, "plugin_name", ""), *getattr(cls, "aliases", ())) if name],
        "tags": list(getattr(cls, "tags", ())),
        "requires": list(getattr(cls, "requires", ())),
        "timeout": getattr(cls, "timeout", None),
        "parameters": [_row(parameter) for parameter in cls.parameter_table()],
    }
    if values is not None:
        try:
            found["values"] = plugin.resolve_parameters(**values)
        except ParameterError as error:
            found["problems"] = list(error.problems)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - likewise
            found["problems"] = [str(error)]
        found["warnings"] = list(plugin.parameter_warnings)
    return found


def _row(parameter: Parameter[Any]) -> dict[str, str]:
    return {
        "name": parameter.key,
        "aliases": ", ".join(parameter.aliases),
        "type": parameter.type_name,
        "unit": parameter.unit,
        "default": parameter.default_text(),
        "range": parameter.range_text(),
        "description": parameter.description,
    }


def describe_in_text(ref: PluginRef, found: Inspection) -> list[str]:
    """What a person wants to know of a plug-in, as lines."""
    title = found.class_name or Path(ref.path).name
    also = [name for name in found.names if name != title]
    others = f" (also: {', '.join(also)})" if also else ""
    lines = [f"{title}{others}", f"  {ref.path}"]
    lines += [f"  {line}".rstrip() for line in found.description.splitlines()]
    for label, words in (("tags", found.tags), ("requires", found.requires)):
        if words:
            lines.append(f"  {label}: {', '.join(words)}")
    if found.timeout:
        lines.append(f"  run() is given {found.timeout:g} s")
    lines += ["", *table(found.parameters)] if found.parameters else ["", "  no declared parameters"]
    return lines


def table(rows: tuple[dict[str, str], ...]) -> list[str]:
    """Rows of parameters as an aligned table; columns that are empty throughout are left out."""
    columns = [
        name for name in ("name", "type", "unit", "default", "range", "description") if any(row[name] for row in rows)
    ]
    widths = {name: max(len(name), *(len(row[name]) for row in rows)) for name in columns}
    lines = ["  " + "  ".join(name.ljust(widths[name]) for name in columns).rstrip()]
    lines.append("  " + "  ".join("-" * widths[name] for name in columns))
    lines += ["  " + "  ".join(row[name].ljust(widths[name]) for name in columns).rstrip() for row in rows]
    return lines


def markdown(found: Inspection) -> str:
    """The parameters as a Markdown table, for the documentation."""
    head = "| parameter | type | unit | default | range | meaning |\n| --- | --- | --- | --- | --- | --- |\n"
    rows = [
        f"| `{row['name']}` | {row['type']} | {row['unit']} | {value_cell(row['default'])} "
        f"| {row['range']} | {row['description']} |"
        for row in found.parameters
    ]
    return head + "\n".join(rows) + "\n"


def value_cell(text: str) -> str:
    """A default in a Markdown table."""
    return text if text in ("", "required") else f"`{text}`"
