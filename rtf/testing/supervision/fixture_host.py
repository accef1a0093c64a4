"""The process in which one generation of a fixture lives.

It says ``listening`` when it can be interrupted, ``ready`` when it is set up, then ``alive`` after each check that
held, ``collapsed`` at most once, ``failed`` when setting up did not work, ``doing`` before each of the last things, and
``done`` when everything is torn down. It obeys ``check``, ``enter_safe_state`` and ``teardown``. SIGTERM makes it leave
what it is doing and tear down. When its runner is gone it waits for the SIGTERM of the fork server, which ends fixtures
in order; when the fork server is gone the kernel sends it.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
from typing import TYPE_CHECKING

from rtf import clock
from rtf.testing import plugins
from rtf.testing.events import Message, OutputCaptured
from rtf.testing.fixture import FixtureManager, FixtureUnusable
from rtf.testing.isolation import processes
from rtf.testing.isolation.messages import SAFE_STATE_NAME, Command, Said
from rtf.testing.outcome import FixtureCollapsed, TestStopped
from rtf.testing.session import author_traceback, bounded
from rtf.testing.source_location import raised_place
from rtf.testing.verdict import Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    import msgspec

    from rtf.testing.isolation.messages import Job
    from rtf.testing.isolation.worker import Channel

#: Seconds to wait for the order in which the fork server has fixtures torn down when the runner is gone: it has those
#: that stand on this one park first. A fork server that is gone as well makes itself felt at once.
ORPHAN_PATIENCE = 600.0


class Host:
    """Runs one fixture manager and speaks for it. Any thread may speak; the main thread does the work."""

    def __init__(self, job: Job, channel: Channel) -> None:
        self.generation = job.attempt
        self.name = job.id
        self._job = job
        self._channel = channel
        self._main = threading.get_ident()
        self._sending = False  # the main thread is in the middle of a message, which must be whole
        self._phase = Phase.LOAD
        self._collapse_lock = threading.Lock()
        self._cause: str | None = None  # why it collapsed, once it has
        self._stoppable = False
        self._stopped = False
        self._lost = False
        self._provided: set[str] = set()  # the keys of the values that were handed on

    # What the manager says ---------------------------------------------------------------------------------------

    def say(self, word: str, **members: object) -> None:
        """Send a word to the runner, with what belongs to it; any thread may. What JSON lacks is sent as text."""
        self._send(Said(word, json.loads(json.dumps(members, default=str))))

    def _send(self, message: msgspec.Struct) -> None:
        main = threading.get_ident() == self._main
        if main:
            self._sending = True
        try:
            self._channel.send(message)
        finally:
            if main:
                self._sending = False
        if main and self._stopped and self._stoppable:
            self._leave()

    def message(self, severity: Severity, title: str, detail: object, place: tuple[str, int]) -> None:
        """Send a message of the fixture into the journal."""
        event = Message(
            severity=severity,
            title=title,
            detail=bounded(str(detail)),
            fixture=self.name,
            phase=self._phase,
            file=place[0],
            line=place[1],
        )
        self._send(event)

    def output(self, text: object, stream: str) -> None:
        """Send what a program of the fixture wrote: a line, or several."""
        self._send(OutputCaptured(stream=stream, text=bounded(str(text)) + "\n", fixture=self.name))

    def announce_collapse(self, reason: object, *, exit_status: int | None, signal_name: str, output: str) -> None:
        """Say once that the fixture collapsed."""
        cause = bounded(str(reason)) or "no reason was given"
        with self._collapse_lock:
            if self._cause is not None:
                return
            self._cause = cause
        self.say(
            "collapsed",
            phase=self._phase,
            cause=cause,
            exit_status=exit_status,
            signal=signal_name,
            output=bounded(str(output)),
        )

    def provide_value(self, key: str, value: object) -> None:
        """Hand a value to those that stand on the fixture, and into the journal."""
        self._provided.add(key)
        self.say("value", key=key, value=value)
        self.message(Severity.INFO, "provides", f"{key} = {json.dumps(value)}", ("", 0))

    # The life ----------------------------------------------------------------------------------------------------

    def live(self) -> None:
        """Load, set up, watch and tear down."""
        self.say("listening")
        manager = self._load()
        if manager is not None:
            up = self._set_up(manager)
            if up:
                parks = type(manager).enter_safe_state is not FixtureManager.enter_safe_state
                robot = bool(manager.occupies) and parks
                self.say("ready", of_robot=robot, stop_limit=manager.stop_limit)
                self._watch(manager)
            self._come_down(manager, up=up)
        self.say("done")

    def _load(self) -> FixtureManager | None:
        made: list[FixtureManager] = []

        def load() -> None:
            job = self._job
            manager = plugins.load_fixture(job.plugin)
            manager.attach_to(self, job.environment)
            manager.take_fixture_values(job.values)
            manager.resolve_parameters(
                param=job.param,
                parameters=job.parameters,
                overrides=job.overrides,
                environment=job.environment,
                place=job.suite_place,
                folder=job.suite_folder,
            )
            for warning in manager.parameter_warnings:
                self.message(Severity.WARNING, "parameters", warning, ("", 0))
            made.append(manager)

        error = self._stoppably(load)
        if error is not None and not isinstance(error, TestStopped):
            self._failed(error, hopeless=True)
        return made[0] if made and error is None else None

    def _set_up(self, manager: FixtureManager) -> bool:
        def set_up() -> None:
            if self.generation > 1:
                manager.before_restart(self.generation)
            if manager.setup() is False:
                raise FixtureCollapsed("setup() returned False")
            missing = [key for key in manager.provides if key not in self._provided]
            if missing:
                raise FixtureUnusable(f"setup() of fixture {self.name!r} did not provide {', '.join(missing)}")

        self._phase = Phase.SETUP
        error = self._stoppably(set_up)
        if error is not None and not isinstance(error, TestStopped):
            self._failed(error, hopeless=isinstance(error, FixtureUnusable))
        return error is None and self._cause is None

    def _failed(self, error: BaseException, *, hopeless: bool) -> None:
        """Say that the fixture is not usable, and why; ``hopeless`` if another try would come to the same."""
        known = isinstance(error, FixtureCollapsed)
        self.say(
            "failed",
            hopeless=hopeless,
            phase=self._phase,
            cause=bounded(_text(error) if known else _named(error)),
            traceback="" if known else author_traceback(error),
        )

    def _watch(self, manager: FixtureManager) -> None:
        """Check once in a while, and obey, until the end is asked for."""
        self._phase = Phase.CHECK
        while not self._stopped and not self._lost:
            command = self._next_command()
            kind = "check" if command is None else command.command
            if kind == "teardown":
                self._note_reason(command)
                return
            if kind == "enter_safe_state":
                self._enter_safe_state(manager)
            elif not self._stopped and not self._lost:
                self._check(manager)
            if command is not None:
                self.say("answered")
        if not self._stopped:  # without a runner, the fork server says whose turn it is, dependents first
            self._stoppably(lambda: clock.sleep(ORPHAN_PATIENCE))

    def _next_command(self) -> Command | None:
        received: list[Command | None] = [None]

        def receive() -> None:
            message = self._channel.receive(self._job.check_period)
            received[0] = message if isinstance(message, Command) else None

        error = self._stoppably(receive)
        if error is not None and not isinstance(error, TestStopped):
            self._lost = True  # the author's code has closed the channel
        return received[0]

    def _note_reason(self, command: Command | None) -> None:
        if command is not None and command.detail and self._cause is None:
            self._cause = command.detail

    def _check(self, manager: FixtureManager) -> None:
        if self._cause is not None:
            return
        held: list[bool | None] = []
        error = self._stoppably(lambda: held.append(manager.check()))
        if isinstance(error, TestStopped):
            return
        if isinstance(error, FixtureCollapsed):
            self._collapse(_text(error))
        elif error is not None:
            self._collapse(f"check() raised {_named(error)}")
        elif held[0] is False:
            self._collapse("check() returned False")
        else:
            self.say("alive")

    def _enter_safe_state(self, manager: FixtureManager) -> None:
        """A fixture whose state after a test is unknown is as good as gone."""
        error = self._stoppably(manager.enter_safe_state)
        if error is not None and not isinstance(error, TestStopped):
            self._collapse(f"enter_safe_state() raised {_named(error)}")

    def _collapse(self, cause: str) -> None:
        self.announce_collapse(cause, exit_status=None, signal_name="", output="")

    # The end -----------------------------------------------------------------------------------------------------

    def _come_down(self, manager: FixtureManager, *, up: bool) -> None:
        self._phase = Phase.TEARDOWN
        self._read_pending_reason()
        cause = self._cause
        if up and cause is not None:
            self._last_thing("on_collapse()", lambda: manager.on_collapse(cause))
        elif up:
            with processes.named(SAFE_STATE_NAME):
                self._last_thing("enter_safe_state()", manager.enter_safe_state)
        self.say("doing", what="teardown()")
        self._tell(self._caught(manager.teardown), "teardown()")

    def _read_pending_reason(self) -> None:
        """The runner that interrupts says before why."""
        with contextlib.suppress(OSError):  # the author's code has closed the channel
            while (command := self._channel.receive(0)) is not None:
                if isinstance(command, Command) and command.command == "teardown":
                    self._note_reason(command)

    def _last_thing(self, what: str, function: Callable[[], object]) -> None:
        """Do something that must not keep teardown from being done: it may be interrupted on its own."""
        self.say("doing", what=what)
        self._stopped = False
        self._tell(self._stoppably(function), what)

    def _tell(self, error: BaseException | None, what: str) -> None:
        if error is None:
            return
        stopped = isinstance(error, TestStopped)
        cause = f"{what} did not come back and was interrupted" if stopped else f"{what} raised {_named(error)}"
        trace = "" if stopped else author_traceback(error)
        file, line = raised_place(error)
        self.say("problem", phase=self._phase, cause=bounded(cause), traceback=trace, file=file, line=line)

    # Being stopped from outside ----------------------------------------------------------------------------------

    def on_signal(self, _signum: int, _frame: FrameType | None) -> None:
        """Leave what is being done, to tear down. Teardown itself is never left."""
        self._stopped = True
        if self._stoppable and not self._sending:
            self._leave()

    def _leave(self) -> None:
        self._stoppable = False
        raise TestStopped

    def lost_runner(self) -> None:
        """There is nobody left to work for, and still something to tear down. Called by the channel, in any thread."""
        self._lost = True

    def _stoppably(self, function: Callable[[], object]) -> BaseException | None:
        """Call something that SIGTERM may end; gives what it raised, TestStopped if it was ended."""

        def call() -> None:
            try:
                self._stoppable = True  # before the look at _stopped, so that no signal falls between the two
                if self._stopped:
                    raise TestStopped
                function()
            finally:
                self._stoppable = False

        return self._caught(call)

    @staticmethod
    def _caught(function: Callable[[], object]) -> BaseException | None:
        try:
            function()
        except BaseException as error:  # noqa: BLE001 - told by the caller; even sys.exit() must not skip teardown
            return error
        return None


def _text(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - an author's exception may be broken itself
        return f"{type(error).__name__}, whose text cannot be had"


def _named(error: BaseException) -> str:
    text = _text(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def host(job: Job, channel: Channel) -> int:
    """Be the host of one generation of a fixture. Returns the exit status of the process."""
    os.environ["RTF_RUN_FOLDER"] = job.run_folder
    os.environ.update(job.variables)
    keeper = Host(job, channel)
    channel.on_lost = keeper.lost_runner
    signal.signal(signal.SIGTERM, keeper.on_signal)
    signal.signal(signal.SIGINT, keeper.on_signal)
    processes.die_with_parent(signal.SIGTERM)
    keeper.live()
    sys.stdout.flush()
    sys.stderr.flush()
    return 0
