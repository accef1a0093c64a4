"""Find a plug-in by name along the search path, and load it.

A plug-in is a file. A name in a suite is resolved without running any of it: a path relative to the suite's folder, a
file of that name, or a Python file that declares the name or an alias, in this order, folder by folder. A script in Lua
of old suites may so be a Python file that has its name, with ``.lua``, as an alias. The folders:

1. the suite's folder,
2. each folder of ``RTF_PLUGIN_PATH`` (separated by ``:``),
3. the user's plug-in folder,
4. the folders that ship with RTF,
5. entry points of installed packages, in the group of the kind (:data:`GROUPS`).

The file is loaded, in the process that needs it, as ``rtf_plugins.<kind>.<stem>``. Reporters, kinds of faults, devices
of robots and deployers of applications are found and loaded in the same way. Languages, the types of tests whose files
they load, are entry points alone.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import rtf
from rtf.testing.plugin_source import bare_name, declared_names, source_of
from rtf.testing.plugin_spec import PluginSpec
from rtf.testing.verdict import TestingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from importlib.metadata import EntryPoint
    from types import ModuleType

P = TypeVar("P", bound=object)

#: The folder of each kind of plug-in, and its group of entry points.
FOLDERS = {
    "test": "icub_tests",
    "fixture": "fixtures",
    "report": "reports",
    "fault": "faults",
    "device": "devices",
    "deployer": "deployers",
}
GROUPS = {
    "test": "rtf.tests",
    "fixture": "rtf.fixtures",
    "report": "rtf.reporters",
    "fault": "rtf.faults",
    "language": "rtf.languages",
    "device": "rtf.devices",
    "deployer": "rtf.deployers",
}

#: The modules of all plug-ins begin with it.
PLUGINS = "rtf_plugins."
#: The variable that says in which folders plug-ins of which kind are, for ``rtf_plugins``; and the folder of that.
IMPORTABLE = "RTF_PLUGIN_FOLDERS"
_PACKAGES = str(Path(rtf.__file__).parent / "testing" / "packages")

#: The types a suite may name, and the language each means. ``dll`` is the C++ framework's word for a compiled plug-in;
#: here it is the Python plug-in that declares the name.
LANGUAGES = {
    "python": "python",
    "py": "python",
    "dll": "python",
    "lua": "lua",
    "executable": "executable",
    "exe": "executable",
    "tap": "executable:tap",
    "gtest": "executable:junit",
    "junit": "executable:junit",
    "exit": "executable:exit",
}
_SUFFIXES = {".py": "python", ".lua": "lua"}


class PluginError(TestingError, ImportError):
    """A plug-in was found and cannot be loaded."""


class PluginNotFoundError(PluginError):
    """No file has a name; ``tried`` lists every place in order."""

    def __init__(self, text: str, tried: Iterable[str] = ()) -> None:
        super().__init__(text)
        self.tried = tuple(tried)

    def __str__(self) -> str:
        """The sentence, then the places tried, a line each."""
        return "\n".join([super().__str__(), *(f"  tried {place}" for place in self.tried)])


class PluginRef(NamedTuple):
    """A plug-in that was found: its language (with ``:mode`` for executables), file, and class where it is known."""

    kind: str
    name: str
    path: str
    language: str
    class_name: str = ""


def shipped_folder(kind: str) -> Path:
    """The folder of the plug-ins of one kind that come with RTF: inside the package, or beside it in a checkout."""
    package = Path(rtf.__file__).parent
    folder = FOLDERS.get(kind, kind)
    inside = package / "shipped" / folder
    return inside if inside.is_dir() else package.parent / folder


def search_path(kind: str, beside: Path | None, environ: Mapping[str, str] | None = None) -> Iterator[Path]:
    """Yield the folders in which a plug-in is looked for, in order."""
    environ = os.environ if environ is None else environ
    if beside is not None:
        yield beside
    for word in environ.get("RTF_PLUGIN_PATH", "").split(":"):
        if word:
            yield Path(word).expanduser()
    yield user_folder(kind)
    yield shipped_folder(kind)


def user_folder(kind: str) -> Path:
    """The folder of the user's own plug-ins of one kind."""
    import platformdirs

    return Path(platformdirs.user_data_dir("rtf", appauthor=False)) / FOLDERS[kind]


def find(kind: str, name: str, type_: str | None = None, *, beside: Path | None = None) -> PluginRef:
    """Find the plug-in that a suite's ``name`` and ``type`` mean; raises PluginNotFoundError with all places tried.

    ``beside`` is the suite's folder. ``file.py::Class`` means one class of a file. No plug-in's code is run.
    """
    name = os.path.expandvars(os.path.expanduser(name.strip()))  # noqa: PTH111 - the name may be no path
    if not name:
        raise PluginNotFoundError("a plug-in needs a name")
    file, separator, class_name = name.partition("::")
    if separator:
        return _with_class(find(kind, file, type_, beside=beside), class_name)
    tried: list[str] = []
    for place, found in _look(kind, name, _language(type_, name), beside):
        if found is not None:
            return found
        tried.append(place)
    of_type = f" of type {type_!r}" if type_ else ""
    raise PluginNotFoundError(f"no {kind} plug-in {name!r}{of_type}{_near_names(kind, name, beside)}", tried)


def _with_class(ref: PluginRef, class_name: str) -> PluginRef:
    declared = declared_names(Path(ref.path)) if ref.language == "python" else {}
    if class_name not in declared and (declared or ref.language != "python"):
        known = f"; it has {', '.join(dict.fromkeys(declared.values()))}" if declared else ", for it is no Python file"
        raise PluginNotFoundError(f"{ref.path} has no class {class_name!r}{known}")
    return ref._replace(class_name=declared.get(class_name, class_name))


def _language(type_: str | None, name: str) -> str | None:
    if type_:
        language = LANGUAGES.get(type_.strip().lower())
        if language is None:
            offered = installed("language")
            if type_.strip().lower() in offered:
                return type_.strip().lower()
            known = ", ".join(sorted({*LANGUAGES, *offered}))
            raise PluginNotFoundError(f"unknown plug-in type {type_!r} of {name!r}; types are {known}")
        return language
    suffix = Path(name).suffix.lower()
    return "python" if suffix in {".so", ".dll"} else _SUFFIXES.get(suffix)


def _look(kind: str, name: str, language: str | None, beside: Path | None) -> Iterator[tuple[str, PluginRef | None]]:
    """Yield each place in which a plug-in may be, in order, and what is found there."""
    for folder in dict.fromkeys(folder.absolute() for folder in search_path(kind, beside)):
        for candidate in _candidates(folder, name, language):
            yield _file(kind, name, language, candidate)
        if language in (None, "python", "lua") and folder.is_dir():
            # A Python file may declare the bare name; that of what was a script in Lua with its ending.
            declared = bare_name(name)
            if language == "lua" and not declared.endswith(".lua"):
                declared = f"{declared}.lua"
            found = next((path for path in sorted(folder.glob("*.py")) if declared in declared_names(path)), None)
            class_name = declared_names(found)[declared] if found is not None else ""
            ref = None if found is None else PluginRef(kind, declared, str(found.resolve()), "python", class_name)
            yield f"{folder}/*.py: none declares the name {declared!r}", ref
        if os.path.isabs(name):  # noqa: PTH117
            break
    if language is not None and language.startswith("executable") and "/" not in name:
        import shutil

        program = shutil.which(name)
        yield f"PATH: no program {name!r}", PluginRef(kind, name, program, language) if program else None
    if language in (None, "python"):
        point = installed(kind).get(bare_name(name))
        place = f"entry points {GROUPS[kind]!r} of installed packages"
        yield place, None if point is None else PluginRef(kind, name, point.value, "entry point")


def _file(kind: str, name: str, language: str | None, path: Path) -> tuple[str, PluginRef | None]:
    """Return a file as a plug-in, if it exists and its kind can be one."""
    if not path.is_file():
        return str(path), None
    language = language or _SUFFIXES.get(path.suffix.lower()) or ("executable" if os.access(path, os.X_OK) else None)
    if language is None:
        return f"{path}: neither .py nor .lua nor executable (chmod +x fixes that)", None
    return str(path), PluginRef(kind, name, str(path.resolve()), language)


def _candidates(folder: Path, name: str, language: str | None) -> Iterator[Path]:
    path = folder / name
    suffix = path.suffix.lower()
    if suffix not in {".so", ".dll"} or (language or "").startswith("executable"):
        yield path
    if language in (None, "python") and suffix != ".py":
        yield path.with_name(f"{bare_name(name)}.py")
    if language == "lua" and suffix != ".lua":
        yield path.with_name(f"{path.name}.lua")


def installed(kind: str) -> dict[str, EntryPoint]:
    """Return the plug-ins of one kind in installed packages, by name."""
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=GROUPS[kind])}


def _near_names(kind: str, name: str, beside: Path | None) -> str:
    import difflib

    known = {declared for path in all_files(kind, beside) for declared in (*declared_names(path), path.stem)}
    bare = bare_name(name)
    near = [word for word in known if word.lower() == bare.lower()]
    near = near or difflib.get_close_matches(bare, sorted(known), n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(sorted(near))}?" if near else ""


def all_files(kind: str, beside: Path | None = None) -> list[Path]:
    """Every Python plug-in file of one kind along the search path, in order."""
    return [path for folder in search_path(kind, beside) if folder.is_dir() for path in sorted(folder.glob("*.py"))]


def spec_of(ref: PluginRef) -> PluginSpec:
    """Return the description of a plug-in as far as its file's text has it."""
    unknown = PluginSpec(safety=None, occupies=None, complete=False)
    if ref.language == "entry point":
        return unknown
    if ref.language != "python":
        return PluginSpec()  # scripts and programs have no way to declare anything
    source = source_of(Path(ref.path))
    named = source.declared.get(ref.class_name) or source.declared.get(bare_name(ref.name))
    leaves = [named] if named is not None else source.leaves()
    if len(leaves) == 1:
        return leaves[0].spec()
    if leaves:
        certain = all(leaf.is_plugin for leaf in leaves)
        return PluginSpec(safety=None, classes=tuple(leaf.name for leaf in leaves)) if certain else unknown
    of_old = any(one.name == "TestCase" for one in source.classes)  # a script of the C++ framework
    return PluginSpec(safety=None) if of_old else unknown


# Loading -------------------------------------------------------------------------------------------------------------


def load_module(ref: PluginRef) -> ModuleType:
    """Run the file of a Python plug-in as module ``rtf_plugins.<kind>.<stem>``. Its own folder can be imported from."""
    if ref.path in _shared:
        return _shared[ref.path]
    path = Path(ref.path)
    name = module_name(ref)
    loader = importlib.machinery.SourceFileLoader(name, ref.path)
    spec = importlib.util.spec_from_file_location(name, ref.path, loader=loader)
    if spec is None:
        raise PluginError(f"{ref.path} cannot be loaded as Python")
    module = importlib.util.module_from_spec(spec)
    folder = str(path.parent)
    if folder not in sys.path:
        sys.path.append(folder)
    if ref.kind in ("test", "fixture"):  # reporters and faults live in processes that are not theirs
        _make_importable(ref.kind, folder)
    sys.modules[name] = module
    own = os.getpid()
    try:
        loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        if os.getpid() != own:  # a copy of this process that the file has forked: it is no second test
            os._exit(0)
    return module


def module_name(ref: PluginRef) -> str:
    """The name by which the module of a Python plug-in is registered."""
    return f"{PLUGINS}{ref.kind}.{Path(ref.path).stem}"


#: The modules that are loaded once, for all tests that are forked from this process.
_shared: dict[str, ModuleType] = {}


def share_module(ref: PluginRef) -> None:
    """Keep the module of a loaded plug-in, so that it is not loaded again, neither here nor in forks."""
    module = sys.modules.get(module_name(ref))
    if module is not None:
        _shared[ref.path] = module


def _make_importable(kind: str, folder: str) -> None:
    """Make modules of plug-ins importable by name in this process and in those that it starts, as pickle needs.

    The package for it lies in a folder that ``multiprocessing`` hands on with ``sys.path``; it reads the variable.
    """
    entry = f"{kind}={folder}"
    entries = [word for word in os.environ.get(IMPORTABLE, "").split(os.pathsep) if word and word != entry]
    os.environ[IMPORTABLE] = os.pathsep.join([entry, *entries])
    if _PACKAGES not in sys.path:
        sys.path.append(_PACKAGES)
    package = importlib.import_module(PLUGINS + kind)
    if folder not in package.__path__:
        package.__path__.insert(0, folder)


def load_class(ref: PluginRef, base: type[P]) -> type[P]:
    """Load the class of a plug-in in Python; raises PluginError, or what the plug-in itself raises."""
    if ref.language != "entry point":
        return choose_class(ref, load_module(ref), base)
    from importlib.metadata import EntryPoint

    loaded = EntryPoint(ref.name, ref.path, GROUPS[ref.kind]).load()
    if not isinstance(loaded, type) or not issubclass(loaded, base):
        raise PluginError(f"entry point {ref.name} = {ref.path} is no class derived from {base.__name__}")
    return loaded


class SeveralClassesError(PluginError):
    """A file has several classes, and none of them is named."""

    def __init__(self, text: str, classes: Sequence[str]) -> None:
        super().__init__(text)
        self.classes = tuple(classes)


def choose_class(ref: PluginRef, module: ModuleType, base: type[P]) -> type[P]:
    """Return the class of a plug-in module: the one named, else the only one that is written in it."""
    own = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, base) and value.__module__ == module.__name__
    ]
    wanted = ref.class_name or bare_name(ref.name)
    named = [
        cls for cls in own if wanted in {cls.__name__, getattr(cls, "plugin_name", ""), *getattr(cls, "aliases", ())}
    ]
    if named:
        return named[-1]
    leaves = [cls for cls in own if not any(other is not cls and issubclass(other, cls) for other in own)]
    leaves = [cls for cls in leaves if not cls.__name__.startswith("_")] or leaves
    if len(leaves) == 1 and not ref.class_name:
        return leaves[0]
    found = ", ".join(cls.__name__ for cls in leaves) or "none"
    text = f"{ref.path} must have one class derived from {base.__name__}, or one named {wanted!r}; found: {found}"
    raise SeveralClassesError(text, () if ref.class_name else [cls.__name__ for cls in leaves])
