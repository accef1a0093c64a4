"""``rtf campaign``: plan, run and look at campaigns, many runs that are described by one file."""

from __future__ import annotations

import select
import shutil
import signal
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.campaigns.store import AGAIN, CampaignStore, State
from rtf.cli.parser import count, make_parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from rtf.campaigns.backends.backend import Backend
    from rtf.campaigns.campaign import Campaign
    from rtf.campaigns.conductor import Conductor, Progress
    from rtf.cli.parser import Parser

#: What an average run takes if the campaign's file has none yet: of a simulated robot, of a test without a robot (s),
#: and its journal (bytes).
_ROBOT_SECONDS, _SECONDS, _BYTES = 8.0, 0.5, 20_000
#: Seconds between two lines of progress where there is no terminal.
_SAY = 30.0
_SHOWN = 12  # running tasks, and those without a result, that are listed
_MINUTE, _HOUR = 60.0, 3600.0


def _parser(word: str, description: str, example: str) -> Parser:
    parser = make_parser(f"campaign {word}".strip(), description, example)
    parser.add_argument("file", metavar="FILE.toml", type=Path, help="the campaign, see docs/campaigns.md")
    parser.add_argument(
        "--state", metavar="FILE", type=Path, help="its results, an SQLite file (default: FILE.sqlite beside it)"
    )
    return parser


def _state_of(options: argparse.Namespace) -> Path:
    path: Path = options.state or options.file.with_suffix(".sqlite")
    return path


def plan(words: Sequence[str]) -> ExitCode:
    """Print how many runs a campaign has, how long they take, and how much disk; nothing is run."""
    parser = _parser(
        "plan",
        "Say how many runs a campaign has, how long they will take, and how much room their results need. Nothing is"
        " run. What an average run takes is known when a few are done, and assumed before that.",
        "rtf campaign plan elbow.toml --list",
    )
    parser.add_argument("--list", action="store_true", help="list the runs; of a sequential design the first ones")
    options = parser.parse_args(words)
    from rtf.campaigns.campaign import load_campaign
    from rtf.campaigns.designs import make_design

    campaign = load_campaign(options.file)
    design = make_design(campaign)
    if options.list:
        for task in {task.key: task for task in design.tasks({})}.values():
            print(f"{task.key}  {task.described}")
    _print_plan(campaign, design.most, _state_of(options))
    return ExitCode.PASSED


def _print_plan(campaign: Campaign, most: int, state: Path) -> None:
    done, means = 0, None
    if state.exists():
        with CampaignStore(state) as store:
            done, means = store.counts().get(State.DONE, 0), store.means()
    origin = f"mean of the {done} that are done" if means else "assumed, as none is done"
    robots = any(not robot.real for robot in campaign.file.robots)
    seconds, size = means or (_ROBOT_SECONDS if robots else _SECONDS, _BYTES)
    workers = _workers(campaign)
    adaptive = "at most " if campaign.file.design.kind == "sequential" else ""
    print(f"{campaign.file.name}: {adaptive}{most} runs, {done} done, design {campaign.file.design.kind}")
    left = max(0, most - done)
    print(
        f"time: {adaptive}{_duration(left * seconds / workers)} on {workers} workers, {seconds:.1f} s a run ({origin})"
    )
    free = shutil.disk_usage(state.absolute().parent).free
    print(f"disk: {adaptive}{left * size / 1e6:.1f} MB, {free / 1e6:.0f} MB are free")
    for robot in campaign.real_robots:
        print(f"real robot: {robot}; its runs are not retried, and its worker's machine must permit them")


def _workers(campaign: Campaign) -> int:
    import os

    return campaign.file.backend.workers or os.cpu_count() or 1


def _duration(seconds: float) -> str:
    if seconds < 2 * _MINUTE:
        return f"{seconds:.0f} s"
    return f"{seconds / _MINUTE:.0f} min" if seconds < 2 * _HOUR else f"{seconds / _HOUR:.1f} h"


# Running -------------------------------------------------------------------------------------------------------------


def run(words: Sequence[str]) -> ExitCode:
    """Run a campaign, or go on with it; returns 0 when every run has a result."""
    parser = _parser(
        "",
        "Run a campaign, or go on with it: what is done is not done again. Ctrl-C begins no further run, and asks what"
        " becomes of those that are going on.",
        "rtf campaign elbow.toml\nrtf campaign run elbow.toml --workers 4\nrtf campaign run elbow.toml --again",
    )
    parser.add_argument("--workers", metavar="N", type=count, help="workers on this machine (default: the file's)")
    parser.add_argument(
        "--again", action="store_true", help="also what has ended without a result; real robots move again, too"
    )
    options = parser.parse_args(words)
    from rtf.campaigns.campaign import load_campaign
    from rtf.campaigns.conductor import Conductor
    from rtf.campaigns.designs import make_design

    campaign = load_campaign(options.file)
    design = make_design(campaign)
    path = _state_of(options)
    with CampaignStore(path, create=True, exclusive=True) as store:
        store.begin(again=options.again)
        with _backend(campaign, options) as backend:
            conductor = Conductor(campaign, design, store, backend)
            with _signals(conductor), _View(conductor) if sys.stdout.isatty() else _Lines() as display:
                conductor.run(display.show)
        return _print_end(store, path, interrupted=conductor.stopping)


@contextmanager
def _backend(campaign: Campaign, options: argparse.Namespace) -> Iterator[Backend]:
    from rtf.campaigns.backends.local import LocalBackend

    given = campaign.file.backend
    workers = given.workers if options.workers is None else options.workers
    backend = LocalBackend(workers, len(campaign.real_robots))
    try:
        yield backend
    finally:
        backend.close()


@contextmanager
def _signals(conductor: Conductor) -> Iterator[None]:
    """Stop on Ctrl-C; on a second one, or SIGTERM, drop what is running."""

    def interrupted(number: int, _frame: object) -> None:
        conductor.stop(drop=conductor.stopping or number != signal.SIGINT)

    before = [(number, signal.signal(number, interrupted)) for number in (signal.SIGINT, signal.SIGTERM)]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


class _Lines:
    """Prints a line of progress now and then."""

    def __init__(self) -> None:
        self._next = clock.Deadline.after(_SAY)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def show(self, progress: Progress) -> None:
        """Print a line, if the last one is long ago."""
        if self._next.expired:
            self._next = clock.Deadline.after(_SAY)
            print(_summary(progress), flush=True)


class _View:
    """The view on a terminal, with the question what becomes of running tasks when the campaign is stopped."""

    def __init__(self, conductor: Conductor) -> None:
        from rich.console import Console
        from rich.live import Live

        self._conductor = conductor
        self._live = Live(console=Console(highlight=False), refresh_per_second=4, transient=True)

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, progress: Progress) -> None:
        """Draw the progress, and take the answer to the question."""
        from rich.console import Group, RenderableType
        from rich.progress_bar import ProgressBar
        from rich.text import Text

        counts = progress.counts
        over = sum(counts.values()) - counts.get(State.WAITING, 0) - counts.get(State.RUNNING, 0)
        lines: list[RenderableType] = [
            Text(_summary(progress)),
            ProgressBar(total=max(1, sum(counts.values())), completed=over, width=60),
        ]
        lines += [Text(f"  {task}", style="dim") for task in progress.running[:_SHOWN]]
        if len(progress.running) > _SHOWN:
            lines.append(Text(f"  and {len(progress.running) - _SHOWN} others", style="dim"))
        lines += [Text(f"  {robot}: {task}") for robot, task in progress.robots.items()]
        if progress.stopping:
            lines.append(Text("Stopping when these have ended. Type d and Enter, or Ctrl-C again, to drop them."))
            if select.select([sys.stdin], [], [], 0)[0] and sys.stdin.readline().strip().lower().startswith("d"):
                self._conductor.stop(drop=True)
        self._live.update(Group(*lines))


def _summary(progress: Progress) -> str:
    counts = progress.counts
    words = [f"{counts[state]} {state}" for state in State if counts.get(state)]
    remaining = f", about {_duration(progress.remaining)} left" if progress.remaining is not None else ""
    return f"{', '.join(words)}{remaining}; {progress.workers}"


def _print_end(store: CampaignStore, path: Path, *, interrupted: bool) -> ExitCode:
    counts = store.counts()
    _print_findings(store)
    print(f"{', '.join(f'{counts[state]} {state}' for state in State if counts.get(state))}  ({path})")
    if interrupted:
        print("CAMPAIGN INTERRUPTED  go on with it by the same command")
        return ExitCode.INTERRUPTED
    if any(counts.get(state) for state in AGAIN):
        print("CAMPAIGN ENDED  some runs have no result; see above, and run them again with --again")
        return ExitCode.FAILURES
    print(f"CAMPAIGN DONE  {counts.get(State.DONE, 0)} runs")
    return ExitCode.PASSED


def _print_findings(store: CampaignStore) -> None:
    endings = store.endings()
    for task, state, detail in endings[:_SHOWN]:
        print(f"{state}: {task.described}: {detail}")
    if len(endings) > _SHOWN:
        print(f"and {len(endings) - _SHOWN} others without a result")


def status(words: Sequence[str]) -> ExitCode:
    """Print how far a campaign is, while it runs or later."""
    parser = _parser("status", "Say how far a campaign is, while it runs or later.", "rtf campaign status elbow.toml")
    options = parser.parse_args(words)
    path = _state_of(options)
    with CampaignStore(path) as store:
        counts = store.counts()
        means = store.means()
        _print_findings(store)
    print(f"{', '.join(f'{counts[state]} {state}' for state in State if counts.get(state)) or 'no runs'}  ({path})")
    if means:
        print(f"{means[0]:.1f} s and {means[1] / 1e3:.1f} kB a run")
    return ExitCode.PASSED
