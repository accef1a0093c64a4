"""The settings of robot tests from command line and ini file, checked before anything is collected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import pytest

from rtf.testing.suite.values import parse_duration, parse_integer

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

_T = TypeVar("_T")
_KEY = pytest.StashKey["Settings"]()
#: The report that shows the run while it goes on, and answers its questions. What stands behind ``=`` is its port.
LIVE_PAGE = "web"
_LONGEST = 7 * 24 * 3600.0
_MOST_RETRIES = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The values; ``timeout`` in seconds, ``reports`` as names, each with what stands behind its ``=``."""

    timeout: float | None
    retries: int | None
    robot: str
    station: str
    answer: str | None
    runs: Path
    overrides: tuple[tuple[str, str], ...]
    variables: dict[str, str]
    features: frozenset[str]
    reports: tuple[tuple[str, str], ...]
    lenient: bool

    @classmethod
    def of(cls, config: pytest.Config) -> Settings:
        """Return the settings of a session. Raises pytest.UsageError, which names the option and has a hint."""
        known = config.stash.get(_KEY, None)
        if known is None:
            known = config.stash[_KEY] = _read(config)
        return known


def _read(config: pytest.Config) -> Settings:
    values = _Values(config)
    settings = Settings(
        timeout=values.single("timeout", lambda text: parse_duration(text, 0.001, _LONGEST)),
        retries=values.single("retries", lambda text: parse_integer(text, 0, _MOST_RETRIES)),
        robot=values.single("robot", str) or "",
        station=values.single("station", str) or "",
        answer=values.single("answer", str),
        runs=values.path("runs") or config.invocation_params.dir / "rtf-runs",
        overrides=tuple(values.several("set", _key_value)),
        variables=dict(values.several("define", _key_value)),
        features=frozenset(values.several("feature", str)),
        reports=tuple(values.several("report", _report)),
        lenient=config.getoption("rtf_lenient") or config.getini("rtf_lenient"),
    )
    if any(name == LIVE_PAGE for name, _ in settings.reports) and config.getoption("dist", "no") != "no":
        raise pytest.UsageError(
            "the report 'web' shows one run while it goes on, and each worker of pytest-xdist has one; "
            "leave out -n, or write 'html' instead"
        )
    return settings


def _key_value(text: str) -> tuple[str, str]:
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise ValueError(f"is {text!r}; it must be of the form NAME=VALUE")
    return key.strip(), value


def _report(text: str) -> tuple[str, str]:
    from rtf.testing.plugins import PluginError
    from rtf.testing.reporting import load_reporter

    name, _, target = text.partition("=")
    try:
        load_reporter(name)
    except PluginError as error:
        raise ValueError(f"is {text!r}: {error}") from None
    return name, target


class _Values:
    """Looks up a setting: on the command line, then in the ini file."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def single(self, name: str, read: Callable[[str], _T]) -> _T | None:
        option: str | None = self._config.getoption(f"rtf_{name}")
        if option is not None:
            return _checked(f"--rtf-{name}", option, read)
        text: str = self._config.getini(f"rtf_{name}")
        return _checked(f"ini value rtf_{name}", text, read) if text else None

    def several(self, name: str, read: Callable[[str], _T]) -> list[_T]:
        lines = [_checked(f"ini value rtf_{name}", line, read) for line in self._config.getini(f"rtf_{name}")]
        return lines + [_checked(f"--rtf-{name}", text, read) for text in self._config.getoption(f"rtf_{name}")]

    def path(self, name: str) -> Path | None:
        """Return a path: relative to the working folder if it is from the command line, else to the ini file."""
        option: str | None = self._config.getoption(f"rtf_{name}")
        if option:
            return self._config.invocation_params.dir / option
        text: str = self._config.getini(f"rtf_{name}")
        return (self._config.inipath or self._config.rootpath / "ini").parent / text if text else None


def _checked(what: str, text: str, read: Callable[[str], _T]) -> _T:
    try:
        return read(text)
    except ValueError as error:
        raise pytest.UsageError(f"{what} {error}") from None
