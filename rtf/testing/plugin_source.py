"""The description of plug-ins from the text of their files; nothing is run.

An attribute of a class is the value that its body sets, or else that of the classes it derives from, which are looked
up in its file and in the library. What is not certain is unknown, and the planner then loads the plug-in.
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
from rtf.testing.plugin_spec import ABSENT, UNCERTAIN, Matrix, ParameterSpec, PluginSpec, as_strings, make_spec

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_LIBRARY = "rtf"
#: The classes that every plug-in derives from, which declare nothing.
_ROOTS = {f"rtf.testing.{name}" for name in ("TestCase", "case.TestCase", "FixtureManager", "fixture.FixtureManager")}
_PLAIN = (ast.Assign, ast.AnnAssign, ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Expr, ast.Pass)
_DECLARING = re.compile(r"^\s+(plugin_name|aliases)\b|^class\s+(\w+)", re.MULTILINE)


class ClassText:
    """A class as it is written: ``bases`` are classes of its file, or names with their modules, empty if unclear."""

    def __init__(self, node: ast.ClassDef, bases: Sequence[ClassText | str]) -> None:
        self.name = node.name
        self.own_bases = bases
        self._node = node

    @cached_property
    def is_plugin(self) -> bool | None:
        """Whether the class derives from a root of plug-ins; None where a base is in a file that is not read."""
        found = {base.is_plugin for base in self._bases}
        return True if True in found else None if None in found else False

    @cached_property
    def is_of_python(self) -> bool:
        """Return whether it derives only from Python's own classes, such as NamedTuple, Enum or ValueError."""
        return all(_comes_with_python(one) if isinstance(one, str) else one.is_of_python for one in self.own_bases)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All names that mean this plug-in."""
        own = [self._settings.get(name) for name in ("plugin_name", "aliases")]
        return (self.name, *(name for value in own for name in as_strings(value)))

    def value(self, name: str) -> object:
        """The value of an attribute."""
        if name in self._settings:
            return self._settings[name]
        if not self._is_plain:
            return UNCERTAIN
        found = [value for base in self._bases if (value := base.value(name)) is not ABSENT]
        if not found:
            return ABSENT
        return found[0] if all(value == found[0] for value in found) else UNCERTAIN  # which one wins is Python's to say

    def spec(self) -> PluginSpec:
        """The description of the plug-in."""
        return make_spec(self.name, ast.get_docstring(self._node) or "", self.value, self.parameters)

    @cached_property
    def parameters(self) -> tuple[ParameterSpec, ...]:
        """Return the parameters that the class and its bases declare, as far as the planner needs them."""
        own = [parameter for statement in self._node.body for parameter in _declared_by(statement)]
        return (*(parameter for base in self._bases for parameter in base.parameters), *own)

    @cached_property
    def _bases(self) -> list[ClassText]:
        return [_class_named(base) if isinstance(base, str) else base for base in self.own_bases]

    @cached_property
    def _is_plain(self) -> bool:
        """Return whether the body sets attributes by nothing but assignments and definitions."""
        return all(isinstance(statement, _PLAIN) for statement in self._node.body)

    @cached_property
    def _settings(self) -> dict[str, object]:
        """Return the value that the body gives to each attribute."""
        found: dict[str, object] = {}
        for statement in self._node.body:
            value: object = UNCERTAIN
            names: list[str | None] = [getattr(statement, "name", None)]
            if isinstance(statement, ast.Assign | ast.AnnAssign):
                targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
                names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
                if statement.value is None:  # only the type is said
                    continue
                if all(isinstance(target, ast.Name) for target in targets):
                    value = _literal(statement.value)
            found |= {name: UNCERTAIN if name in found else value for name in names if name is not None}
        return found


class _Elsewhere(ClassText):
    """A class whose text is not read: it is a plug-in or not, and each of its attributes has the same value."""

    def __init__(self, *, is_plugin: bool | None, value: object) -> None:
        self.is_plugin = is_plugin
        self.parameters: tuple[ParameterSpec, ...] = ()
        self._value = value

    def value(self, name: str) -> object:  # noqa: ARG002 - it is the same for all
        return self._value


_ROOT = _Elsewhere(is_plugin=True, value=ABSENT)
_OF_PYTHON = _Elsewhere(is_plugin=False, value=ABSENT)
_UNREAD = _Elsewhere(is_plugin=None, value=UNCERTAIN)


class Source:
    """A file of Python: its classes in the order of writing, its imports by name, and the modules they are from."""

    def __init__(self, tree: ast.Module) -> None:
        self.imported: dict[str, str] = {}
        self.modules: list[str] = []
        for node in tree.body:
            if isinstance(node, ast.Import):
                self.imported |= {(one.asname or one.name.partition(".")[0]): _bound(one) for one in node.names}
                self.modules += [one.name for one in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                self.imported |= {(one.asname or one.name): f"{node.module}.{one.name}" for one in node.names}
                self.modules.append(node.module or "")
        self.classes: list[ClassText] = []
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                self.classes.append(ClassText(node, [self._look_up(base) for base in node.bases]))

    @cached_property
    def plugins(self) -> list[ClassText]:
        """The classes that may be plug-ins: not those with a private name, nor those of Python."""
        return [one for one in self.classes if one.own_bases and one.name[0] != "_" and not one.is_of_python]

    @cached_property
    def declared(self) -> dict[str, ClassText]:
        """The plug-ins of this file by each of their names."""
        return {name: one for one in self.plugins for name in one.names}

    def leaves(self) -> list[ClassText]:
        """The plug-ins that no other class of this file derives from."""
        bases = [base for one in self.classes for base in one.own_bases]
        found = [one for one in self.plugins if one not in bases]
        return [one for one in found if len(found) == 1 or one.is_plugin is not False]

    def _look_up(self, base: ast.expr) -> ClassText | str:
        """Return the class of this file that a base is, or its name with its module; empty if that is unclear."""
        first, _, rest = _dotted(base).partition(".")
        before = [] if rest else [one for one in self.classes if one.name == first]
        if before:
            return before[-1]
        imported = self.imported.get(first)
        if imported:
            return f"{imported}.{rest}" if rest else imported
        return first if not rest and isinstance(getattr(builtins, first, None), type) else ""


_NO_SOURCE = Source(ast.Module([], []))
_read: dict[tuple[str, int], Source] = {}


def source_of(path: Path) -> Source:
    """Return the file at a path; one that cannot be read declares nothing, which is reported where the file is used."""
    key = (str(path), path.stat().st_mtime_ns)
    if key not in _read:
        try:
            text = path.read_text(encoding="utf-8")
            _read[key] = Source(ast.parse(text)) if _DECLARING.search(text) else _NO_SOURCE
        except (OSError, ValueError, SyntaxError):
            _read[key] = _NO_SOURCE
    return _read[key]


def declared_names(path: Path) -> dict[str, str]:
    """Return the names that a Python file declares for plug-ins, and the class of each."""
    return {name: one.name for name, one in source_of(path).declared.items()}


def library_modules(path: Path) -> list[str]:
    """Return the modules of this library that a Python file imports when it is loaded, as far as they exist.

    Importing them runs no code of the plug-in's author.
    """
    return [module for module in source_of(path).modules if _library_file(module) is not None]


def specs_in(path: Path) -> list[PluginSpec]:
    """Return the description of each plug-in of a Python file, in the order of writing."""
    return [one.spec() for one in source_of(path).plugins]


def bare_name(name: str) -> str:
    """Return the name without folder and without a shared library's ending."""
    stem = Path(name).name
    return stem[: -len(Path(stem).suffix)] if Path(stem).suffix.lower() in {".so", ".dll", ".py"} else stem


def _dotted(node: ast.expr) -> str:
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Subscript):
        return _dotted(node.value)
    return f"{_dotted(node.value)}.{node.attr}" if isinstance(node, ast.Attribute) else ""


def _bound(name: ast.alias) -> str:
    """What ``import a.b`` and ``import a.b as c`` bind: the first package, and the module."""
    return name.name if name.asname else name.name.partition(".")[0]


def _literal(node: ast.expr) -> object:
    """Return a plain value, the name of an enumeration's member, such as Safety.MOTION, or a matrix of plain values."""
    called = _dotted(node.func).rpartition(".")[2] if isinstance(node, ast.Call) else ""
    if called == "Parameter":
        return None  # a parameter of that name, which is no fact
    try:
        if isinstance(node, ast.Call) and called == "Matrix" and not node.args:
            return Matrix(**{word.arg or "": ast.literal_eval(word.value) for word in node.keywords})
        return ast.literal_eval(node)
    except (ValueError, TypeError):
        return node.attr if isinstance(node, ast.Attribute) and node.attr.isupper() else UNCERTAIN


def _declared_by(statement: ast.stmt) -> Iterator[ParameterSpec]:
    """The parameter that a statement declares, if it declares one."""
    if isinstance(statement, ast.Assign | ast.AnnAssign) and isinstance(statement.value, ast.Call):
        words = {word.arg: _literal(word.value) for word in statement.value.keywords}
        target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
        if isinstance(target, ast.Name) and _dotted(statement.value.func).rpartition(".")[2] == "Parameter":
            (key,) = as_strings(words.get("key")) or ("",)
            secret = words.get("secret") not in (None, False)
            yield ParameterSpec.declared(target.id, key, as_strings(words.get("aliases")), secret=secret)


def _comes_with_python(name: str) -> bool:
    module, _, last = name.rpartition(".")
    return bool(last) and (not module or module.partition(".")[0] in sys.stdlib_module_names)


@cache
def _class_named(name: str) -> ClassText:
    """Return the class of a name with its module, from whichever module of the library it is imported."""
    if name in _ROOTS:
        return _ROOT
    if _comes_with_python(name):
        return _OF_PYTHON
    module, _, last = name.rpartition(".")
    source = _library_source(module)
    found = [one for one in source.classes if one.name == last]
    if found:
        return found[0]
    elsewhere = source.imported.get(last)
    return _class_named(elsewhere) if elsewhere else _UNREAD


@cache
def _library_source(module: str) -> Source:
    path = _library_file(module)
    return _NO_SOURCE if path is None else Source(ast.parse(path.read_text(encoding="utf-8")))


@cache
def _library_file(module: str) -> Path | None:
    """Return the file of a module of this library; None if there is no such module."""
    first, *rest = module.split(".")
    place = Path(rtf.__file__).parent.joinpath(*rest)
    paths = (place.with_suffix(".py"), place / "__init__.py") if first == _LIBRARY else ()
    return next((path for path in paths if path.is_file()), None)
