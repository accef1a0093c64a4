"""Python scripts written for the C++ framework, unchanged.

Such a script has a plain class ``TestCase`` with ``run`` and, if it likes, ``setup`` and ``tearDown``, and calls the
functions of a module ``robottestingframework``. The module can be imported, and is also put among the script's globals,
where the C++ framework put it. The functions work while a test runs; before, they say so.

``setup`` gets what its signature asks for: nothing, the parameter string, or (with several positional parameters, or
``*args``) the words of the C++ framework's argument vector, the test's name first. What it returns decides, but for
None.
"""

from __future__ import annotations

import inspect
import sys
from contextlib import contextmanager
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, NoReturn

from rtf.testing.languages.scripts import ScriptTest
from rtf.testing.plugins import PluginError, PluginRef
from rtf.testing.verdict import TestFailure, TestProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.testing.case import TestCase

MODULE = "robottestingframework"

_POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)

_running: list[LegacyTest] = []


def adapt(ref: PluginRef, module: ModuleType, old: type) -> TestCase:
    """Make a test of a script's class, in the worker after the script ran; raises what the class raises."""
    vars(module)[MODULE] = install()
    script = old()
    if not callable(getattr(script, "run", None)):
        raise PluginError(f"{ref.path}: class {old.__name__} must have a method run()")
    return LegacyTest(ref.name, script)


def install() -> ModuleType:
    """Make ``import robottestingframework`` work in this process, unless something of that name is there already."""
    if MODULE not in sys.modules:
        sys.modules[MODULE] = _api()
    return sys.modules[MODULE]


class LegacyTest(ScriptTest):
    """A Python script written for the C++ framework."""

    def __init__(self, name: str, script: object) -> None:
        super().__init__()
        self._name = name
        self._script = script

    def setup(self) -> bool:
        """Call the script's ``setup``, if it has one, with the arguments it asks for."""
        method = getattr(self._script, "setup", None)
        if method is None:
            return True
        arguments = self._arguments(*_positional(method))
        with self._current():
            result = method(*arguments)
        return result is None or bool(result)

    def run(self) -> None:
        """Call the script's ``run``."""
        with self._current():
            self._script.run()  # type: ignore[attr-defined]

    def teardown(self) -> None:
        """Call the script's ``tearDown``, if it has one."""
        method = getattr(self._script, "tearDown", None)
        if method is not None:
            with self._current():
                method()

    def _arguments(self, count: int, several: bool) -> tuple[str, ...]:
        if count > 1 or several:
            return (self._session.test.partition("/")[2] or self._name, *self.words)
        return (self.parameter,) if count == 1 else ()

    @contextmanager
    def _current(self) -> Iterator[None]:
        _running.append(self)
        try:
            yield
        finally:
            _running.pop()


def _positional(method: Callable[..., object]) -> tuple[int, bool]:
    """Count the positional parameters of a method, and say whether it takes any number of them.

    The first use of ``inspect.signature`` after a fork takes 0.5 ms, a quarter of a test, so plain methods, which are
    nearly all, do without it.
    """
    function = getattr(method, "__func__", None)
    if isinstance(function, FunctionType) and not vars(function):  # else it may be wrapped
        return function.__code__.co_argcount - 1, bool(function.__code__.co_flags & inspect.CO_VARARGS)
    kinds = [parameter.kind for parameter in inspect.signature(method).parameters.values()]
    return sum(kind in _POSITIONAL for kind in kinds), inspect.Parameter.VAR_POSITIONAL in kinds


def _now() -> LegacyTest:
    if not _running:
        raise RuntimeError(f"{MODULE} speaks for a running test; call it in setup, run or tearDown, not while loading")
    return _running[-1]


def _caller() -> tuple[str, int]:
    frame = sys._getframe(2)  # noqa: SLF001 - the script's line is what a report must name
    return frame.f_code.co_filename, frame.f_lineno


# What scripts call; the names are the C++ framework's -----------------------------------------------------------------


def _assert_error(message: object) -> NoReturn:
    _now()
    raise TestProblem(str(message))


def _assert_fail(message: object) -> NoReturn:
    _now().session.judged()
    raise TestFailure(str(message))


_FUNCTIONS: dict[str, Callable[..., object]] = {
    "setName": lambda name: _now().rename(str(name)),
    "testReport": lambda message: _now().report_at(_caller(), str(message)),
    "testCheck": lambda condition, message: _now().check_at(_caller(), condition, str(message)),
    "testFailIf": lambda condition, message: _now().fail_unless(_caller(), condition, str(condition), str(message)),
    "testFail": lambda condition, message: _now().fail_unless(_caller(), False, str(condition), str(message)),
    "assertError": _assert_error,
    "assertFail": _assert_fail,
    "getEnvironment": lambda: _now().environment,
}


def _api() -> ModuleType:
    module = ModuleType(MODULE, "What the C++ framework's test scripts call.")
    vars(module).update(_FUNCTIONS)
    return module
