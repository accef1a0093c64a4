"""The run of one task, by the ordinary runner in a process of its own: bytes to bytes.

A worker needs nothing but RTF: files that are not shipped come with the task. Its result is the journal, compressed.
Nothing is raised: what went wrong is a status of the result, because a client unpacks no exception of a worker.

A run on a real robot is begun at most once on a machine: a cluster that gives the task to a restarted worker again does
not move the robot again. It is begun only if :data:`PERMITTED` of the worker's own environment names the robot.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import zlib
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO
from xml.sax.saxutils import escape, quoteattr

import msgspec
from msgspec import Struct

from rtf import clock
from rtf.campaigns.campaign import suite_path
from rtf.campaigns.task_folder import task_folder
from rtf.campaigns.tasks import Task
from rtf.testing import journal
from rtf.testing.events import EventError, Interrupted, RunEnded
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from rtf.campaigns.tasks import RealRobot

#: The variable of a worker's environment with the names of the real robots that campaigns may move, commas between.
PERMITTED = "RTF_CAMPAIGN_ROBOTS"
#: The suite of a task that is a test.
SUITE = "campaign"
#: Seconds that a run may take beyond the limit of its test: its fixtures start and end in them.
_FIXTURES = 120.0
#: Seconds after which a runner that should have ended by itself is killed, and those that one has to end in order.
_LATE, _STOP = 60.0, 10.0
_SAID = 2000  # characters of the runner's last words that are kept


class Status(StrEnum):
    """What became of a task on a worker."""

    DONE = "done"  # it ran to its end; the journal has the verdicts
    KILLED = "killed"  # its runner died
    BROKEN = "broken"  # it could not begin
    REFUSED = "refused"  # the worker's machine does not permit this robot to be moved
    BEGUN = "begun"  # it was begun on this real robot before


class Job(Struct, frozen=True, forbid_unknown_fields=True):
    """What a worker is sent: a task, the files it needs, and how long it may take (s).

    ``attempt`` distinguishes a run on a real robot that a person has asked for again from one that only came again.
    """

    key: str
    task: Task
    files: dict[str, bytes]
    timeout: float
    attempt: int = 1


class TaskResult(Struct, frozen=True, forbid_unknown_fields=True):
    """What a worker sends back; ``journal`` is compressed by zlib, ``seconds`` is what the run took with its start."""

    status: Status
    detail: str = ""
    journal: bytes = b""
    seconds: float = 0.0


_encode = msgspec.msgpack.Encoder().encode
_job_of = msgspec.msgpack.Decoder(Job).decode
_result_of = msgspec.msgpack.Decoder(TaskResult).decode


def encode_job(job: Job) -> bytes:
    """Return the bytes that :func:`run_task` takes."""
    return _encode(job)


def decode_result(data: bytes) -> TaskResult:
    """Return the result in the bytes of :func:`run_task`. Raises msgspec.MsgspecError for any others."""
    return _result_of(data)


def run_task(data: bytes) -> bytes:
    """Run a task and return its result. Called in a worker."""
    return TaskRun(data).result()


def problems_of(data: bytes) -> str:
    """Return what the runner says is wrong with a job: parameters, fixtures, the fault. Nothing is run.

    Raises OSError if the runner cannot be started.
    """
    return TaskRun(data).problems()


class TaskRun:
    """A task that is being run; :meth:`stop` ends it from another thread."""

    def __init__(self, data: bytes) -> None:
        self._job = _job_of(data)
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    def result(self) -> bytes:
        """Run it to its end, and return its result."""
        return _encode(self._run())

    def stop(self) -> None:
        """End the run in order, with its fixtures; a real robot is stopped."""
        self._stopped = True
        if self._process is not None:
            processes.signal_process(self._process.pid, signal.SIGTERM)

    def problems(self) -> str:
        """Return what the runner says is wrong; empty if nothing is."""
        with task_folder() as (folder, _):
            self._write_files(folder)
            words = [*self._words(folder, folder / self._job.key), "--dry-run"]
            done = subprocess.run(
                words,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
            )
        return (done.stderr.strip() or done.stdout.strip()) if done.returncode else ""

    def _run(self) -> TaskResult:
        robot = self._job.task.real
        if robot is not None and robot.name not in os.environ.get(PERMITTED, "").split(","):
            return TaskResult(Status.REFUSED, f"{PERMITTED} of this worker's machine does not name {robot.name}")
        try:
            if robot is not None and not _first_time(f"{self._job.key}-{self._job.attempt}"):
                return TaskResult(
                    Status.BEGUN, f"it was begun on {robot.name} before, and is not begun by itself again"
                )
            with task_folder() as (folder, keeper):
                return self._run_in(folder, keeper)
        except OSError as error:
            return TaskResult(Status.BROKEN, f"{type(error).__name__}: {error}")

    def _write_files(self, folder: Path) -> None:
        for name, content in self._job.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    def _run_in(self, folder: Path, keeper: int) -> TaskResult:
        self._write_files(folder)
        run, said, began = folder / self._job.key, folder / "said", clock.monotonic()
        with said.open("wb") as stream:
            status = self._execute(self._words(folder, run), folder, stream, keeper)
        data = run / journal.FILE_NAME
        words = said.read_text(encoding="utf-8", errors="replace").strip()[-_SAID:]
        if _ran_to_its_end(data):
            return TaskResult(Status.DONE, "", zlib.compress(data.read_bytes(), 6), clock.monotonic() - began)
        if status >= 0 and not data.exists():
            return TaskResult(Status.BROKEN, words or f"the runner ended with {status} and has no journal")
        return TaskResult(Status.KILLED, f"the runner {_end(status)}. {words}".strip())

    def _execute(self, words: list[str], folder: Path, said: BinaryIO, keeper: int) -> int:
        parent = os.getpid()
        # Of a client or worker that dies a simulated run is worth nothing; a real robot is stopped in order.
        last = signal.SIGTERM if self._job.task.real else signal.SIGKILL

        def tie() -> None:
            processes.die_with_parent(last)
            if os.getppid() != parent:  # it died in between
                os._exit(1)

        process = self._process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=self._environment(folder),
            start_new_session=True,
            pass_fds=(keeper,),
            preexec_fn=tie,  # noqa: PLW1509 - it makes two system calls and takes no lock
        )
        if self._stopped:
            self.stop()
        # Not Popen.wait() with a limit, which looks every 50 ms.
        if not processes.ends_within(process.pid, self._job.timeout + _FIXTURES + _LATE):
            self.stop()
            if not processes.ends_within(process.pid, _STOP):
                process.kill()
        return process.wait()

    def _environment(self, folder: Path) -> dict[str, str]:
        environment = {**os.environ}
        if self._job.task.real is not None:
            from rtf.middleware.naming.configuration import write_place
            from rtf.middleware.wire.contact import Contact

            robot = self._job.task.real
            environment |= {"YARP_CONFIG_HOME": str(folder / "yarp"), "YARP_NAMESPACE": robot.namespace}
            (folder / "yarp").mkdir()
            write_place(Contact(robot.namespace, robot.host, robot.port, "tcp"), environment=environment)
        return environment

    def _words(self, folder: Path, run: Path) -> list[str]:
        """Return the command line of the runner."""
        job, task = self._job, self._job.task
        if task.suite:
            suite, limit = suite_path(task.suite, folder), job.timeout
        else:
            suite, limit = folder / "campaign.xml", job.timeout + _FIXTURES
            suite.write_text(_suite(job, folder), encoding="utf-8")
        overrides = [*task.overrides]
        if task.suite and task.fault is not None:
            overrides.append(("inject", task.fault.injection))
        return [
            *(sys.executable, "-P", "-m", "rtf.cli.testrunner", "--suite", str(suite), "--run-folder", str(run)),
            *("--no-config", "--no-output", "--quiet", "--no-summary", "--answer", "default"),
            *("--run-timeout", f"{limit:g}", "--robot", _robot_of(task)),
            *(["--allow-motion"] if task.real else []),
            *(word for name, value in task.define for word in ("--define", f"{name}={_local(name, value, folder)}")),
            *(word for name, value in overrides for word in ("--set", f"{name}={value}")),
        ]


def _first_time(name: str) -> bool:
    """Return whether a run of this name was never begun on this machine, and note that it is begun now."""
    import platformdirs

    folder = Path(platformdirs.user_state_dir("rtf", appauthor=False)) / "campaigns"
    folder.mkdir(parents=True, exist_ok=True)
    try:
        descriptor = os.open(folder / name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
    except FileExistsError:
        return False
    os.write(descriptor, f"{clock.local_stamp(clock.now())}\n".encode())
    os.fsync(descriptor)
    os.close(descriptor)
    return True


def _ran_to_its_end(path: Path) -> bool:
    """Return whether a journal has its last event, and no signal from outside ended the run."""
    ended = False
    with suppress(journal.JournalError, EventError):
        for event in journal.read(path):
            if isinstance(event, Interrupted) and event.source.startswith("SIG"):
                return False
            ended = isinstance(event, RunEnded)
    return ended


def _end(status: int) -> str:
    """Return how a process ended whose status :mod:`subprocess` gives."""
    return f"was killed by {processes.signal_name(-status)}" if status < 0 else f"ended with exit status {status}"


def _robot_of(task: Task) -> str:
    return f"{task.robot}-unit{task.unit}" if task.unit else task.robot


def _local(name: str, value: str, folder: Path) -> str:
    """Return the value of a variable of a suite; a robot whose file came with the task is there."""
    return _local_model(value, folder) if name == "model" else value


def _local_model(model: str, folder: Path) -> str:
    return str(folder / model) if "/" in model and (folder / model).exists() else model


# The suite of a task that is a test -----------------------------------------------------------------------------------


def _suite(job: Job, folder: Path) -> str:
    task = job.task
    lines = [f"<suite name={quoteattr(SUITE)}>"]
    if task.real is not None:
        lines += _real(task.real)
    elif task.model:
        lines += _simulated(job, _local_model(task.model, folder))
    lines.append(f'<test name={quoteattr(Path(task.test).stem)} timeout="{job.timeout:g}">')
    rows = [*task.parameters, *([("inject", task.fault.injection)] if task.fault is not None else [])]
    lines += [f"<parameter name={quoteattr(name)}>{escape(value)}</parameter>" for name, value in rows]
    lines += [escape(task.test), "</test>", "</suite>"]
    return "\n".join(lines)


def _simulated(job: Job, model: str) -> list[str]:
    """Return a name server and a simulated robot in lockstep, whose names no other run has."""
    task, place = job.task, f"/campaign-{job.key}"
    names = f'<fixture name="names" param="--namespace {place}">yarpserver</fixture>'
    if task.configuration:
        from rtf.robot_testing.proof.suites import configured_robot  # it loads the simulator, which few tasks need

        words = ("--seed", str(task.seed), "--unit", str(task.unit))
        robot = configured_robot(task.configuration, f"{place}/clock", *words)
        return [names, '<fixture name="robot" depends="names">', robot, "</fixture>"]
    cameras = "auto" if task.cameras else "no"
    rows = {"model": model, "seed": task.seed, "unit": task.unit, "cameras": cameras, "clock": f"{place}/clock"}
    rows |= dict(task.simulator)
    return [
        f"<environment>--robotmodel {quoteattr(model)}</environment>",
        names,
        '<fixture name="robot" depends="names">',
        *(f"<parameter name={quoteattr(name)}>{escape(str(value))}</parameter>" for name, value in rows.items()),
        "simulator</fixture>",
    ]


def _real(robot: RealRobot) -> list[str]:
    return [
        f"<environment>--robotname {escape(robot.ports)}</environment>",
        f'<fixture name="names" param="--existing --namespace {escape(robot.namespace)}">yarpserver</fixture>',
    ]
