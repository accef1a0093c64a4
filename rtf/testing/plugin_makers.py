"""Makes tests and fixtures of plug-ins in all languages."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.testing.case import TestCase
from rtf.testing.fixture import FixtureManager
from rtf.testing.plugins import PluginError, PluginRef, choose_class, installed, load_class, load_module

if TYPE_CHECKING:
    from collections.abc import Callable


def load_test(ref: PluginRef) -> TestCase:
    """Make the test of a reference; raises PluginError, or what the plug-in itself raises."""
    return test_maker(ref)()


def test_maker(ref: PluginRef) -> Callable[[], TestCase]:
    """Load a test plug-in; each call of the result makes a test."""
    language, _, mode = ref.language.partition(":")
    if language == "lua":
        from rtf.testing.languages.lua_plugin import load_lua

        return partial(load_lua, ref)
    if language == "executable":
        from rtf.testing.languages.executable import ExecutableTest

        return partial(ExecutableTest, Path(ref.path), mode)
    if language == "entry point":
        return load_class(ref, TestCase)
    if language != "python":
        maker: Callable[[PluginRef], TestCase] = installed("language")[language].load()
        return partial(maker, ref)
    from rtf.testing.languages import legacy_python

    legacy_python.install()  # a script of the C++ framework may import what the C++ framework provided
    module = load_module(ref)
    old = getattr(module, "TestCase", None)
    if isinstance(old, type) and not issubclass(old, TestCase):
        return partial(legacy_python.adapt, ref, module, old)
    return choose_class(ref, module, TestCase)


def fixture_maker(ref: PluginRef) -> type[FixtureManager]:
    """Load a fixture plug-in."""
    if ref.language not in ("python", "entry point"):
        raise PluginError(
            f"{ref.path}: a fixture manager is written in Python; to run a program, use the fixture 'process'"
        )
    return load_class(ref, FixtureManager)
