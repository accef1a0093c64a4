"""Loads plug-ins in a process like that of a test, to read what they declare, to check values, and to ask for fixtures.

The process has a limited time and is then ended, with all that it started. A plug-in that crashes or hangs while it is
loaded is a finding.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import msgspec

from rtf import clock
from rtf.testing.case import TestCase
from rtf.testing.isolation import messages, processes
from rtf.testing.isolation.messages import Found, Inspect, Use
from rtf.testing.parameters import Declared, ParameterError
from rtf.testing.plugin_makers import fixture_maker, test_maker
from rtf.testing.plugin_spec import ABSENT, UNKNOWN, ParameterSpec, PluginSpec, make_spec
from rtf.testing.plugins import SeveralClassesError
from rtf.testing.session import text_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from rtf.testing.isolation.child import End
    from rtf.testing.isolation.worker import Channel
    from rtf.testing.isolation.worker_pool import ForkServerClient
    from rtf.testing.plugins import PluginRef

#: Seconds in which plug-ins must have been loaded.
LOAD_LIMIT = 30.0


class Trial(msgspec.Struct, frozen=True, kw_only=True):
    """The result of trying a use: each value with its source, the problems, and the fixtures that the test asks for.

    ``no_answer`` says why the test did not name its fixtures.
    """

    values: tuple[dict[str, str], ...] = ()
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    fixtures: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = ()
    no_answer: str = ""


class Inspection(msgspec.Struct, frozen=True, kw_only=True):
    """The description of a plug-in, or why there is none, and a trial of each use, in their order.

    The reason why a plug-in could not be loaded is also a problem of each of its trials.
    """

    spec: PluginSpec = UNKNOWN
    problems: tuple[str, ...] = ()
    trials: tuple[Trial, ...] = ()


def inspect_plugins(wanted: Mapping[PluginRef, Sequence[Use]], *, ask: bool = False) -> dict[PluginRef, Inspection]:
    """Load plug-ins, each once, try the values of their uses, and ``ask`` tests which fixtures they need.

    All are loaded in one process, because their imports take the time. If that process ends too early, each plug-in has
    a process of its own, and if need be each use, so that one that crashes spoils no other's findings.
    """
    from rtf.testing.isolation.worker_pool import ForkServerClient

    fork_server = ForkServerClient()
    try:
        return _inspect(fork_server, wanted, ask) if wanted else {}
    finally:
        fork_server.close()


def _inspect(
    fork_server: ForkServerClient, wanted: Mapping[PluginRef, Sequence[Use]], ask: bool
) -> dict[PluginRef, Inspection]:
    answer = _have_inspected(fork_server, Inspect(tuple((ref, [*uses]) for ref, uses in wanted.items()), ask))
    if not isinstance(answer, str):
        return dict(zip(wanted, answer, strict=True))
    if len(wanted) > 1:
        return {ref: _inspect(fork_server, {ref: uses}, ask)[ref] for ref, uses in wanted.items()}
    ((ref, uses),) = wanted.items()
    if not uses:
        return {ref: Inspection(problems=(answer,))}
    if len(uses) == 1:
        return {ref: Inspection(trials=(Trial(problems=(answer,), no_answer=answer),))}
    found = [_inspect(fork_server, {ref: [use]}, ask)[ref] for use in uses]
    spec = next((one.spec for one in found if one.spec.class_name), UNKNOWN)
    return {ref: Inspection(spec=spec, trials=tuple(one.trials[0] for one in found))}


def _have_inspected(fork_server: ForkServerClient, wanted: Inspect) -> list[Inspection] | str:
    """Return what a process of its own finds, or a sentence on why it found nothing."""
    heard: list[bytes] = []
    child = fork_server.take()
    limit = clock.Deadline.after(LOAD_LIMIT)
    child.begin(wanted, heard.append, lambda _stream, _data: None)
    while not (heard or child.end or limit.expired):
        fork_server.reactor.run_once(limit)
    end = child.end
    child.dismiss()
    return _understand(heard[0]) if heard else _how_it_ended(end)


def _understand(data: bytes) -> list[Inspection] | str:
    try:
        message = messages.from_child(data)
        if isinstance(message, Found):
            return msgspec.convert(message.inspections, list[Inspection])
    except ValueError:
        pass
    return "what it wrote while it was being loaded is no answer: it must leave descriptor 3 alone"


def _how_it_ended(end: End | None) -> str:
    if end is None:
        return f"it did not load within {LOAD_LIMIT:g} s"
    if end.status is None:
        return "the process from which it was forked was lost while it was being loaded"
    how = processes.describe_end(end.exit_status, end.signal)
    return f"its process ended while it was being loaded: {how}"


def inspect_plugin(ref: PluginRef, uses: Sequence[Use] = ()) -> Inspection:
    """Load one plug-in, and try the values of its uses."""
    return inspect_plugins({ref: uses})[ref]


def try_uses(uses: Iterable[tuple[PluginRef, Use]], *, ask: bool = False) -> dict[tuple[PluginRef, Use], Trial]:
    """Try the values of plug-ins' uses; each plug-in is loaded once, and each use tried once."""
    wanted: dict[PluginRef, list[Use]] = {}
    for ref, use in dict.fromkeys(uses):
        wanted.setdefault(ref, []).append(use)
    found = inspect_plugins(wanted, ask=ask)
    return {(ref, use): trial for ref in wanted for use, trial in zip(wanted[ref], found[ref].trials, strict=True)}


# In the process that loads them --------------------------------------------------------------------------------------


def serve(wanted: Inspect, channel: Channel) -> int:
    """Inspect what is wanted. Returns the exit status of the process. A copy that a plug-in forks sends nothing."""
    own = os.getpid()
    found = [_look(ref, uses, wanted.ask) for ref, uses in wanted.plugins]
    if os.getpid() == own:
        channel.send(Found(found))
    return 0


def _look(ref: PluginRef, uses: Sequence[Use], ask: bool) -> Inspection:
    """Load a plug-in; every use has a fresh test or fixture."""
    maker: Callable[[PluginRef], Callable[[], Declared]]
    maker = fixture_maker if ref.kind == "fixture" else test_maker
    try:
        make = maker(ref)
        spec = _spec_of(type(make()))
        found = Inspection(spec=spec, trials=tuple(_try(make(), use, ask) for use in uses))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever keeps a plug-in from loading is the finding
        spec = UNKNOWN
        problem = f"{type(error).__name__}: {text_of(error)}"
        if isinstance(error, SeveralClassesError):
            spec, problem = PluginSpec(safety=None, classes=error.classes), str(error)
        trial = Trial(problems=(problem,))
        found = Inspection(spec=spec, problems=(problem,), trials=(trial,) * len(uses))
    return found


def _spec_of(cls: type[Declared]) -> PluginSpec:
    """Return the description of a class that was loaded."""
    return make_spec(
        cls.__name__,
        (cls.__doc__ or "").strip(),
        lambda name: getattr(cls, name, ABSENT),
        (
            ParameterSpec.declared(
                attribute,
                parameter.key,
                parameter.aliases,
                secret=parameter.secret,
                type=parameter.type_name,
                unit=parameter.unit,
                default=parameter.default_text(),
                range=parameter.range_text(),
                description=parameter.description,
            )
            for attribute, parameter in cls.declarations().items()
        ),
    )


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
