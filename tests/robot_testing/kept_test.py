"""Robot tests without a runner, which keep their measurements and the ends of their sub-results."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import find

if TYPE_CHECKING:
    from collections.abc import Iterator


def kept_test(name: str, **attributes: Any) -> Any:
    """Return a test of ``icub_tests`` with such attributes.

    Its results are in ``kept``: ``values`` by name, ``failures`` with a sentence each, ``ended`` with the exceptions of
    sub-results by subject, and ``reports``.
    """
    test: Any = load_test(find("test", name))
    kept = SimpleNamespace(values={}, failures=[], ended={}, reports=[])

    def measure(
        name: str, value: float, unit: str = "", low: float | None = None, high: float | None = None, hint: str = ""
    ) -> SimpleNamespace:
        kept.values[name] = value
        fine = (low is None or value >= low) and (high is None or value <= high)
        if not fine:
            kept.failures.append(f"{name} is {value}; {hint}")
        return SimpleNamespace(verdict=MeasurementVerdict.PASSED if fine else MeasurementVerdict.FAILED)

    def check(condition: object, text: str) -> None:
        if not condition:
            kept.failures.append(text)

    @contextmanager
    def subresult(subject: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # noqa: BLE001 - whatever it is, it is kept
            kept.ended[subject] = error

    test._session = SimpleNamespace(judged=lambda: None)
    test.kept, test.measure, test.check, test.subresult = kept, measure, check, subresult
    test.check_fail_if_false = check
    test.check_fail_if_true = lambda condition, text: check(not condition, text)
    test.record, test.progress, test.report = (lambda *_, **__: None), (lambda *_: None), kept.reports.append
    for key, value in attributes.items():
        setattr(test, key, value)
    return test
