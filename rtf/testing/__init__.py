"""The xUnit core: test cases, fixtures, suites, the runner and its events. It knows neither robots nor ports.

Authors of tests and fixtures find here what they need: ``from rtf.testing import TestCase, Parameter, Unit``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtf.testing.case import TestCase
    from rtf.testing.fixture import FixtureManager, FixtureUnusable, FixtureValue, Value
    from rtf.testing.measurement import Measurement, Unit
    from rtf.testing.parameters import Parameter
    from rtf.testing.plugin_spec import Matrix
    from rtf.testing.reporting import Reporter
    from rtf.testing.verdict import FixtureCollapsed, Inconclusive, SkipTest, TestFailure, TestProblem

__all__ = [
    "FixtureCollapsed",
    "FixtureManager",
    "FixtureUnusable",
    "FixtureValue",
    "Inconclusive",
    "Matrix",
    "Measurement",
    "Parameter",
    "Reporter",
    "SkipTest",
    "TestCase",
    "TestFailure",
    "TestProblem",
    "Unit",
    "Value",
]

_HOMES = {
    "FixtureCollapsed": "verdict",
    "FixtureManager": "fixture",
    "FixtureUnusable": "fixture",
    "FixtureValue": "fixture",
    "Inconclusive": "verdict",
    "Matrix": "plugin_spec",
    "Measurement": "measurement",
    "Parameter": "parameters",
    "Reporter": "reporting",
    "SkipTest": "verdict",
    "TestCase": "case",
    "TestFailure": "verdict",
    "TestProblem": "verdict",
    "Unit": "measurement",
    "Value": "fixture",
}


def __getattr__(name: str) -> object:
    """Load a public name when it is first used, so that ``testrunner --help`` does not load the runner."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"rtf.testing.{home}"), name)
    globals()[name] = value
    return value
