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
from types import ModuleType
from typing import TYPE_CHECKING, NoReturn

from rtf.testing.languages.scripts import RawParameters
from rtf.testing.outcome import TestFailure, TestProblem
from rtf.testing.plugins import PluginError, PluginRef
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.testing.case import TestCase
    from rtf.testing.session import Session

MODULE = "robottestingframework"

#: Characters of a value that are shown in a title.
_SHOWN = 200

_POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)

_running: list[LegacyTest] = []


def adapt(ref: PluginRef, module: ModuleType, old: type) -> TestCase:
    """Make a test of a script's class. Called in the worker after the script ran; raises what the class raises."""
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


class LegacyTest(RawParameters):
    """One of the C++ framework's Python scripts."""

    def __init__(self, name: str, script: object) -> None:
        super().__init__()
        self._name = name
        self._script = script

    def setup(self) -> bool:
        """Call the script's ``setup``, if it has one, with the arguments it asks for."""
        method = getattr(self._script, "setup", None)
        if method is None:
            return True
        arguments = self._arguments(inspect.signature(method))
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

    def _arguments(self, signature: inspect.Signature) -> tuple[str, ...]:
        kinds = [parameter.kind for parameter in signature.parameters.values()]
        positional = [kind for kind in kinds if kind in _POSITIONAL]
        if len(positional) > 1 or inspect.Parameter.VAR_POSITIONAL in kinds:
            return (self._session.test.partition("/")[2] or self._name, *self.words)
        return (self.parameter,) if positional else ()

    @contextmanager
    def _current(self) -> Iterator[None]:
        _running.append(self)
        try:
            yield
        finally:
            _running.pop()

    @property
    def session(self) -> Session:
        """Where the script's calls go."""
        return self._session


def _now() -> LegacyTest:
    if not _running:
        raise RuntimeError(f"{MODULE} speaks for a running test; call it in setup, run or tearDown, not while loading")
    return _running[-1]


def _caller() -> tuple[str, int]:
    frame = sys._getframe(2)  # noqa: SLF001 - the script's line is what a report must name
    return frame.f_code.co_filename, frame.f_lineno


# What scripts call; the names are the C++ framework's -----------------------------------------------------------------


def set_name(name: object) -> None:
    """Report under another name."""
    _now().rename(str(name))


def test_report(message: object) -> None:
    """Say something."""
    _now().session.message(Severity.INFO, "reports", str(message), _caller())


def test_check(condition: object, message: object) -> None:
    """Report the message if the condition holds, as a failure if it does not."""
    session = _now().session
    session.judged()
    session.message(Severity.PASS if condition else Severity.FAILURE, "checks", str(message), _caller())


def test_fail_if(condition: object, message: object) -> None:
    """Report a failure if the condition does NOT hold, whatever the name says: it is the C++ framework's meaning."""
    session = _now().session
    session.judged()
    if not condition:
        session.message(Severity.FAILURE, f"checking ({str(condition)[:_SHOWN]})", str(message), _caller())


def test_fail(condition_text: object, message: object) -> None:
    """Report a failure."""
    session = _now().session
    session.judged()
    session.message(Severity.FAILURE, f"checking ({str(condition_text)[:_SHOWN]})", str(message), _caller())


def assert_error(message: object) -> NoReturn:
    """End the test as an error."""
    _now()
    raise TestProblem(str(message))


def assert_fail(message: object) -> NoReturn:
    """End the test as failed."""
    _now().session.judged()
    raise TestFailure(str(message))


def get_environment() -> str:
    """The suite's environment string."""
    return _now().environment


_FUNCTIONS = {
    "setName": set_name,
    "testReport": test_report,
    "testCheck": test_check,
    "testFailIf": test_fail_if,
    "testFail": test_fail,
    "assertError": assert_error,
    "assertFail": assert_fail,
    "getEnvironment": get_environment,
}


def _api() -> ModuleType:
    module = ModuleType(MODULE, "What the C++ framework's test scripts call.")
    vars(module).update(_FUNCTIONS)
    return module
