"""What a class does to its surroundings, its ``safety``, as far as its source says; nothing is run.

Its own word counts, or else that of the classes it derives from, which are looked for in its file and in the library.
What cannot be told for certain is unknown (None), and whoever asks has to take it for the worst.
"""

from __future__ import annotations

import ast
import builtins
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import rtf

if TYPE_CHECKING:
    from collections.abc import Iterator

_SAFETY = "safety"
#: The classes of safety of tests that move nothing; most tests declare none.
_HARMLESS = ("", "still")
_LIBRARY = "rtf"
#: The class that every test derives from, which declares none.
_TEST_CASE = ("rtf.testing.TestCase", "rtf.testing.case.TestCase")


def may_move(safety: object) -> bool:
    """Whether a test with this ``safety``, a word, a member of an enumeration or None, may move something."""
    return str(getattr(safety, "name", safety)).lower() not in _HARMLESS


class Source:
    """A file of Python: its classes, and what it has imported."""

    def __init__(self, tree: ast.Module) -> None:
        self.classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        self._imported: dict[str, str] = {}
        for node in tree.body:
            if isinstance(node, ast.Import):
                self._imported |= {(one.asname or one.name.partition(".")[0]): _bound(one) for one in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                self._imported |= {(one.asname or one.name): f"{node.module}.{one.name}" for one in node.names}

    def safety_of(self, node: ast.ClassDef) -> str | None:
        """The word of a class of this file, in small letters; empty if there is none, None if it cannot be told."""
        own = [*_settings_of(node.body)]
        if own:
            return _word(own[0]) if len(own) == 1 else None
        words = {self._safety_of_base(base, node) for base in node.bases} - {""}
        if not words:
            return ""
        return words.pop() if len(words) == 1 else None  # which one wins is Python's to say

    def is_no_test(self, node: ast.ClassDef) -> bool:
        """Whether a class derives only from what comes with Python, such as NamedTuple, Enum or ValueError."""
        for base in node.bases:
            found = self._look_up(base, node)
            plain = self.is_no_test(found) if isinstance(found, ast.ClassDef) else _comes_with_python(found)
            if not plain:
                return False
        return True

    def imported(self, name: str) -> str:
        """What a name stands for that the file has imported: module and name; empty if it has not."""
        return self._imported.get(name, "")

    def _safety_of_base(self, base: ast.expr, node: ast.ClassDef) -> str | None:
        found = self._look_up(base, node)
        if isinstance(found, ast.ClassDef):
            return self.safety_of(found)
        return "" if _comes_with_python(found) else _safety_in_library(found)

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


def _dotted(node: ast.expr) -> str:
    if isinstance(node, ast.Name):
        return node.id
    return f"{_dotted(node.value)}.{node.attr}" if isinstance(node, ast.Attribute) else ""


def _bound(name: ast.alias) -> str:
    """What ``import a.b`` and ``import a.b as c`` bind: the first package, and the module."""
    return name.name if name.asname else name.name.partition(".")[0]


def _settings_of(body: list[ast.stmt]) -> Iterator[ast.stmt | ast.expr]:
    """Each place in the body of a class where ``safety`` is set: the value where that is plain, or what sets it."""
    for statement in body:
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            if any(_is_safety(target) for target in targets):
                if statement.value is not None:
                    yield statement.value
                continue
        if any(_is_safety(inner) for inner in _within(statement)):
            yield statement


def _within(node: ast.AST) -> Iterator[ast.AST]:
    """A statement and its parts, without the inside of functions and classes."""
    yield node
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
        for child in ast.iter_child_nodes(node):
            yield from _within(child)


def _is_safety(node: ast.AST) -> bool:
    if isinstance(node, ast.Name):
        return node.id == _SAFETY and isinstance(node.ctx, ast.Store)
    return getattr(node, "name", None) == _SAFETY


def _word(value: ast.AST) -> str | None:
    """A word, or that of a member of an enumeration, such as Safety.MOTION; None where it has to be computed."""
    if isinstance(value, ast.Constant) and isinstance(value.value, str):
        return value.value.lower()
    return value.attr.lower() if isinstance(value, ast.Attribute) and value.attr.isupper() else None


def _comes_with_python(name: str) -> bool:
    module, _, last = name.rpartition(".")
    return bool(last) and (not module or module.partition(".")[0] in sys.stdlib_module_names)


@cache
def _safety_in_library(name: str) -> str | None:
    """The word of a class of the library by its name, whichever module it is imported from."""
    if name in _TEST_CASE:
        return ""
    module, _, last = name.rpartition(".")
    source = _library_source(module)
    if source is None:
        return None
    for node in source.classes:
        if node.name == last:
            return source.safety_of(node)
    elsewhere = source.imported(last)
    return _safety_in_library(elsewhere) if elsewhere else None


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
