"""What plug-ins say of themselves in the text of their files; nothing is run.

An attribute of a class is the value that its body sets, or else that of the classes it derives from, which are looked
for in its file and in the library. What cannot be told for certain is unknown, and the planner then loads the plug-in.
"""

from __future__ import annotations

import ast
import builtins
import re
import sys
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import rtf
from rtf.testing.plugin_spec import Matrix, PluginSpec, as_seconds, as_strings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.plugins import PluginRef

_LIBRARY = "rtf"
#: The classes that every plug-in derives from, which declare nothing.
_ROOTS = {f"rtf.testing.{name}" for name in ("TestCase", "case.TestCase", "FixtureManager", "fixture.FixtureManager")}
_DECLARING = re.compile(r"^\s+(plugin_name|aliases)\b|^class\s+(\w+)", re.MULTILINE)
#: What nobody sets, and what has to be computed.
_ABSENT, _UNKNOWN = object(), object()


class Source:
    """A file of Python: its classes, and what it has imported."""

    def __init__(self, tree: ast.Module) -> None:
        self.classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        self._set: dict[ast.ClassDef, dict[str, list[ast.AST]]] = {}
        self._imported: dict[str, str] = {}
        for node in tree.body:
            if isinstance(node, ast.Import):
                self._imported |= {(one.asname or one.name.partition(".")[0]): _bound(one) for one in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                self._imported |= {(one.asname or one.name): f"{node.module}.{one.name}" for one in node.names}

    def spec_of(self, node: ast.ClassDef) -> PluginSpec:
        """The description of a class of this file."""
        safety, matrix = self.value_of(node, "safety"), self.value_of(node, "matrix")
        occupies = self.value_of(node, "occupies")
        return PluginSpec(
            class_name=node.name,
            names=(*as_strings(self.value_of(node, "plugin_name")), *as_strings(self.value_of(node, "aliases"))),
            description=ast.get_docstring(node) or "",
            tags=as_strings(self.value_of(node, "tags")),
            requires=as_strings(self.value_of(node, "requires")),
            timeout=as_seconds(self.value_of(node, "timeout")),
            occupies=None if occupies is _UNKNOWN else occupies if isinstance(occupies, str) else "",
            safety="" if safety is _ABSENT else safety.lower() if isinstance(safety, str) else None,
            matrix=None if matrix is _UNKNOWN else matrix.axes if isinstance(matrix, Matrix) else (),
        )

    def value_of(self, node: ast.ClassDef, name: str) -> object:
        """The value of an attribute of a class of this file."""
        own = self._settings(node).get(name)
        if own:
            return _literal(own[0]) if len(own) == 1 else _UNKNOWN
        found = [value for base in node.bases if (value := self._value_of_base(base, node, name)) is not _ABSENT]
        if not found:
            return _ABSENT
        return found[0] if all(value == found[0] for value in found) else _UNKNOWN  # which one wins is Python's to say

    def _settings(self, node: ast.ClassDef) -> dict[str, list[ast.AST]]:
        if node not in self._set:
            self._set[node] = _settings_of(node.body)
        return self._set[node]

    @cached_property
    def declared(self) -> dict[str, ast.ClassDef]:
        """The plug-ins of this file by each of their names.

        A class whose name begins with ``_`` is none, nor is one that derives only from what comes with Python.
        """
        names: dict[str, ast.ClassDef] = {}
        for node in self.classes:
            if node.bases and not node.name.startswith("_") and not self._is_of_python(node):
                settings = self._settings(node)
                own = [*settings.get("plugin_name", ()), *settings.get("aliases", ())]
                also = [name for setting in own for name in as_strings(_literal(setting))]
                names |= dict.fromkeys((node.name, *also), node)
        return names

    def leaves(self) -> list[ast.ClassDef]:
        """The plug-ins that no other class of this file derives from."""
        bases = {self._look_up(base, node) for node in self.classes for base in node.bases}
        nodes = [node for node in dict.fromkeys(self.declared.values()) if node not in bases]
        return [node for node in nodes if len(nodes) == 1 or self.is_plugin(node) is not False]

    def is_plugin(self, node: ast.ClassDef) -> bool | None:
        """Whether a class derives from a root of plug-ins; None where a base is in a file that is not read."""
        found = {self._is_plugin_base(base, node) for base in node.bases}
        return True if True in found else None if None in found else False

    def _is_of_python(self, node: ast.ClassDef) -> bool:
        """Whether a class derives only from what comes with Python, such as NamedTuple, Enum or ValueError."""
        bases = (self._look_up(base, node) for base in node.bases)
        return all(self._is_of_python(it) if isinstance(it, ast.ClassDef) else _comes_with_python(it) for it in bases)

    def imported(self, name: str) -> str:
        """What a name stands for that the file has imported: module and name; empty if it has not."""
        return self._imported.get(name, "")

    def _is_plugin_base(self, base: ast.expr, node: ast.ClassDef) -> bool | None:
        found = self._look_up(base, node)
        if isinstance(found, ast.ClassDef):
            return self.is_plugin(found)
        if _comes_with_python(found):
            return False
        return True if found in _ROOTS else _in_library(found, "")[0]

    def _value_of_base(self, base: ast.expr, node: ast.ClassDef, name: str) -> object:
        found = self._look_up(base, node)
        if isinstance(found, ast.ClassDef):
            return self.value_of(found, name)
        return _ABSENT if _comes_with_python(found) or found in _ROOTS else _in_library(found, name)[1]

    def _look_up(self, base: ast.expr, node: ast.ClassDef) -> ast.ClassDef | str:
        """The class of this file that a base of ``node`` is, or its name with its module; empty if that is unclear."""
        if isinstance(base, ast.Subscript):
            base = base.value
        first, _, rest = _dotted(base).partition(".")
        if not rest:
            before = [one for one in self.classes if one.name == first and one.lineno < node.lineno]
            if before:
                return before[-1]
        imported = self.imported(first)
        if imported:
            return f"{imported}.{rest}" if rest else imported
        return first if not rest and isinstance(getattr(builtins, first, None), type) else ""


_NO_SOURCE = Source(ast.Module([], []))
_read: dict[tuple[str, int], Source] = {}


def source_of(path: Path) -> Source:
    """The file at a path; one that cannot be read declares nothing, which is said where the file is named."""
    key = (str(path), path.stat().st_mtime_ns)
    if key not in _read:
        try:
            text = path.read_text(encoding="utf-8")
            _read[key] = Source(ast.parse(text)) if _DECLARING.search(text) else _NO_SOURCE
        except (OSError, ValueError, SyntaxError):
            _read[key] = _NO_SOURCE
    return _read[key]


def declared_names(path: Path) -> dict[str, str]:
    """The names that a Python file declares for plug-ins, and the class of each."""
    return {name: node.name for name, node in source_of(path).declared.items()}


def specs_in(path: Path) -> list[PluginSpec]:
    """The description of each plug-in of a Python file, in the order of writing."""
    source = source_of(path)
    return [source.spec_of(node) for node in dict.fromkeys(source.declared.values())]


def spec_of(ref: PluginRef, bare_name: str = "") -> PluginSpec:
    """The description of a plug-in as far as its file's text tells; ``bare_name`` may be that of a class."""
    unknown = PluginSpec(safety=None, occupies=None, matrix=None)
    if ref.language == "entry point":
        return unknown
    if ref.language != "python":
        return PluginSpec()  # scripts and programs have no way to declare anything
    source = source_of(Path(ref.path))
    declared = source.declared
    node = declared.get(ref.class_name) or declared.get(bare_name)
    leaves = [node] if node is not None else source.leaves()
    if len(leaves) == 1:
        return source.spec_of(leaves[0])
    if leaves:
        certain = all(source.is_plugin(leaf) for leaf in leaves)
        return PluginSpec(safety=None, classes=tuple(leaf.name for leaf in leaves)) if certain else unknown
    of_old = any(node.name == "TestCase" for node in source.classes)  # a script of the C++ framework
    return PluginSpec(safety=None) if of_old else unknown


def _dotted(node: ast.expr) -> str:
    if isinstance(node, ast.Name):
        return node.id
    return f"{_dotted(node.value)}.{node.attr}" if isinstance(node, ast.Attribute) else ""


def _bound(name: ast.alias) -> str:
    """What ``import a.b`` and ``import a.b as c`` bind: the first package, and the module."""
    return name.name if name.asname else name.name.partition(".")[0]


def _settings_of(body: list[ast.stmt]) -> dict[str, list[ast.AST]]:
    """Each place in the body of a class that sets an attribute: the value where that is plain, or what sets it."""
    found: dict[str, list[ast.AST]] = {}
    for statement in body:
        if isinstance(statement, ast.AnnAssign) and statement.value is None:
            continue
        value: ast.AST = statement
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None:
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            value = statement.value if all(isinstance(target, ast.Name) for target in targets) else statement
        for inner in _within(statement):
            name = inner.id if isinstance(inner, ast.Name) else getattr(inner, "name", None)
            if isinstance(name, str) and not isinstance(getattr(inner, "ctx", None), ast.Load):
                found.setdefault(name, []).append(value)
    return found


def _within(node: ast.AST) -> Iterator[ast.AST]:
    """A statement and its parts, without the inside of functions and classes."""
    yield node
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
        for child in ast.iter_child_nodes(node):
            yield from _within(child)


def _literal(node: ast.AST) -> object:
    """A plain value, the name of a member of an enumeration, such as Safety.MOTION, or a matrix of plain values."""
    called = _dotted(node.func).rpartition(".")[2] if isinstance(node, ast.Call) else ""
    if called == "Parameter":
        return None  # a parameter of that name, which is no fact
    try:
        if isinstance(node, ast.Call) and called == "Matrix" and not node.args:
            return Matrix(**{word.arg or "": ast.literal_eval(word.value) for word in node.keywords})
        return ast.literal_eval(node) if isinstance(node, ast.expr) else _UNKNOWN
    except (ValueError, TypeError):
        return node.attr if isinstance(node, ast.Attribute) and node.attr.isupper() else _UNKNOWN


def _comes_with_python(name: str) -> bool:
    module, _, last = name.rpartition(".")
    return bool(last) and (not module or module.partition(".")[0] in sys.stdlib_module_names)


@cache
def _in_library(name: str, attribute: str) -> tuple[bool | None, object]:
    """Whether a class of the library is a plug-in, and an attribute of it, whichever module it is imported from."""
    if name in _ROOTS:
        return True, _ABSENT
    module, _, last = name.rpartition(".")
    source = _library_source(module)
    if source is None:
        return None, _UNKNOWN
    for node in source.classes:
        if node.name == last:
            return source.is_plugin(node), source.value_of(node, attribute)
    elsewhere = source.imported(last)
    return _in_library(elsewhere, attribute) if elsewhere else (None, _UNKNOWN)


@cache
def _library_source(module: str) -> Source | None:
    first, *rest = module.split(".")
    if first != _LIBRARY:
        return None
    place = Path(rtf.__file__).parent.joinpath(*rest)
    for path in (place.with_suffix(".py"), place / "__init__.py"):
        if path.is_file():
            return Source(ast.parse(path.read_text(encoding="utf-8")))
    return None
