"""The live region at the bottom of a terminal: suites, fixtures, running tests with elapsed time and limit, counts.

It needs rich, whose import takes long, and is therefore imported only for a terminal.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, TextIO

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from rtf import clock
from rtf.testing.events import (
    Answered,
    Asked,
    FixtureChanged,
    PhaseStarted,
    Progressed,
    TestEnded,
    TestPlanned,
    TestStarted,
)
from rtf.testing.report.text import counts, duration, one_line
from rtf.testing.verdict import FixtureState, Verdict

if TYPE_CHECKING:
    from rich.console import RenderableType

    from rtf.testing.events import Event
    from rtf.testing.results import RunResult

#: A terminal has few lines; so many running tests and fixtures are shown.
_ROWS = 6


@dataclass(slots=True)
class _Running:
    """A test that runs: its start, its phase with start and limit, and its progress."""

    name: str
    began: float
    phase: str = ""
    phase_began: float = 0.0
    limit: float | None = None
    progress: str = ""


class Region:
    """Shows the present state. ``take`` and ``print`` are called in the order of events; rich draws in its own thread.

    The two threads share nothing but whole values: the drawing thread works on copies that are made in one step.
    """

    def __init__(self, stream: TextIO, *, coloured: bool) -> None:
        self._console = Console(
            file=stream, force_terminal=True, no_color=not coloured, highlight=False, markup=False, emoji=False
        )
        self._running: dict[str, _Running] = {}
        self._fixtures: dict[tuple[str, str], FixtureChanged] = {}
        self._durations: list[float] = []
        self._counts: Counter[Verdict] = Counter()
        self._questions: set[str] = set()
        self._suite = ""
        self._left = 0
        self._live = self._start()

    def _start(self) -> Live:
        live = Live(
            console=self._console,
            get_renderable=self._render,
            transient=True,
            refresh_per_second=4,
            redirect_stderr=False,
        )
        live.start()
        return live

    def print(self, text: str) -> None:
        """Print above the region; the text may have colours and is taken as it is otherwise."""
        self._console.print(Text.from_ansi(text), soft_wrap=True)

    def refresh(self) -> None:
        """Draw the region now; otherwise it is drawn four times a second."""
        self._live.refresh()

    def close(self) -> None:
        """Remove the region."""
        self._live.stop()

    def take(self, event: Event, results: RunResult) -> None:
        """Take one event in."""
        match event:
            case TestPlanned():
                self._left += 1
            case TestStarted():
                test, suite = results.tests.get(event.test), results.suite_of(event.test)
                self._suite = one_line(suite.name) if suite is not None else ""
                name = one_line(test.name if test is not None else event.test)
                self._running[event.test] = _Running(name, event.time, phase_began=event.time)
            case PhaseStarted() if event.test in self._running:
                running = self._running[event.test]
                running.phase, running.phase_began, running.limit = event.phase, event.time, event.limit
            case Progressed() if event.test in self._running:
                progress = f"{100 * event.fraction:.0f} % {one_line(event.text)}"
                self._running[event.test].progress = progress.rstrip()
            case TestEnded():
                self._test_ended(event)
            case FixtureChanged(state=FixtureState.STOPPED):
                self._fixtures.pop((event.suite, event.fixture), None)
            case FixtureChanged():
                self._fixtures[event.suite, event.fixture] = event
            case Asked() | Answered():
                self._question(event)

    def _test_ended(self, event: TestEnded) -> None:
        self._running.pop(event.test, None)
        if event.final:
            self._durations.append(event.duration)
            self._counts[event.verdict] += 1
            self._left -= 1

    def _question(self, event: Asked | Answered) -> None:
        """Hide the region while a question waits for an answer."""
        self._live.stop()
        if isinstance(event, Asked):
            self._questions.add(event.question)
            return
        self._questions.discard(event.question)
        if not self._questions:
            self._live = self._start()

    # In the drawing thread ---------------------------------------------------------------------------------------

    def _render(self) -> RenderableType:
        now = clock.now()
        rows = [self._fixture_row(changed) for changed in [*self._fixtures.values()][:_ROWS]]
        rows += [self._test_row(running, now) for running in [*self._running.values()][:_ROWS]]
        counted = counts(self._counts.copy())
        parts = [part for part in (self._suite, counted, f"{self._left} to go" if self._left > 0 else "") if part]
        durations = [*self._durations]
        if durations and self._left > 0:
            parts.append(f"about {duration(median(durations) * self._left)} left")
        rows.append(Text("  ".join(parts), style="bold", no_wrap=True, overflow="ellipsis"))
        return Group(*rows)

    @staticmethod
    def _fixture_row(changed: FixtureChanged) -> Text:
        text = f"  {one_line(changed.fixture)} #{changed.generation} {changed.state}"
        good = changed.state in (FixtureState.READY, FixtureState.STARTING, FixtureState.STOPPING)
        return Text(text, style="dim" if good else "red", no_wrap=True, overflow="ellipsis")

    @staticmethod
    def _test_row(running: _Running, now: float) -> Text:
        elapsed = duration(max(0.0, now - running.began))
        limit = ""
        if running.limit is not None:
            spent = duration(max(0.0, now - running.phase_began))
            limit = f", {running.phase} {spent} of {duration(running.limit)}"
        text = f"  {running.name}  {elapsed}{limit}  {running.progress}"
        return Text(text.rstrip(), style="cyan", no_wrap=True, overflow="ellipsis")
