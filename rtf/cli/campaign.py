"""``rtf campaign``: plan, run and look at campaigns, many runs that are described by one file."""

from __future__ import annotations

import select
import shutil
import signal
import sys
import threading
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Self

import msgspec

from rtf import clock
from rtf.campaigns.backends.backend import BackendLostError
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.store import AGAIN, CampaignStore, State
from rtf.cli.command_tree import RTF
from rtf.cli.parser import add_place_options, count, make_parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping, Sequence

    from rtf.campaigns.backends.backend import Backend
    from rtf.campaigns.campaign import Campaign
    from rtf.campaigns.conductor import Conductor, Progress
    from rtf.campaigns.designs import Design
    from rtf.campaigns.live_page import LivePage
    from rtf.cli.parser import Parser

#: What an average run takes if the campaign's file has none yet: of a simulated robot, of a test without a robot (s),
#: and its journal (bytes).
_ROBOT_SECONDS, _SECONDS, _BYTES = 8.0, 0.5, 20_000
#: Seconds between two lines of progress where there is no terminal.
_SAY = 30.0
_CHECKED = 8  # tasks that differ in test, parameters or overrides, and are checked before the first one is run
_SHOWN = 12  # running tasks, and those without a result, that are listed
#: Seconds for which a lost scheduler is looked for, and between two tries.
_PATIENCE, _PAUSE = 120.0, 1.0
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
    _check_tasks(campaign, design)
    _print_plan(campaign, design.most, _state_of(options))
    return ExitCode.PASSED


def _check_tasks(campaign: Campaign, design: Design) -> None:
    """Check parameters and faults of some tasks as the runner does. Raises CampaignError with what is wrong."""
    from concurrent.futures import ThreadPoolExecutor

    from rtf.campaigns.task_run import Job, encode_job, problems_of

    different = {(task.test, task.suite, task.parameters, task.overrides): task for task in design.tasks({})}
    tasks = [*different.values()][:_CHECKED]
    jobs = [encode_job(Job(task.key, task, campaign.files, campaign.file.timeout)) for task in tasks]
    with ThreadPoolExecutor(2) as pool:
        for task, problems in zip(tasks, pool.map(problems_of, jobs), strict=True):
            if problems:
                raise CampaignError(f"{campaign.path}: {task.described}: {problems}")


def _print_plan(campaign: Campaign, most: int, state: Path) -> None:
    done, means = 0, None
    if state.exists():
        with CampaignStore(state) as store:
            done, means = store.counts().get(State.DONE, 0), store.means()
    origin = f"mean of the {done} that are done" if means else "assumed, as none is done"
    robots = any(not robot.real for robot in campaign.file.robots) or campaign.file.design.kind == "claims"
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
    group, _, _ = RTF.find(["campaign"])
    parser.epilog = f"commands (each has its own --help):\n{group.listing()}\n\n{parser.epilog}"
    parser.add_argument("--workers", metavar="N", type=count, help="workers on this machine (default: the file's)")
    parser.add_argument(
        "--again", action="store_true", help="also what has ended without a result; real robots move again, too"
    )
    parser.add_argument("--dask", metavar="ADDRESS", help="run on the cluster of this scheduler, tls://HOST:PORT")
    parser.add_argument(
        "--insecure",
        action="store_true",
        help="also with a scheduler on the network whose connections are not encrypted",
    )
    parser.add_argument("-w", "--web", action="store_true", help="serve a page that shows it while it runs")
    add_place_options(parser)
    parser.add_argument("--web-keep", action="store_true", help="keep serving the page after the end, until Ctrl-C")
    options = parser.parse_args(words)
    from rtf.campaigns.campaign import load_campaign
    from rtf.campaigns.conductor import Conductor
    from rtf.campaigns.designs import make_design

    campaign = load_campaign(options.file)
    design = make_design(campaign)
    path = _state_of(options)
    with CampaignStore(path, create=True, exclusive=True) as store:
        if not store.counts():
            _check_tasks(campaign, design)
        store.begin(again=options.again)
        with _page(options, path, campaign.file.name) as page:
            with _Backends(campaign, options) as backends:
                assert backends.current is not None
                conductor = Conductor(campaign, design, store, backends.current, backends.again)
                with _signals(conductor), _View(conductor) if sys.stdout.isatty() else _Lines() as display:
                    conductor.run(page.beside(display.show, conductor.stop) if page else display.show)
            if page:
                page.end()
            return _print_end(store, path, interrupted=conductor.stopping)


def _open_backend(campaign: Campaign, options: argparse.Namespace) -> Backend:
    given = campaign.file.backend
    if options.workers is not None:
        given = msgspec.structs.replace(given, workers=options.workers)
    if options.dask:
        given = msgspec.structs.replace(given, kind="dask", address=options.dask, cluster="")
    if given.tls is not None:
        beside = {name: str(campaign.folder / getattr(given.tls, name)) for name in given.tls.__struct_fields__}
        given = msgspec.structs.replace(given, tls=msgspec.structs.replace(given.tls, **beside))
    if given.kind == "local":
        from rtf.campaigns.backends.local import LocalBackend

        return LocalBackend(given.workers, len(campaign.real_robots))
    from rtf.campaigns.backends.dask import DaskBackend

    return DaskBackend(given, insecure=options.insecure)


class _Backends:
    """The backend of a campaign, which is opened again when its scheduler is lost: somebody may restart that."""

    def __init__(self, campaign: Campaign, options: argparse.Namespace) -> None:
        self._open = partial(_open_backend, campaign, options)
        self.current: Backend | None = self._open()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.current is not None:
            self.current.close()

    def again(self, error: BackendLostError) -> Backend:
        """Open it again. Raises BackendLostError when that is not possible for long."""
        print(f"rtf campaign: {error}; trying to connect again for {_PATIENCE:g} s", file=sys.stderr, flush=True)
        deadline = clock.Deadline.after(_PATIENCE)
        if self.current is not None:
            self.current.close()
        while True:
            self.current = None
            try:
                self.current = self._open()
            except BackendLostError:
                if deadline.expired:
                    raise
                clock.sleep(_PAUSE)
            else:
                return self.current


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


@contextmanager
def _page(options: argparse.Namespace, path: Path, name: str) -> Iterator[LivePage | None]:
    """Serve the page while the block runs, if it is wanted; with ``--web-keep`` until Ctrl-C after that."""
    if not options.web:
        yield None
        return
    try:
        from rtf.campaigns.live_page import LivePage, serve_campaign
    except ImportError as error:
        raise CampaignError(f"the web page needs {error.name}: pip install {error.name}") from None
    page = LivePage(path, name)
    with serve_campaign(page, options.web_host, options.web_port) as address:
        print(f"web page: {address}", file=sys.stderr, flush=True)
        yield page
        if options.web_keep:
            print("the page is served until Ctrl-C", file=sys.stderr, flush=True)
            with suppress(KeyboardInterrupt):
                threading.Event().wait()


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
    remaining = f", about {_duration(progress.remaining)} left" if progress.remaining is not None else ""
    dashboard = f", {progress.dashboard}" if progress.dashboard else ""
    return f"{_counted(progress.counts)}{remaining}; {progress.workers}{dashboard}"


def _counted(counts: Mapping[State, int]) -> str:
    return ", ".join(f"{counts[state]} {state}" for state in State if counts.get(state)) or "no runs"


def _print_end(store: CampaignStore, path: Path, *, interrupted: bool) -> ExitCode:
    counts = store.counts()
    _print_findings(store)
    print(f"{_counted(counts)}  ({path})")
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
    print(f"{_counted(counts)}  ({path})")
    if means:
        print(f"{means[0]:.1f} s and {means[1] / 1e3:.1f} kB a run")
    return ExitCode.PASSED


def certs(words: Sequence[str]) -> ExitCode:
    """Write the certificate and the key with which the machines of a cluster know each other."""
    parser = make_parser(
        "campaign certs",
        "Write a key, and a certificate that it signs itself. Scheduler, workers and client that have both trust each"
        " other and nobody else, for a year; who has the key can run code on all of them.",
        "rtf campaign certs keys",
    )
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="where they are written")
    options = parser.parse_args(words)
    from rtf.campaigns.backends.certificates import write_certificates

    certificate, key = write_certificates(options.folder)
    files = f"--tls-ca-file {certificate} --tls-cert {certificate} --tls-key {key}"
    print(f"dask scheduler --protocol tls {files}")
    print(f"dask worker tls://HOST:8786 --nthreads 1 --nworkers auto {files}")
    print('[backend]\nkind = "dask"\naddress = "tls://HOST:8786"\n')
    print(f'[backend.tls]\nauthority = "{certificate}"\ncertificate = "{certificate}"\nkey = "{key}"')
    return ExitCode.PASSED
