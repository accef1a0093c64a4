"""The process in which one generation of a fixture lives; ``fixture_process`` is the other end of its channel.

SIGTERM makes it leave its current step and tear down. When its runner is gone it waits for the SIGTERM of the fork
server, which ends fixtures in order; when the fork server is gone the kernel sends it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from typing import TYPE_CHECKING, TypeVar

import msgspec

from rtf import clock
from rtf.testing.fixture import FixtureManager, FixtureUnusable
from rtf.testing.isolation import processes
from rtf.testing.isolation.messages import SAFE_STATE_NAME, Alive, Command, Doing, Ready
from rtf.testing.plugin_makers import fixture_maker
from rtf.testing.session import author_traceback, named_text_of, text_of
from rtf.testing.supervision.fixture_session import FixtureSession
from rtf.testing.verdict import FixtureCollapsed, Phase, Severity, TestStopped

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType
    from typing import NoReturn

    from rtf.testing.isolation.messages import FailedTest, Job
    from rtf.testing.isolation.worker import Channel

T = TypeVar("T")

#: Seconds to wait for the order in which the fork server has fixtures torn down when the runner is gone: those that
#: depend on this one enter their safe states first. A fork server that is gone as well makes itself felt at once.
ORPHAN_PATIENCE = 600.0


class Host(FixtureSession):
    """Runs one fixture manager, in the main thread."""

    def __init__(self, job: Job, channel: Channel) -> None:
        super().__init__(job, channel.send)
        self._channel = channel
        self._runner_gone = False

    def live(self) -> None:
        """Load, set up, watch and tear down."""
        self.emit(Doing("setup()"))
        manager = self._load()
        if manager is not None and not self.stopped:
            up = self._set_up(manager)
            if up:
                self._watch(manager)
            self._come_down(manager, up=up)
        self.emit(Doing("nothing"))

    def _load(self) -> FixtureManager | None:
        def load() -> FixtureManager:
            job = self._job
            manager = fixture_maker(job.plugin)()
            manager.attach_to(self, job.use.environment)
            manager.take_fixture_values(job.values)
            manager.resolve_parameters(**msgspec.structs.asdict(job.use))
            for warning in manager.parameter_warnings:
                self.message(Severity.WARNING, "parameters", warning)
            return manager

        return self._attempt(load, lambda error: self._raised(error, hopeless=True))

    def _set_up(self, manager: FixtureManager) -> bool:
        """Set the fixture up and report that it is ready. Returns False if it is not."""

        def set_up() -> Ready:
            if self.generation > 1:
                manager.before_restart(self.generation)
            if manager.setup() is False:
                raise FixtureCollapsed("setup() returned False")
            missing = [key for key in manager.provides if key not in self._provided]
            if missing:
                raise FixtureUnusable(f"setup() of fixture {self.name!r} did not provide {', '.join(missing)}")
            has_safe_state = type(manager).enter_safe_state is not FixtureManager.enter_safe_state
            explains = type(manager).on_test_failure is not FixtureManager.on_test_failure
            return Ready(bool(manager.occupies) and has_safe_state, float(manager.stop_limit), explains)

        self.phase = Phase.SETUP
        ready = self._attempt(set_up, lambda error: self._raised(error, hopeless=isinstance(error, FixtureUnusable)))
        if ready is None or self._cause:
            return False
        self.phase = Phase.CHECK  # first, because a test may break it as soon as it is ready
        self.emit(ready)
        return True

    def _raised(self, error: BaseException, what: str = "", *, hopeless: bool = False) -> None:
        """Report that the fixture is not usable because of an error, which ``what`` raised unless that is plain."""
        if isinstance(error, FixtureCollapsed):
            self.collapse(text_of(error), hopeless=hopeless)
        else:
            self.collapse(f"{what}{named_text_of(error)}", traceback=author_traceback(error), hopeless=hopeless)

    def _watch(self, manager: FixtureManager) -> None:
        """Check regularly, and obey commands, until the fixture has to come down."""
        while not (self.stopped or self._runner_gone):
            command = self._next_command()
            kind = "check" if command is None else command.command
            if kind == "teardown":
                return
            if kind == "enter_safe_state":  # one whose state after a test is unknown is as good as gone
                self._attempt(manager.enter_safe_state, lambda error: self._raised(error, "enter_safe_state() raised "))
            elif command is not None and command.failed is not None:
                self._explain(manager, command.failed)
            elif not (self.stopped or self._runner_gone or self._cause):
                self._check(manager)
            if not (self.stopped or self._cause):
                self.emit(Alive(answered=command is not None))
        if not self.stopped:
            # without a runner, the fork server says whose turn it is; however the wait ends, the safe state follows
            self._attempt(lambda: clock.sleep(ORPHAN_PATIENCE), lambda _: None)

    def _next_command(self) -> Command | None:
        """Wait for a command until the next check is due; None without one."""
        # an error: the author's code has closed the channel
        return self._attempt(lambda: self._receive(self._job.check_period), lambda _: self.lost_runner())

    def _receive(self, timeout: float) -> Command | None:
        """Wait for a command. If the runner found that the fixture collapsed, keep the reason."""
        command = self._channel.receive(timeout)
        if not isinstance(command, Command):
            return None
        if command.command == "teardown":
            self._cause = self._cause or command.detail
        return command

    def _check(self, manager: FixtureManager) -> None:
        def check() -> None:
            if manager.check() is False:
                raise FixtureCollapsed("check() returned False")

        self._attempt(check, lambda error: self._raised(error, "check() raised "))

    def _explain(self, manager: FixtureManager, failed: FailedTest) -> None:
        """Have the fixture add to what is known of a test; an error of its own is a message, and no collapse."""

        def complain(error: BaseException) -> None:
            self.message(Severity.ERROR, "on_test_failure", f"on_test_failure() raised {named_text_of(error)}")

        self._failed = failed
        try:
            self._attempt(lambda: manager.on_test_failure(failed), complain)
        finally:
            self._failed = None

    # The end -----------------------------------------------------------------------------------------------------

    def _come_down(self, manager: FixtureManager, *, up: bool) -> None:
        self.phase = Phase.TEARDOWN
        with contextlib.suppress(OSError):  # the author's code has closed the channel
            while self._receive(0) is not None:  # a runner that interrupts says before why
                pass
        cause = self._cause
        if up and cause:
            self._last_step("on_collapse()", lambda: manager.on_collapse(cause))
        elif up:
            with processes.named(SAFE_STATE_NAME):
                self._last_step("enter_safe_state()", manager.enter_safe_state)
        self._last_step("teardown()", manager.teardown, stoppable=False)

    def _last_step(self, step: str, function: Callable[[], object], *, stoppable: bool = True) -> None:
        """Take a step of the way down: what goes wrong is reported, and a stop that came before has no effect."""
        self.emit(Doing(step))
        try:
            if stoppable:
                self.run_stoppable(function)
            else:
                function()
        except TestStopped:
            self.emit(self._incident(f"{step} did not come back and was interrupted"))
        except BaseException as error:  # noqa: BLE001 - reported; even sys.exit() must not skip what follows
            self.emit(self._incident(f"{step} raised {named_text_of(error)}", traceback=author_traceback(error)))

    # Being stopped from outside ----------------------------------------------------------------------------------

    def _attempt(self, function: Callable[[], T], failed: Callable[[BaseException], object]) -> T | None:
        """Return the result of a function that SIGTERM may end. On an error call ``failed`` and return None."""
        try:
            return self.run_stoppable(function)
        except TestStopped:
            pass
        except BaseException as error:  # noqa: BLE001 - even sys.exit() must not skip teardown
            failed(error)
        return None

    def on_signal(self, _signum: int, _frame: FrameType | None) -> None:
        """Leave the current step, to tear down. Teardown itself is never left."""
        self.stop("stopped by the runner")

    def _raise_stop(self) -> NoReturn:
        self._stoppable = False  # a second signal must not end what the first has the author's code undo
        super()._raise_stop()

    def lost_runner(self) -> None:
        """Record that the runner is gone; the fixture still has to come down. Called by the channel in any thread."""
        self._runner_gone = True


def host(job: Job, channel: Channel) -> int:
    """Run one generation of a fixture. Returns the exit status of the process."""
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
