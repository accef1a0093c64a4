"""The test case: the class an author derives from.

A test plug-in is a file with one class derived from :class:`TestCase`. The runner makes one object per attempt, in a
process of its own, and calls ``setup``, then ``run`` (once more for each repetition), then ``teardown``; the clean-ups
follow in reverse order of being added. ``teardown`` and the clean-ups run whenever ``setup`` was begun, whatever
happened since.

*Assertions* end the test (or the sub-result they are made in) when they do not hold. *Checks* report and go on.
A failure says that the thing under test is wrong; an error that it could not be tested.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, cast

from rtf.testing import recording
from rtf.testing.events import Asked, Measured, Progressed, TestRenamed
from rtf.testing.fixture import UsesFixtures
from rtf.testing.measurement import Measurement, MeasurementVerdict, Unit, margin_of, quantity, require_limits, unit
from rtf.testing.parameters import Declared, Parameter
from rtf.testing.recording import Series
from rtf.testing.session import calling_place
from rtf.testing.verdict import Inconclusive, Severity, SkipTest, TestFailure, TestProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from numpy.typing import ArrayLike

    from rtf.testing.session import Session

    Cleanup = tuple[Callable[..., object], tuple[object, ...], dict[str, object]]


class TestCase(Declared, UsesFixtures):
    """A test. Derive from it, declare parameters as class attributes, and write ``run``.

    ``plugin_name`` is the name suites use (default: the class name); ``aliases`` are further ones; ``tags`` and
    ``requires`` are added to those of the suite, as are the words in ``occupies``, which name what there is once: tests
    that occupy the same never run at the same time. ``timeout`` is the author's limit for one ``run`` in seconds, used
    where the suite says none.
    """

    __test__ = False  # pytest collects suites, not this class

    plugin_name: ClassVar[str] = ""
    aliases: ClassVar[tuple[str, ...]] = ()
    tags: ClassVar[tuple[str, ...]] = ()
    requires: ClassVar[tuple[str, ...]] = ()
    occupies: ClassVar[str] = ""
    timeout: ClassVar[float | None] = None

    name = Parameter(str, "name under which the test reports", default="")
    description = Parameter(str, "what the test shows, in a sentence", default="")

    _session: Session
    _environment: str = ""

    # What an author writes -------------------------------------------------------------------------------------

    def setup(self) -> bool | None:
        """Prepare. Returning False is an error of the test; None and True are not."""

    def run(self) -> None:
        """Test. The body of the test; called once more for each repetition."""
        raise NotImplementedError(f"{type(self).__name__} has no run()")

    def teardown(self) -> None:
        """Undo what ``setup`` did, as far as it came."""

    def implied_fixtures(self) -> Sequence[tuple[str, Mapping[str, str]]]:
        """The fixtures, each with its parameters, that it needs when no suite says so: ``testrunner --test``.

        Asked with its parameters filled, in a process of its own that ends with the answer; nothing has been set up
        then. A class of which the source plainly says that it moves nothing is not asked.
        """
        return ()

    # What an author calls --------------------------------------------------------------------------------------

    @property
    def environment(self) -> str:
        """The environment string of the suite, such as ``--robotname icubSim``."""
        return self._environment

    @property
    def folder(self) -> Path:
        """A folder of the test's own inside the run's folder; made when it is first asked for."""
        folder = self._session.folder
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    @property
    def failing(self) -> bool:
        """Whether something has failed or gone wrong so far, or the test was stopped."""
        return bool(self._session.tally.failures or self._session.tally.errors or self._session.stopped)

    def rename(self, name: str, description: str = "") -> None:
        """Report under another name from now on."""
        self._session.emit(TestRenamed(test=self._session.test, name=name, description=description))

    def report(self, text: str) -> None:
        """Write a message into the journal; it does not change the verdict."""
        self._session.message(Severity.INFO, "reports", text, calling_place(__file__))

    def warn(self, text: str) -> None:
        """Write a warning into the journal; it does not change the verdict."""
        self._session.message(Severity.WARNING, "warns", text, calling_place(__file__))

    def add_cleanup(self, function: Callable[..., object], /, *args: object, **kwargs: object) -> None:
        """Have ``function`` called after ``teardown``, last added first, whatever happens."""
        self.cleanup_stack().append((function, args, kwargs))

    def cleanup_stack(self) -> list[Cleanup]:
        """The clean-ups that are not done yet, the next one last. For the worker, which does them."""
        stack: list[Cleanup] = self.__dict__.setdefault("_cleanup_stack", [])
        return stack

    def attach_to(self, session: Session, environment: str) -> None:
        """Connect the test to its runner. For the worker, before anything else is called."""
        self._session = session
        self._environment = environment

    def skip(self, reason: str) -> NoReturn:
        """End the test (or sub-result): there is nothing to test here."""
        raise SkipTest(reason)

    def inconclusive(self, reason: str) -> NoReturn:
        """End the test (or sub-result): it was carried out and cannot judge, for this reason."""
        raise Inconclusive(reason)

    def subresult(self, subject: str) -> AbstractContextManager[None, bool]:
        """A part of the test with its own verdict: ``with self.subresult("joint 3"): …``.

        Neither a failed assertion nor an exception in the part ends the test.
        """
        # Type checkers take a decorated generator for one that lets every exception through.
        return cast("AbstractContextManager[None, bool]", self._session.part(subject))

    # Assertions: end the test --------------------------------------------------------------------------------

    def assert_fail(self, text: str) -> NoReturn:
        """End the test (or sub-result) as failed."""
        self._session.judged()
        raise TestFailure(text)

    def assert_error(self, text: str) -> NoReturn:
        """End as an error: the test cannot be carried out."""
        raise TestProblem(text)

    def assert_true(self, condition: object, text: str) -> None:
        """Fail unless the condition holds."""
        self._conclude(condition, text, stop=True)

    def assert_fail_if_true(self, condition: object, text: str) -> None:
        """Fail if the condition holds."""
        self.assert_true(not condition, text)

    def assert_fail_if_false(self, condition: object, text: str) -> None:
        """Fail if the condition does not hold."""
        self.assert_true(condition, text)

    def assert_error_if_true(self, condition: object, text: str) -> None:
        """End as an error if the condition holds."""
        if condition:
            raise TestProblem(text)

    def assert_error_if_false(self, condition: object, text: str) -> None:
        """End as an error if the condition does not hold."""
        if not condition:
            raise TestProblem(text)

    def assert_equal(self, value: object, expected: object, text: str) -> None:
        """Fail unless the two are equal."""
        self._compare_equal(value, expected, text, stop=True)

    def assert_near(self, value: float, expected: float, tolerance: float, symbol: str = "", text: str = "") -> None:
        """Fail unless ``value`` is within ``expected`` ± ``tolerance`` (all in ``symbol``, inclusive)."""
        self._compare_near(value, expected, tolerance, symbol, text, stop=True)

    def assert_within(
        self, value: float, low: float | None, high: float | None, symbol: str = "", text: str = ""
    ) -> None:
        """Fail unless ``value`` lies within the limits (inclusive; None means no limit on that side)."""
        self._compare(value, low, high, symbol, text, stop=True)

    def assert_vector_near(
        self,
        values: Sequence[float],
        expected: Sequence[float],
        tolerance: float | Sequence[float],
        symbol: str = "",
        text: str = "",
    ) -> None:
        """Fail unless each element is within its tolerance; the failure names every element that is not."""
        self._compare_vector(values, expected, tolerance, symbol, text, stop=True)

    # Checks: report and go on ----------------------------------------------------------------------------------

    def check(self, condition: object, text: str) -> bool:
        """Report the text if the condition holds, as a failure if it does not. Returns whether it holds."""
        return self._conclude(condition, text, stop=False)

    def check_fail_if_true(self, condition: object, text: str) -> bool:
        """Report a failure if the condition holds; silent otherwise. Returns whether all is well."""
        return self.check_fail_if_false(not condition, text)

    def check_fail_if_false(self, condition: object, text: str) -> bool:
        """Report a failure if the condition does not hold; silent otherwise. Returns whether all is well."""
        return self._session.check(condition, text, calling_place(__file__), title="checking", quiet=True)

    def check_equal(self, value: object, expected: object, text: str) -> bool:
        """Check that the two are equal."""
        return self._compare_equal(value, expected, text, stop=False)

    def check_near(self, value: float, expected: float, tolerance: float, symbol: str = "", text: str = "") -> bool:
        """Check that ``value`` is within ``expected`` ± ``tolerance`` (all in ``symbol``, inclusive)."""
        return self._compare_near(value, expected, tolerance, symbol, text, stop=False)

    def check_within(
        self, value: float, low: float | None, high: float | None, symbol: str = "", text: str = ""
    ) -> bool:
        """Check that ``value`` lies within the limits (inclusive; None means no limit on that side)."""
        return self._compare(value, low, high, symbol, text, stop=False)

    def check_vector_near(
        self,
        values: Sequence[float],
        expected: Sequence[float],
        tolerance: float | Sequence[float],
        symbol: str = "",
        text: str = "",
    ) -> bool:
        """Check that each element is within its tolerance; the failure names every element that is not."""
        return self._compare_vector(values, expected, tolerance, symbol, text, stop=False)

    # Measurements and data ---------------------------------------------------------------------------------------

    def measure(
        self,
        name: str,
        value: float,
        symbol: str | Unit = Unit.NONE,
        low: float | None = None,
        high: float | None = None,
        marginal: float | None = None,
        hint: str = "",
    ) -> Measurement:
        """Record a value with its unit; outside its (inclusive) limits it is a failure, and the test goes on.

        ``marginal`` is the width of the zone inside each limit that is shown as a warning. ``hint`` says in the words
        of the thing under test what a value outside means, and its likely causes; only a failure carries it.
        """
        measurement = Measurement(name, float(value), unit(symbol), low, high, marginal)
        verdict = measurement.verdict
        session = self._session
        session.recorded() if verdict is MeasurementVerdict.RECORDED else session.judged()
        file, line = place = calling_place(__file__)
        session.emit(
            Measured(
                test=session.test,
                name=name,
                marginal=marginal,
                verdict=verdict,
                subject=session.subject,
                file=file,
                line=line,
                **measurement.members(),
            ),
        )
        if verdict is MeasurementVerdict.FAILED:
            detail = f"{measurement}; {hint}" if hint else str(measurement)
            session.message(Severity.FAILURE, "measures", detail, place, measurement=measurement)
        return measurement

    def record(self, name: str, /, **columns: tuple[ArrayLike, str | Unit]) -> Path:
        """Keep columns of numbers; the first is the axis: ``record("elbow", t=(t, "s"), position=(q, "deg"))``.

        All columns are one-dimensional and of one length. They are stored as ``.npz`` beside the journal and plotted in
        reports. Returns the file.
        """
        units = {column: symbol for column, (_, symbol) in columns.items()}
        return Series(self._session, name, units).keep({column: data for column, (data, _) in columns.items()})

    def series(self, name: str, /, **columns: str | Unit) -> Series:
        """Record columns row by row, to be watched while they grow: ``series("elbow", t="s", position="deg")``.

        Give a row to ``append``. It is kept like one of ``record`` when it is closed, as it is at the end of a ``with``
        block and of the test.
        """
        series = Series(self._session, name, columns)
        self.add_cleanup(series.close)
        return series

    def attach(self, source: str | Path | bytes, name: str = "", media_type: str = "") -> Path:
        """Keep a file with the run: a path to copy, or bytes to write (then ``name`` is needed). Returns the copy."""
        return recording.attach(self._session, source, name, media_type)

    def progress(self, fraction: float, text: str = "") -> None:
        """Say how far the test has come, from 0 to 1."""
        session = self._session
        session.emit(Progressed(test=session.test, fraction=min(1.0, max(0.0, float(fraction))), text=text))

    # Questions to the operator -----------------------------------------------------------------------------------

    def confirm(self, text: str, *, timeout: float = 60.0, default: bool | None = None, picture: str = "") -> bool:
        """Ask yes or no. Without an answer in ``timeout`` seconds the default counts, or the test is inconclusive."""
        standard = None if default is None else "yes" if default else "no"
        return self._ask(text, "confirm", timeout=timeout, default=standard, picture=picture) == "yes"

    def ask(
        self,
        text: str,
        choices: Sequence[str] = (),
        *,
        timeout: float = 60.0,
        default: str | None = None,
        picture: str = "",
    ) -> str:
        """Ask for a text, or for one of ``choices``. Without an answer in time: the default, or inconclusive."""
        form = "choice" if choices else "text"
        return self._ask(text, form, choices=tuple(choices), timeout=timeout, default=default, picture=picture)

    def ask_number(
        self, text: str, symbol: str = "", *, timeout: float = 60.0, default: float | None = None, picture: str = ""
    ) -> float:
        """Ask for a number in ``symbol``. Without an answer in time: the default, or inconclusive."""
        standard = None if default is None else repr(float(default))
        answer = self._ask(text, "number", unit=str(unit(symbol)), timeout=timeout, default=standard, picture=picture)
        try:
            return float(answer)
        except ValueError:
            raise Inconclusive(f"the answer to {text!r} is no number: {answer!r}") from None

    def _ask(self, text: str, form: str, *, timeout: float, picture: str, **members: Any) -> str:
        session = self._session
        question = Asked(
            test=session.test,
            question=session.next_question(),
            text=text,
            form=form,
            picture=self._kept_picture(picture) if picture else "",
            timeout=timeout,
            **members,
        )
        answer = session.ask(question)
        if answer is None:
            raise Inconclusive(
                f"no answer to {text!r}: answer at the terminal or on the page within {timeout:g} s, or give --answer"
            )
        return answer

    def _kept_picture(self, picture: str) -> str:
        """Return the path of a picture inside the run's folder; one from elsewhere is attached first."""
        folder = self._session.run_folder.resolve()
        path = Path(picture) if Path(picture).exists() else folder / picture
        if path.resolve().is_relative_to(folder) and path.is_file():
            return path.resolve().relative_to(folder).as_posix()
        return self.attach(picture).relative_to(self._session.run_folder).as_posix()

    # Behind the calls --------------------------------------------------------------------------------------------

    def _compare(
        self, value: float, low: float | None, high: float | None, symbol: str, text: str, *, stop: bool
    ) -> bool:
        measured = Measurement(text, float(value), unit(symbol), low, high)
        holds = measured.verdict is not MeasurementVerdict.FAILED and not math.isnan(measured.value)
        detail = f"{text}: {measured.sentence}" if text else measured.sentence
        return self._conclude(holds, detail, stop=stop, measurement=measured)

    def _compare_near(
        self, value: float, expected: float, tolerance: float, symbol: str, text: str, *, stop: bool
    ) -> bool:
        require_limits(expected=expected, tolerance=tolerance)
        tolerance = abs(tolerance)
        return self._compare(value, expected - tolerance, expected + tolerance, symbol, text, stop=stop)

    def _compare_equal(self, value: object, expected: object, text: str, *, stop: bool) -> bool:
        holds = bool(value == expected)
        detail = f"{text}: {value!r}" if holds else f"{text}: {value!r}, expected {expected!r}"
        return self._conclude(holds, detail, stop=stop)

    def _compare_vector(
        self,
        values: Sequence[float],
        expected: Sequence[float],
        tolerance: float | Sequence[float],
        symbol: str,
        text: str,
        *,
        stop: bool,
    ) -> bool:
        symbol = str(unit(symbol))
        given = [float(value) for value in values]
        wanted = [float(value) for value in expected]
        allowed = [float(tolerance)] * len(wanted) if isinstance(tolerance, int | float) else [*map(float, tolerance)]
        if len(given) != len(wanted) or len(allowed) != len(wanted):
            raise ValueError(
                f"vectors of different lengths: {len(given)} values, {len(wanted)} expected, {len(allowed)} tolerances",
            )
        for index, (target, limit) in enumerate(zip(wanted, allowed, strict=True)):
            require_limits(**{f"expected[{index}]": target, f"tolerance[{index}]": limit})
        wrong = [
            f"[{index}] {quantity(value, symbol)}, expected {quantity(target, symbol)} ± {quantity(limit, symbol)}"
            for index, (value, target, limit) in enumerate(zip(given, wanted, allowed, strict=True))
            if not _is_near(value, target, abs(limit))
        ]
        sentence = "; ".join(wrong) if wrong else f"{len(wanted)} elements within tolerance"
        return self._conclude(not wrong, f"{text}: {sentence}" if text else sentence, stop=stop)

    def _conclude(self, holds: object, detail: str, *, stop: bool, measurement: Measurement | None = None) -> bool:
        """Count a judgement. An assertion that holds is not reported; one that does not hold ends the test."""
        if not stop:
            return self._session.check(holds, detail, calling_place(__file__), measurement=measurement)
        self._session.judged()
        if not holds:
            raise TestFailure(detail, measurement=measurement)
        return True


def _is_near(value: float, expected: float, tolerance: float) -> bool:
    margin = margin_of(value, expected - tolerance, expected + tolerance)
    return margin is not None and margin >= 0
