"""A project's defaults: ``rtf.toml``, or ``[tool.rtf]`` of ``pyproject.toml``, nearest upwards from the working folder.

Each setting becomes an option in front of those of the command line. So it passes the same checks, and the command line
wins. A file cannot allow motion.
"""

from __future__ import annotations

import argparse
import os
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.cli.arguments import blank_options, build_parser
from rtf.cli.parser import UsageError
from rtf.errors import did_you_mean
from rtf.testing.secret_values import MASK, is_secret

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_VALUES = (
    *("robot", "station", "jobs", "isolation", "memory", "retries", "repetition", "maxfail", "answer", "tags", "wait"),
    *("style", "color", "output-type", "junit-family", "web-port", "web-host"),
)
_PATHS = ("runs", "output", "compare", "device-file", "reports.junit", "reports.json", "reports.ctrf", "reports.html")
_FLAGS = ("recursive", "lenient", "stepwise", "allow-empty", "no-output", "no-summary", "detail", "web-reporter")
_PAIRS = ("set", "define", "device")
#: Settings whose option has another name.
_RENAMED = {
    "limits.setup": "setup-timeout",
    "limits.run": "timeout",
    "limits.teardown": "teardown-timeout",
    "limits.total": "run-timeout",
    "limits.grace": "grace",
    "features": "feature",
}
KEYS = ("suites", "history", *_VALUES, *_PATHS, *_FLAGS, *_PAIRS, *_RENAMED)
_SELECTING = ("targets", "test", "tests", "suite", "suites")


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting of a file: its key, the words of the command line that mean the same, and its place."""

    key: str
    words: tuple[str, ...]
    place: str


@dataclass(frozen=True, slots=True)
class Project:
    """The settings of a file."""

    path: Path
    settings: tuple[Setting, ...]

    def in_front_of(self, words: Sequence[str]) -> list[str]:
        """Return the words of a command line after those of the project; its suites only if no others are named."""
        given = blank_options(words)
        selecting = any(getattr(given, name) for name in _SELECTING)
        settings = [one for one in self.settings if not (selecting and one.key == "suites")]
        return [*(word for one in settings for word in one.words), *words]

    def value(self, key: str) -> tuple[str, ...]:
        """Return the project's values of a key, as texts; nothing if it does not have the key."""
        found = next((one.words for one in self.settings if one.key == key), ())
        return tuple(word.partition("=")[2] if word.startswith("--") else word for word in found)


def project_value(key: str) -> tuple[str, ...]:
    """Return the values of a key in the project of the working folder, as texts. Raises UsageError."""
    project = find_project(Path.cwd())
    return () if project is None else project.value(key)


def find_project(folder: Path) -> Project | None:
    """Return the nearest file with settings, in the folder or above it. Raises UsageError for mistakes in it."""
    for place in (folder, *folder.parents):
        for name, table in (("rtf.toml", ()), ("pyproject.toml", ("tool", "rtf"))):
            path = place / name
            if path.is_file():
                text, values = _read(path)
                for part in table:
                    values = values.get(part, None) if isinstance(values, dict) else None
                if values is not None:
                    settings = [*_settings(path, text, table, values)]
                    if place != Path.cwd() and all(one.key != "runs" for one in settings):
                        settings.append(Setting("runs", (f"--runs={place / 'rtf-runs'}",), os.path.relpath(path)))
                    return Project(path, tuple(settings))
    return None


def _read(path: Path) -> tuple[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
        return text, tomllib.loads(text)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: {error}") from None


def _settings(path: Path, text: str, table: tuple[str, ...], values: dict[str, Any]) -> Iterator[Setting]:
    checking = build_parser()
    checking.exit_on_error = False
    shown = os.path.relpath(path)
    for key, value in _flat(values):
        place = f"{shown}:{_line_of(text, [*table, *key.split('.')])}"
        if key not in KEYS:
            raise UsageError(f"{place}: unknown setting {key!r}{did_you_mean(key, KEYS)}")
        try:
            words = tuple(_words(key, value, path.parent))
            checking.parse_args(words)
        except (UsageError, argparse.ArgumentError) as error:
            raise UsageError(f"{place}: {key}: {getattr(error, 'message', error)}") from None
        yield Setting(key, words, place)


def _flat(values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the settings by dotted keys; a table of free keys is one setting."""
    for key, value in values.items():
        if isinstance(value, dict) and key not in _PAIRS:
            yield from ((f"{key}.{name}", one) for name, one in value.items())
        else:
            yield key, value


def _words(key: str, value: Any, folder: Path) -> Iterator[str]:
    option = f"--{_RENAMED.get(key, key.removeprefix('reports.'))}"
    if key == "suites":
        for name in _list(value):
            yield _target(folder, name)
    elif key == "features":
        yield from (f"{option}={word}" for word in _list(value))
    elif key in _PAIRS:
        if not isinstance(value, dict):
            raise UsageError("must be a table of KEY = VALUE lines")
        yield from (f"{option}={name}={_scalar(one)}" for name, one in value.items())
    elif key in _FLAGS or (key == "history" and isinstance(value, bool)):
        if not isinstance(value, bool):
            raise UsageError(f"must be true or false, not {value!r}")
        if value:
            yield option if key in _FLAGS else f"{option}="
    elif key in _PATHS or key == "history":
        yield f"{option}={_beside(folder, _scalar(value))}"
    else:
        yield f"{option}={_scalar(value)}"


def _list(value: Any) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
        raise UsageError('must be a list of texts, such as ["one", "two"]')
    return value


def _scalar(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise UsageError(f"must be a text or a number, not {value!r}")
    return str(value)


def _target(folder: Path, name: str) -> str:
    path = _beside(folder, name)
    if not Path(path.partition("::")[0]).exists():
        raise UsageError(f"there is no file or folder {path}")
    return path


def _beside(folder: Path, name: str) -> str:
    """Return a path of the file, relative to where the command is given."""
    return name if folder == Path.cwd() or Path(name).is_absolute() else str(folder / name)


def _line_of(text: str, key: Sequence[str]) -> int:
    """Return the line of a key in a TOML file; that of its table, if the table is written in one line."""
    header: tuple[str, ...] = ()
    best, depth = 1, 0
    for number, line in enumerate(text.splitlines(), 1):
        if match := re.match(r"\s*\[\s*([\w.\"-]+)\s*\]", line):
            header = tuple(match[1].replace('"', "").split("."))
            full = header
        elif match := re.match(r"\s*([\w.\"-]+)\s*=", line):
            full = (*header, *match[1].replace('"', "").split("."))
        else:
            continue
        if depth < len(full) <= len(key) and tuple(key[: len(full)]) == full:
            best, depth = number, len(full)
    return best


def show_config(project: Project | None, words: Sequence[str]) -> Iterator[str]:
    """Yield the settings of a command line and a project, a line each: the value, and its source."""
    yield f"project: {project.path if project is not None else 'no rtf.toml, and no [tool.rtf] in pyproject.toml'}"
    given = blank_options(words)
    places = {one.key: one.place for one in project.settings} if project is not None else {}
    options = build_parser().parse_intermixed_args(words if project is None else project.in_front_of(words))
    names = {
        option.removeprefix("--"): action.dest
        for action in build_parser()._actions  # noqa: SLF001 - there is no public way
        for option in action.option_strings
    }
    for key in KEYS:
        dest = "targets" if key == "suites" else names[_RENAMED.get(key, key.removeprefix("reports."))]
        on_line = (
            any(getattr(given, name) for name in _SELECTING) if key == "suites" else getattr(given, dest) is not None
        )
        sources = [*([places[key]] if key in places and not (on_line and key not in _PAIRS) else [])]
        sources += ["command line"] if on_line and (key != "suites" or given.targets) else []
        yield f"{key} = {_shown(getattr(options, dest))}  ({', '.join(sources) or 'default'})"


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(one if isinstance(one, str) else _shown_pair(*one) for one in value) or "none"
    return "none" if value in (None, "") else str(value).lower() if isinstance(value, bool) else str(value)


def _shown_pair(name: str, value: str) -> str:
    return f"{name}={MASK if is_secret(name) else value}"
