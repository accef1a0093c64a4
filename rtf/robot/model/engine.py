"""The physics engine, an optional package, imported on first use. It is typed as Any: it has no type annotations."""

from __future__ import annotations

import os
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rtf.robot.model.errors import MissingPackageError

if TYPE_CHECKING:
    from collections.abc import Iterator

_WINDOW_SYSTEM = "MUJOCO_GL"


@cache
def mujoco() -> Any:
    """Return the package mujoco. The message of MissingPackageError says how to install it.

    It is imported without a rendering back-end, which would need a screen; :mod:`rtf.simulator.rendering` has its own.
    """
    with _without_window_system():
        return _optional("mujoco", "mujoco-core")


def _optional(module: str, package: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingPackageError(
            f"the simulator needs the package {package}: pip install 'rtf[sim]' ({error})"
        ) from error


@contextmanager
def _without_window_system() -> Iterator[None]:
    before = os.environ.get(_WINDOW_SYSTEM)
    os.environ[_WINDOW_SYSTEM] = "disable"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_WINDOW_SYSTEM]
        else:
            os.environ[_WINDOW_SYSTEM] = before
