"""Load plug-ins in an isolated child: what they declare, whether values fit, which fixtures tests ask for.

The child is given a limited time and then ended, with all that it started. A plug-in that crashes or hangs while it is
loaded is a finding.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from rtf.testing import plugins
from rtf.testing.case import TestCase
from rtf.testing.isolation.isolated_child import run_isolated
from rtf.testing.parameters import Declared, ParameterError
from rtf.testing.plugin_spec import UNKNOWN, PluginSpec, spec_of_class
from rtf.testing.session import text_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from rtf.testing.plugins import PluginRef
    from rtf.testing.suite.model import FixtureEntry, TestEntry

#: Seconds in which plug-ins must have been loaded.
LOAD_LIMIT = 30.0


class Use(msgspec.Struct, frozen=True, kw_only=True):
    """What a plug-in would be given: the arguments of :meth:`~rtf.testing.parameters.Declared.resolve_parameters`."""

    param: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    overrides: tuple[tuple[str, str], ...] = ()
    environment: str = ""
    place: str = ""
    folder: str = ""

    @classmethod
    def of(cls, entry: TestEntry | FixtureEntry, overrides: Iterable[tuple[str, str]] = ()) -> Use:
        """What an entry of a suite gives to its plug-in."""
        file = entry.location.file
        return cls(
            param=entry.param,
            parameters=entry.parameters,
            overrides=tuple(overrides),
            environment=entry.environment,
            place=str(entry.location) if file else "",
            folder=str(Path(file).parent) if file else "",
        )


class Trial(msgspec.Struct, frozen=True, kw_only=True):
    """What a use came to: each value with its source, what does not fit, and the fixtures that the test asks for.

    ``no_answer`` says why the test did not tell which fixtures.
    """

    values: tuple[dict[str, str], ...] = ()
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    fixtures: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = ()
    no_answer: str = ""


class Inspection(msgspec.Struct, frozen=True, kw_only=True):
    """What was found: the description, why there is none, and a trial of each use, in their order.

    Why a plug-in could not be loaded is also a problem of each of its trials.
    """

    spec: PluginSpec = UNKNOWN
    problems: tuple[str, ...] = ()
    trials: tuple[Trial, ...] = ()


def inspect_plugins(wanted: Mapping[PluginRef, Sequence[Use]], *, ask: bool = False) -> dict[PluginRef, Inspection]:
    """Load plug-ins, each once, try what would be given to them, and ``ask`` tests which fixtures they need.

    All are loaded in one process, because what they import takes the time. When that ends meanwhile, each plug-in has a
    process of its own, and if need be each use, so that one that crashes spoils no other's findings.
    """
    if not wanted:
        return {}
    answer = run_isolated(lambda: {"found": [_look(ref, uses, ask) for ref, uses in wanted.items()]}, LOAD_LIMIT)
    if isinstance(answer, dict):
        return dict(zip(wanted, msgspec.convert(answer["found"], list[Inspection]), strict=True))
    if len(wanted) > 1:
        return {ref: inspect_plugins({ref: uses}, ask=ask)[ref] for ref, uses in wanted.items()}
    ((ref, uses),) = wanted.items()
    if not uses:
        return {ref: Inspection(problems=(answer,))}
    if len(uses) == 1:
        return {ref: Inspection(trials=(Trial(problems=(answer,), no_answer=answer),))}
    found = [inspect_plugins({ref: [use]}, ask=ask)[ref] for use in uses]
    spec = next((one.spec for one in found if one.spec.class_name), UNKNOWN)
    return {ref: Inspection(spec=spec, trials=tuple(one.trials[0] for one in found))}


def inspect_plugin(ref: PluginRef, uses: Sequence[Use] = ()) -> Inspection:
    """Load one plug-in, and try what would be given to it."""
    return inspect_plugins({ref: uses})[ref]


def try_uses(uses: Iterable[tuple[PluginRef, Use]], *, ask: bool = False) -> dict[tuple[PluginRef, Use], Trial]:
    """Try what would be given to plug-ins; each is loaded once, and each use tried once."""
    wanted: dict[PluginRef, list[Use]] = {}
    for ref, use in dict.fromkeys(uses):
        wanted.setdefault(ref, []).append(use)
    found = inspect_plugins(wanted, ask=ask)
    return {(ref, use): trial for ref in wanted for use, trial in zip(wanted[ref], found[ref].trials, strict=True)}


def _look(ref: PluginRef, uses: Sequence[Use], ask: bool) -> object:
    """In the child: load a plug-in; every use has a fresh test or fixture."""
    maker: Callable[[PluginRef], Callable[[], Declared]]
    maker = plugins.fixture_maker if ref.kind == "fixture" else plugins.test_maker
    try:
        make = maker(ref)
        spec = spec_of_class(type(make()))
        found = Inspection(spec=spec, trials=tuple(_try(make(), use, ask) for use in uses))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever keeps a plug-in from loading is the finding
        spec = UNKNOWN
        problem = f"{type(error).__name__}: {text_of(error)}"
        if isinstance(error, plugins.SeveralClassesError):
            spec, problem = PluginSpec(safety=None, classes=error.classes), str(error)
        trial = Trial(problems=(problem,))
        found = Inspection(spec=spec, problems=(problem,), trials=(trial,) * len(uses))
    return msgspec.to_builtins(found)


def _try(plugin: Declared, use: Use, ask: bool) -> Trial:
    try:
        values = plugin.resolve_parameters(**msgspec.structs.asdict(use))
    except ParameterError as error:
        return Trial(problems=error.problems, warnings=tuple(plugin.parameter_warnings))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - likewise
        return Trial(problems=(text_of(error),), warnings=tuple(plugin.parameter_warnings))
    trial = Trial(values=tuple(values), warnings=tuple(plugin.parameter_warnings))
    if not (ask and isinstance(plugin, TestCase)):
        return trial
    try:
        wanted = [(name, [*parameters.items()]) for name, parameters in plugin.implied_fixtures()]
        fixtures = msgspec.convert(wanted, tuple[tuple[str, tuple[tuple[str, str], ...]], ...])
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever it is, there is no answer
        return msgspec.structs.replace(trial, no_answer=f"{type(error).__name__}: {text_of(error)}")
    return msgspec.structs.replace(trial, fixtures=fixtures)
