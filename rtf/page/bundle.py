"""Bundling of the page's ES modules into one, in the order of their imports, for the page as a single file.

It removes ``import`` lines and the word ``export``, and changes nothing else. Code that this would break is refused,
with the line and a hint. It reads lines, not JavaScript: text at the left margin counts as top level, so the modules
indent everything inside braces, comments and templates.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtf.page.errors import PageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

_NAME = r"[\w$]+"
_IMPORT = re.compile(rf'import \{{ *({_NAME}(?: *, *{_NAME})*) *,? *\}} from "\./([\w.-]+)";\s*(?://.*)?')
_DECLARATION = re.compile(rf"(?:async\s+function|function|class|const|let|var)\b[\s*]*({_NAME}|[\[{{])")
_EXPORTED = re.compile(r"export (?=(?:async function|function|class|const)\b)")
_COMMENT = re.compile(r"\s*(?://|/\*|\*)")
_WHILE_IT_RUNS = re.compile(r"\bimport\s*[.(]")

_IMPORT_HINT = 'write it on one line at the left margin, as import { name } from "./module.js";'
_EXPORT_HINT = "write export at the left margin before the declaration of a function, class or const"


class BundleError(PageError, ValueError):
    """The modules cannot be joined, or the page cannot be a single file; the message has the line and a hint."""


@dataclass(slots=True)
class _Module:
    """A parsed module: its imports by line, its declarations and exports, and its text without them."""

    name: str
    imports: list[tuple[int, str, list[str]]] = field(default_factory=list)
    declared: dict[str, int] = field(default_factory=dict)
    exported: set[str] = field(default_factory=set)
    body: list[str] = field(default_factory=list)


def join_modules(sources: Mapping[str, str], entry: str) -> str:
    """Return the module ``entry`` with all modules that it imports before it. Raises BundleError.

    ``sources`` are the texts by file name; modules that are not imported are left out.
    """
    modules = _in_order(sources, entry)
    for module in modules.values():
        _check_imports(module, modules)
    _check_names(modules.values())
    return "\n".join(f"// {module.name}\n" + "\n".join(module.body).strip("\n") + "\n" for module in modules.values())


def _in_order(sources: Mapping[str, str], entry: str) -> dict[str, _Module]:
    """Return the needed modules, each after those that it imports."""
    done: dict[str, _Module] = {}
    underway: list[str] = []

    def visit(name: str, wanted_at: str) -> None:
        if name in done:
            return
        if name in underway:
            circle = " -> ".join([*underway[underway.index(name) :], name])
            raise BundleError(f"{wanted_at}: modules import each other in a circle, {circle}; move the common part")
        if name not in sources:
            raise BundleError(f"{wanted_at}: there is no module {name}")
        module = _read(name, sources[name])
        underway.append(name)
        for line, other, _ in module.imports:
            visit(other, f"{name}:{line}")
        underway.pop()
        done[name] = module

    visit(entry, "the page")
    return done


def _read(name: str, text: str) -> _Module:
    module = _Module(name)
    for number, line in enumerate(text.splitlines(), 1):
        place = f"{name}:{number}"
        if _COMMENT.match(line):
            module.body.append(line)
        elif _WHILE_IT_RUNS.search(line):
            raise BundleError(f"{place}: dynamic imports do not work in a single file; {_IMPORT_HINT}")
        elif re.match(r"\s*import\b", line):
            module.imports.append((number, *_import(line, place)))
        else:
            module.body.append(_without_export(module, line, number))
    return module


def _import(line: str, place: str) -> tuple[str, list[str]]:
    match = _IMPORT.fullmatch(line)
    if match is None:
        raise BundleError(f"{place}: this import cannot be removed: {line.strip()!r}; {_IMPORT_HINT}")
    return match[2], [name.strip() for name in match[1].split(",")]


def _without_export(module: _Module, line: str, number: int) -> str:
    """Return the line for the joined module, and note its declarations."""
    place = f"{module.name}:{number}"
    plain = _EXPORTED.sub("", line, count=1) if line.startswith("export ") else line
    if re.match(r"\s*export\b", plain):
        raise BundleError(f"{place}: this export cannot be removed: {line.strip()!r}; {_EXPORT_HINT}")
    match = _DECLARATION.match(plain)
    if match is None:
        return plain
    name = match[1]
    if name in "[{":
        raise BundleError(f"{place}: a declaration at the left margin names one thing; write one for each name")
    if name in module.declared:
        raise BundleError(f"{place}: {name} is declared at line {module.declared[name]} already; rename one")
    module.declared[name] = number
    if plain != line:
        module.exported.add(name)
    return plain


def _check_imports(module: _Module, modules: Mapping[str, _Module]) -> None:
    for line, other, names in module.imports:
        for name in names:
            if name not in modules[other].exported:
                raise BundleError(f"{module.name}:{line}: {other} does not export {name}")


def _check_names(modules: Iterable[_Module]) -> None:
    first: dict[str, str] = {}
    for module in modules:
        for name, line in module.declared.items():
            place = f"{module.name}:{line}"
            if name in first:
                raise BundleError(f"{place}: {name} is declared in {first[name]} already; rename one")
            first[name] = place
