"""Tests written in Lua, as the C++ framework knew them.

A script assigns ``run`` and, if it likes, ``setup`` and ``tearDown`` to the global table ``TestCase``, and calls the
functions of ``robottestingframework``. ``setup`` gets the parameter string as it stands, and must return something that
is true in Lua: returning nothing is a failed setup, as it always was. ``tearDown`` runs whatever happened before.
Conditions follow Lua's truth. Python is out of the script's reach.

Beyond the C++ framework: ``measure(name, value, unit, low, high)``, ``skip(text)``, ``progress(fraction, text)``.
"""

from __future__ import annotations

import functools
import importlib
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rtf.testing.languages.scripts import ScriptTest
from rtf.testing.plugins import PluginError, PluginRef
from rtf.testing.verdict import SkipTest, TestFailure, TestingError, TestProblem, TestStopped

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import CodeType

    from rtf.testing.languages.scripts import Place

#: The interpreters of lupa a test may run in, best first. LuaJIT is none: its compiled loops could not be stopped.
_INTERPRETERS = ("lua54", "lua55", "lua53", "lua52")
#: Instructions between two looks for a stop: about a millisecond.
_STEPS = 100_000
_PRELUDE = Path(__file__).with_name("prelude.lua")
_LINE = re.compile(r":([0-9]+):")


class LuaError(TestingError, RuntimeError):
    """An error in a Lua script: its message, with Lua's traceback as a note."""


def load_lua(ref: PluginRef) -> LuaTest:
    """Run the script of a Lua test, which defines its functions. Called in the worker.

    Raises PluginError, located at the script's line, when lupa is missing, the script cannot be read or ends in an
    error, or there is no ``TestCase.run``.
    """
    test = LuaTest(Path(ref.path))
    test.load()
    return test


def _interpreter() -> Callable[..., Any]:
    """Return the class of a Lua state; lupa has no types."""
    try:
        import lupa  # noqa: F401 - only whether it is there
    except ImportError as error:
        raise PluginError(f"Lua tests need the package lupa ({error}); pip install 'rtf[lua]' fixes that") from None
    for name in _INTERPRETERS:
        try:
            return importlib.import_module(f"lupa.{name}").LuaRuntime  # type: ignore[no-any-return]
        except ImportError:
            continue
    raise PluginError(f"this lupa carries none of {', '.join(_INTERPRETERS)}; pip install --upgrade lupa fixes that")


def _deny(*_: object) -> NoReturn:
    raise AttributeError("Python objects are closed to Lua")


class LuaTest(ScriptTest):
    """One Lua script in an interpreter of its own."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._running = False
        self._stopped_before = False
        self._api: dict[str, Callable[..., object]] = {
            "setName": self._set_name,
            "testReport": self.report_at,
            "testCheck": self.check_at,
            "testFailIf": self.fail_unless,
            "assertError": self._assert_error,
            "assertFail": self._assert_fail,
            "getEnvironment": self._get_environment,
            "measure": self._measure,
            "skip": self._skip,
            "progress": self._progress,
        }
        self._chunk = b"@" + _bytes(path.name)
        # Bytes, not text: what a script prints or reports need not be UTF-8.
        lua = _interpreter()(
            encoding=None,
            register_eval=False,
            register_builtins=False,
            unpack_returned_tuples=True,
            attribute_filter=_deny,
        )
        prelude = lua.eval(b"load")(_PRELUDE.read_bytes(), b"=[rtf]", b"t")
        self._begin, self._has, self._invoke = prelude(
            self._host, self._look, self._chunk, _bytes(str(path.parent)), _STEPS
        )

    def load(self) -> None:
        """Run the script, once."""
        code = self._path.read_bytes().removeprefix(b"\xef\xbb\xbf")
        if code.startswith(b"#"):
            code = b"--" + code  # as Lua itself does with a #! line
        kind, value, *rest = self._begin(code)
        if kind == b"unreadable":
            text = _text(value)
            found = _LINE.search(text)
            place = (str(self._path), int(found[1]) if found else 1)
            _raise_at(place, PluginError(f"Cannot load lua script {self._path}: {text}"))
        self._ended(kind, value, *rest, what=f"Cannot run lua script {self._path}: ", error_class=PluginError)
        if not self._has(b"run"):
            raise PluginError(f"{self._path} must implement 'TestCase.run()' function.")

    def setup(self) -> None:
        """Call ``TestCase.setup(parameter)``, if there is one; a result that is false in Lua is an error."""
        if self._has(b"setup") and not self._call(b"setup", _bytes(self.parameter)):
            raise TestProblem("TestCase.setup() did not return true", title="setup() failed!")

    def run(self) -> None:
        """Call ``TestCase.run()``."""
        self._call(b"run")

    def teardown(self) -> None:
        """Call ``TestCase.tearDown()``, if there is one."""
        if self._has(b"tearDown"):
            self._call(b"tearDown")

    def _call(self, name: bytes, *arguments: bytes) -> bool:
        self._running = True
        self._stopped_before = bool(self._session.stopped)
        try:
            outcome = self._invoke(name, *arguments)
        finally:
            self._running = False
        self._look_for_stop()  # the script may have caught it and returned
        return self._ended(*outcome)

    def _ended(
        self,
        kind: bytes,
        value: Any,  # whatever Lua returns
        source: bytes = b"",
        line: int = 0,
        trace: bytes = b"",
        *,
        what: str = "",
        error_class: type[TestingError] = LuaError,
    ) -> bool:
        if kind == b"raised" and isinstance(value, BaseException):
            raise value
        if kind != b"done":
            error = error_class(what + _text(value))
            error.add_note(_text(trace))
            _raise_at(self._place(source, line), error)
        return bool(value)

    def _place(self, source: bytes | None, line: int | None) -> Place:
        if not source or not source.startswith(b"@") or not line or line < 0:
            return str(self._path), 1
        return str(self._path) if source == self._chunk else _text(source[1:]), line

    # Called by Lua -----------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Look for a stop, from Lua's hook; entering Python also lets the stop signal's handler run and raise."""
        if self._running:
            self._look_for_stop()

    def _look_for_stop(self) -> None:
        if self._session.stopped and not self._stopped_before:
            raise TestStopped(self._session.stopped)

    def _host(self, name: bytes, source: bytes, line: int, *arguments: object) -> object:
        function = self._api[name.decode()]
        place = self._place(source, line)
        if not self._running:
            text = f"robottestingframework.{name.decode()} speaks for a running test; not while the script is loaded"
            _raise_at(place, RuntimeError(text))
        return function(place, *(_text(value) if isinstance(value, bytes) else value for value in arguments))

    def _set_name(self, _place: Place, name: str) -> None:
        self.rename(name)

    def _assert_error(self, place: Place, text: str) -> None:
        _raise_at(place, TestProblem(text))

    def _assert_fail(self, place: Place, text: str) -> None:
        self._session.judged()
        _raise_at(place, TestFailure(text))

    def _get_environment(self, _place: Place) -> bytes:
        return _bytes(self.environment)

    def _measure(self, place: Place, name: str, value: float, unit: str | None, *limits: float | None) -> None:
        _at(place, self.measure, name, value, unit or "", *limits)

    def _skip(self, place: Place, reason: str) -> None:
        _raise_at(place, SkipTest(reason))

    def _progress(self, place: Place, fraction: float, text: str) -> None:
        _at(place, self.progress, float(fraction), text)


# A line of Lua as a frame of Python ----------------------------------------------------------------------------------


def _at(place: Place, function: Callable[..., Any], *arguments: object) -> Any:  # whatever the function returns
    """Call a function as if from a line of the script, so that callers and tracebacks name that line, as with Jinja."""
    names = {"function": function, "arguments": arguments}
    return eval(_line_code("function(*arguments)", "eval", *place), names)  # noqa: S307 - the code is this constant


def _raise_at(place: Place, error: BaseException) -> NoReturn:
    exec(_line_code("raise error", "exec", *place), {"error": error})  # noqa: S102 - the code is this constant
    raise error  # for type checkers


@functools.lru_cache(maxsize=256)
def _line_code(code: str, mode: str, file: str, line: int) -> CodeType:
    return compile(code, file, mode).replace(co_firstlineno=line, co_name="lua")


def _text(data: object) -> str:
    return data.decode("utf-8", errors="replace") if isinstance(data, bytes) else str(data)


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", errors="surrogateescape")
