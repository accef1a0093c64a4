"""The fixture manager: the class an author derives from to bring up what tests need, and to watch it.

A fixture lives in a process of its own. There ``setup`` is called once, then ``check`` every half second while tests
run, then ``teardown``, all in the main thread. A collapse may also be announced at any moment and from any thread with
:meth:`FixtureManager.collapsed`. After a collapse the old process tears down what is left and ends, and a new one, the
next *generation*, sets up again.

======================  ======================================================================================
what happens            what is called
======================  ======================================================================================
the first start         ``setup``
a later start           ``before_restart``, ``setup``
while it is up          ``check``; ``enter_safe_state`` after a test that was cut short
a test did not pass     ``on_test_failure``
it collapsed            ``on_collapse``, ``teardown``
``setup`` did not work  ``teardown``
it is no longer needed  ``enter_safe_state``, ``teardown``
======================  ======================================================================================

Whatever takes too long is interrupted by an exception that is not for catching (it derives from BaseException), so
``finally`` is executed; only ``teardown`` is never interrupted, but killed when its time is up.

A fixture hands *values* to the tests, and the fixtures, on it: declared, typed, and JSON. It declares them in
``provides`` and gives them in ``setup``; a test that needs one declares it as well::

    class Server(FixtureManager):
        provides = {"port": Value(int, "the port it listens at")}

        def setup(self):
            self.provide_value("port", self.start())

    class Answers(TestCase):
        port = FixtureValue(int, fixture="server", key="port")

A value that is missing or of another type is an error of the author's, which names fixture and key.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, overload

from rtf.testing.isolation.messages import STOP_LIMIT, Provided
from rtf.testing.parameters import Declared
from rtf.testing.session import calling_place
from rtf.testing.verdict import FixtureCollapsed, Severity

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rtf.testing.isolation.messages import FailedTest
    from rtf.testing.supervision.fixture_session import FixtureSession


T = TypeVar("T")

#: The types that JSON keeps as they are.
_TYPES = (bool, int, float, str, list, dict)


class FixtureValueError(TypeError):
    """A fixture value that is missing, not declared, or of another type than declared."""


@dataclass(frozen=True, slots=True)
class Value:
    """The declaration of a value that a fixture provides: its type, one of those of JSON, and its description."""

    kind: type
    description: str = ""

    def __post_init__(self) -> None:
        _require_type(self.kind)


class FixtureValue(Generic[T]):
    """A value of a fixture that a test, or another fixture, needs; it is read like an attribute.

    It is checked before any method of the test is called. A new generation of the fixture has new values.
    """

    def __init__(self, kind: type[T], *, fixture: str, key: str) -> None:
        _require_type(kind)
        self.kind = kind
        self.fixture = fixture
        self.key = key

    def __set_name__(self, owner: type[UsesFixtures], name: str) -> None:
        owner.needed_values = {**owner.needed_values, name: self}

    @overload
    def __get__(self, instance: None, owner: type) -> FixtureValue[T]: ...
    @overload
    def __get__(self, instance: UsesFixtures, owner: type) -> T: ...
    def __get__(self, instance: UsesFixtures | None, owner: type) -> FixtureValue[T] | T:
        if instance is None:
            return self
        values = instance.fixture(self.fixture)
        if self.key not in values:
            raise FixtureValueError(
                f"fixture {self.fixture!r} provides no {self.key!r}; it provides {', '.join(values) or 'nothing'}"
            )
        value: T = checked_value(values[self.key], self.kind, f"{self.key!r} of fixture {self.fixture!r}")
        return value


class UsesFixtures:
    """The base of tests and fixtures: both read the values of their fixtures."""

    #: The needed values by the name of the attribute; filled by :class:`FixtureValue`.
    needed_values: Mapping[str, FixtureValue[Any]] = {}
    _fixture_values: Mapping[str, Mapping[str, Any]] = {}

    def fixture(self, name: str) -> Mapping[str, Any]:
        """The values that a fixture provides, by key. Raises FixtureValueError for one that it does not use."""
        if name not in self._fixture_values:
            known = ", ".join(self._fixture_values) or "none"
            raise FixtureValueError(f"it has no fixture {name!r}; its fixtures are: {known}")
        return self._fixture_values[name]

    def take_fixture_values(self, text: str) -> None:
        """Store the values of all fixtures, and check that the needed ones are there. For the worker."""
        if text:
            self._fixture_values = json.loads(text)
        for name in self.needed_values:
            getattr(self, name)


def checked_value(value: Any, kind: type, what: str) -> Any:
    """Return a value of a type, or raise FixtureValueError. An ``int`` is a ``float`` as well, a ``bool`` is not."""
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise FixtureValueError(f"{what} is {value!r}, which is no {kind.__name__}")
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise FixtureValueError(f"{what} cannot be handed on: {error}") from None
    return value


def _require_type(kind: type) -> None:
    if kind not in _TYPES:
        raise FixtureValueError(f"a value is one of {', '.join(one.__name__ for one in _TYPES)}, not {kind}")


class FixtureUnusable(FixtureCollapsed):
    """Raised in ``setup``: the fixture cannot be brought up, and another try would not help."""


class FixtureManager(Declared, UsesFixtures):
    """Brings up something that tests need, reports whether it is still there, and brings it down.

    ``plugin_name`` is the name suites use (default: the class name), ``aliases`` are further ones. ``occupies`` names
    resources that exist once, such as ``robot``: suites with fixtures that occupy the same never run at the same time.

    ``provides`` declares values for tests, by key; :meth:`provide_value` gives them.

    ``stop_limit`` is how many seconds ``enter_safe_state`` and ``teardown`` may take together when the run is ended by
    SIGTERM or SIGHUP. A run ends within eight seconds then, with four for its fixtures; a fixture that needs longer
    declares it, and the run reports that it waits.
    """

    plugin_name: ClassVar[str] = ""
    aliases: ClassVar[tuple[str, ...]] = ()
    occupies: ClassVar[str] = ""
    stop_limit: ClassVar[float] = STOP_LIMIT
    provides: ClassVar[Mapping[str, Value]] = {}

    _host: FixtureSession
    _environment: str = ""

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        if "park" in cls.__dict__:  # it would never be called, and a robot would be left as it is
            raise TypeError(f"{cls.__name__}.park() is called enter_safe_state() now; rename the method")

    # What an author writes -------------------------------------------------------------------------------------

    def setup(self) -> bool | None:
        """Bring the fixture up; return when tests can use it. It is unusable if this returns False or raises.

        It is then torn down and tried again, as often as the suite's ``restarts`` say, but not after FixtureUnusable.
        """

    def check(self) -> bool | None:
        """Return whether the fixture is still up. False means that it collapsed; so does an exception, with its reason.

        Raise FixtureCollapsed to give the reason in your words. The check has ten seconds.
        """

    def teardown(self) -> None:
        """Bring the fixture down, as far as ``setup`` came. Called exactly once after ``setup`` was begun.

        An exception is reported and makes the run fail; other fixtures are torn down all the same.
        """

    def enter_safe_state(self) -> None:
        """Bring what a test left into a safe state: after a test that was cut short, and before ``teardown``.

        A test was cut short if it was stopped or killed, or if its teardown or a clean-up went wrong. The method is
        called only while the fixture is up: when the fixture collapsed under such a test, the next generation is asked
        before it is used. If it raises, or takes more than 45 seconds, between tests, the fixture counts as collapsed:
        its state is unknown. The limit holds after the runner was killed, too.
        """

    def on_collapse(self, reason: str) -> None:
        """React to a collapse, before ``teardown``, for instance by saving logs. Not called when ``setup`` failed."""

    def on_test_failure(self, failed: FailedTest) -> None:
        """Add what this fixture knows of a test that did not pass, such as a log of its time, with :meth:`attach`.

        Called after each attempt at a test on this fixture that failed, broke or lost a fixture, while this one is up,
        and before the attempt ends for reports. What it raises is reported. It has ten seconds.
        """

    def before_restart(self, generation: int) -> None:
        """Prepare another try (``generation`` is 2 or more), before ``setup``."""

    # What an author calls --------------------------------------------------------------------------------------

    @property
    def environment(self) -> str:
        """The environment string of the suite, such as ``--robotname icubSim``."""
        return self._environment

    @property
    def generation(self) -> int:
        """How many times this fixture has been set up in this run, this time included."""
        return self._host.generation

    def collapsed(
        self, reason: str, *, exit_status: int | None = None, signal_name: str = "", output: str = ""
    ) -> None:
        """Report that the fixture is not usable any more. From any thread; the first report counts.

        ``exit_status`` or ``signal_name`` say how a program ended, ``output`` holds its last lines.
        """
        self._host.collapse(
            reason,
            exit_status=exit_status if isinstance(exit_status, int) else None,
            signal=str(signal_name),
            output=str(output),
        )

    def provide(self, **variables: str) -> None:
        """Set environment variables for the tests on this fixture, and for the fixtures that depend on it.

        To be called in ``setup``; what a generation provides is forgotten with it. Raises ValueError for what no
        environment can hold.
        """
        for name, value in variables.items():
            if not name.isidentifier() or not name.isascii() or "\0" in value:
                raise ValueError(f"the environment cannot hold {name}={value!r}")
        self._host.emit(Provided(variables=variables))

    def provide_value(self, key: str, value: object) -> None:
        """Hand a declared value to the tests on this fixture, and to the fixtures that depend on it; for ``setup``.

        Each generation has values of its own. Raises FixtureValueError for a value that is not declared, or of another
        type.
        """
        if key not in self.provides:
            known = ", ".join(self.provides) or "nothing"
            raise FixtureValueError(f"{type(self).__name__} does not declare {key!r} in provides, which has: {known}")
        checked_value(value, self.provides[key].kind, f"{key!r} of fixture {self._host.name!r}")
        self._host.provide_value(key, value)

    def attach(self, source: str | Path | bytes, name: str = "", media_type: str = "") -> Path:
        """Attach a copy of a file, or bytes, which need a ``name``, to the test that failed. Returns the copy.

        For ``on_test_failure``; elsewhere it raises RuntimeError.
        """
        return self._host.attach(source, name, media_type)

    def report(self, text: str) -> None:
        """Write a message into the journal."""
        self._host.message(Severity.INFO, "reports", text, calling_place(__file__))

    def warn(self, text: str) -> None:
        """Write a warning into the journal."""
        self._host.message(Severity.WARNING, "warns", text, calling_place(__file__))

    def output(self, line: str, stream: str = "stdout") -> None:
        """Put a line, or several, that a program of the fixture wrote into the journal. From any thread.

        ``line`` is without its line end. The journal takes 256 KiB at once and 8 KiB a second after that; of what is
        beyond that, the last 64 KiB are kept and the rest is counted.
        """
        self._host.output(line, stream)

    def attach_to(self, host: FixtureSession, environment: str) -> None:
        """Connect the fixture to its host. For the host, before anything else is called."""
        self._host = host
        self._environment = environment
