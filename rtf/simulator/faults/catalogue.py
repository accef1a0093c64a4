"""The list of the kinds of faults: as text, as a Markdown table, as plain data for JSON."""

from __future__ import annotations

import textwrap
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rtf.simulator.faults.base import Layer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.simulator.faults.base import Fault, Parameter

_WIDTH = 110


def facts(kind: type[Fault]) -> dict[str, Any]:
    """Return the facts of a kind, in types that JSON has."""
    return {
        "kind": kind.kind,
        "layer": kind.layer.value,
        "target": kind.target_kind.value,
        "parameters": [asdict(one) for one in kind.parameters],
        "description": kind.description,
        "symptom": kind.symptom,
    }


def as_text(kinds: Iterable[type[Fault]]) -> str:
    """Return a paragraph for each kind, by layer."""
    lines = []
    for layer, members in _by_layer(kinds):
        lines.append(f"{layer.value.upper()}")
        for kind in members:
            lines.append(f"  {kind.kind}  ({kind.target_kind.value})")
            lines += textwrap.wrap(
                f"{kind.description} {kind.symptom}", _WIDTH, initial_indent=" " * 6, subsequent_indent=" " * 6
            )
            lines += [f"      {one.name}={_amount(one)}: {one.description}; {_range(one)}" for one in kind.parameters]
        lines.append("")
    return "\n".join(lines)


def as_markdown(kinds: Iterable[type[Fault]]) -> str:
    """Return a Markdown table for each layer."""
    lines = []
    for layer, members in _by_layer(kinds):
        lines += [
            f"### {layer.value.capitalize()}",
            "",
            "| kind | target | parameters | defect, and *symptom* |",
        ]
        lines += ["| --- | --- | --- | --- |"]
        for kind in members:
            parameters = "<br>".join(
                f"`{one.name}` = {_amount(one)}: {one.description} ({_range(one)})" for one in kind.parameters
            )
            target = kind.target_kind.name.lower().replace("_", "-")
            lines.append(f"| `{kind.kind}` | {target} | {parameters} | {kind.description} *{kind.symptom}* |")
        lines.append("")
    return "\n".join(lines)


def _by_layer(kinds: Iterable[type[Fault]]) -> list[tuple[Layer, list[type[Fault]]]]:
    kinds = list(kinds)
    found = [(layer, [kind for kind in kinds if kind.layer is layer]) for layer in Layer]
    return [(layer, members) for layer, members in found if members]


def _amount(one: Parameter) -> str:
    return f"{one.default:g} {one.unit}".strip()


def _range(one: Parameter) -> str:
    return f"{one.minimum:g} … {one.maximum:g}"
