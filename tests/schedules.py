"""Every schedule of a small program of threads, tried one after the other, up to a number of preemptions.

The modules under test get a :class:`Control` for their ``threading``. Its threads are real ones, but only one of them
runs at a time, and whenever it takes a lock, waits, starts a thread or touches a :class:`Shared` attribute the control
says who goes on. A program is run again and again, each time with the next sequence of such choices, until none is
left: what depends on the order of threads is then known for all orders, not for those that luck brings. That few
preemptions find nearly all such faults is the experience of Musuvathi and Qadeer's CHESS (PLDI 2007). A thread is
preempted only before it uses what another one uses as well and one of them changes. Which things these are is learned:
first with one preemption anywhere, then by the way, and all is run again until nothing new was learned.

Left out: orders of what lies between two of those points, and whatever goes through sockets. Time stands still; it
goes on to the next deadline when the control lets a wait run out.
"""

from __future__ import annotations

import threading
from collections import Counter
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from unittest import mock

from controlled import Condition, Event, Lock, RLock, Shared
from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    Ready = Callable[[], bool]
    #: A thing that threads use, the same under each schedule: who made it, and how many it had made before.
    Key = tuple[str, int]

#: Steps of one schedule; a program that takes more goes round in circles.
_MOST_STEPS = 5_000
#: Real seconds after which a schedule hangs somewhere that is not controlled.
_PATIENCE = 30.0


class ScheduleError(AssertionError):
    """The program fails under a schedule, which the message describes."""


class _Abandoned(BaseException):
    """Unwinds the threads of a schedule that has failed."""


def explore(
    program: Callable[[Control], None],
    *modules: ModuleType,
    preemptions: int = 2,
    shared: dict[type, tuple[str, ...]] | None = None,
) -> int:
    """Run a program under every schedule with so many preemptions; returns how many there were.

    It is called in a controlled thread and makes others, with the control or with the modules, whose ``threading`` is
    the control meanwhile. ``shared`` names attributes of classes that are used without a lock. Raises ScheduleError
    when anything is raised in a thread, when nobody can go on, or when a thread is left at the end.
    """
    control = Control(preemptions)
    schedules = 0
    with _under(control, modules, shared or {}):
        while True:
            schedules += 1
            control.run(program)
            if not control.turn_to_next() and not control.learned():
                return schedules


@contextmanager
def _under(control: Control, modules: tuple[ModuleType, ...], shared: dict[type, tuple[str, ...]]) -> Iterator[None]:
    patches = [mock.patch.object(module, "threading", control) for module in modules]
    patches += [
        mock.patch.object(kind, name, Shared(control, name), create=True) for kind in shared for name in shared[kind]
    ]
    patches.append(mock.patch.object(clock, "monotonic", control.monotonic))
    for patch in patches:
        patch.start()
    try:
        yield
    finally:
        for patch in reversed(patches):
            patch.stop()


class Choice:
    """One of several ways to go on, by number."""

    __slots__ = ("number", "of")

    def __init__(self, of: int) -> None:
        self.number = 0
        self.of = of


class Control:
    """Stands in for ``threading``, and says whose turn it is."""

    def __init__(self, preemptions: int) -> None:
        self._preemptions = preemptions
        self._choices: list[Choice] = []
        self._met: dict[Key, set[str]] | None = None  # who uses the things that threads meet at, once that is known
        self._users: dict[Key, set[str]] = {}
        self._changed: set[Key] = set()
        self._begin()

    def _begin(self) -> None:
        self._made = 0  # how many of the choices
        self._left = min(1, self._preemptions) if self._met is None else self._preemptions
        self._now = 1000.0
        self._threads: list[ControlledThread] = []
        self._running: ControlledThread | None = None
        self._atomic = 0
        self._made_by: Counter[str] = Counter()
        self._steps: list[str] = []
        self._done = threading.Event()
        self.failure: str = ""
        self.cause: BaseException | None = None

    def run(self, program: Callable[[Control], None]) -> None:
        """Run it under the schedule that is the next. Raises ScheduleError."""
        self._begin()
        first = self.Thread(target=program, args=(self,), name="main")
        first.begun = True
        self._running = first
        first.let_go()
        if not self._done.wait(_PATIENCE):
            self.failure = f"it hangs where nobody controls it, in {self._running}"
        for thread in self._threads:
            thread.end(abandon=bool(self.failure))
        if self.failure:
            raise ScheduleError(f"{self.failure}\n{self.text()}") from self.cause

    def turn_to_next(self) -> bool:
        """Make the next schedule the one that is run; False when there is none."""
        while self._choices and self._choices[-1].number + 1 == self._choices[-1].of:
            self._choices.pop()
        if self._choices:
            self._choices[-1].number += 1
        return bool(self._choices)

    def learned(self) -> bool:
        """Whether threads met at things that they were not known to meet at."""
        met = {key: {*self._users[key]} for key in self._changed if len(self._users[key]) > 1}
        new = met != self._met
        self._met = met
        return new

    def new_key(self) -> Key:
        """A key for a thing that the running thread makes."""
        maker = "" if self._running is None else self._running.name
        self._made_by[maker] += 1
        return maker, self._made_by[maker]

    def text(self) -> str:
        """The schedule: what each thread was about to do at each choice."""
        return "\n".join(self._steps[-80:])

    def monotonic(self) -> float:
        """The time; see :func:`rtf.clock.monotonic`."""
        return self._now

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Nobody else goes on within the block unless this thread must wait: for making parts and ending them."""
        self._atomic += 1
        try:
            yield
        finally:
            self._atomic -= 1

    # What takes turns --------------------------------------------------------------------------------------------

    def pause(
        self,
        what: str,
        ready: Ready = lambda: True,
        timeout: float | None = None,
        *,
        uses: Key | None = None,
        changes: bool = True,
    ) -> bool:
        """Let others go on; returns when it is this thread's turn and it is ready, False when its time ran out.

        ``uses`` is what it does something with then, and ``changes`` says that this makes a difference to others.
        """
        me = self._running
        if self.failure:
            raise _Abandoned
        assert me is not None
        if not me.is_this:
            raise RuntimeError(f"a thread that is not controlled wants to {what}")
        me.wants(what, ready, None if timeout is None else self._now + timeout)
        if uses is not None and not self._atomic:
            self._users.setdefault(uses, set()).add(me.name)
            if changes:
                self._changed.add(uses)
        self._pass_on(me, uses)
        return not me.ran_out

    def ended(self, error: BaseException | None) -> None:
        """The thread that is running has come to its end."""
        me = self._running
        assert me is not None
        if error is not None and not self.failure:
            self.failure, self.cause = f"{me} raised {error!r}", error
        if self.failure:
            self._done.set()
        else:
            self._pass_on(me)

    def _pass_on(self, me: ControlledThread, uses: Key | None = None) -> None:
        options = self._options(me, uses)
        if not options:
            self._stop(me)
            return
        chosen = options[self._choose(len(options))]
        if chosen.can_go_on:
            self._left -= chosen is not me and me.can_go_on
        else:
            self._left -= any(one.can_go_on for one in self._threads)
            chosen.ran_out = True
            self._now = max(self._now, chosen.deadline or 0.0)
        self._steps.append(f"{chosen}{' waits no longer to ' if chosen.ran_out else ': '}{chosen.what}")
        if len(self._steps) > _MOST_STEPS:
            self.failure = "it goes round in circles"
            self._stop(me)
            return
        self._running = chosen
        if chosen is not me:
            chosen.let_go()
            me.sleep_until_let_go()

    def _options(self, me: ControlledThread, uses: Key | None) -> list[ControlledThread]:
        """Who may go on: this thread first; the others as far as that is no preemption, or one is left for them.

        One that comes in between is a user of the same thing, or may help a user who cannot go on.
        """
        if me.can_go_on and (self._atomic or not self._left or self._alone_with(uses)):
            return [me]
        able = [one for one in self._threads if one.can_go_on]
        waiting = [one for one in self._threads if one.alive and not one.can_go_on and one.deadline is not None]
        first = min(waiting, key=lambda one: one.deadline or 0.0, default=None)
        late = [] if first is None else [first]
        if not able:
            return late
        extra = late if self._left and not self._atomic else []
        if not me.can_go_on:
            return able + extra
        if uses and self._met:
            users = self._met[uses]
            if all(one.can_go_on for one in self._threads if one.alive and one.name in users):
                able = [one for one in able if one.name in users]
        return [me, *(one for one in able if one is not me), *extra]

    def _alone_with(self, uses: Key | None) -> bool:
        return uses is not None and self._met is not None and uses not in self._met

    def _choose(self, of: int) -> int:
        if of == 1:
            return 0
        if self._made == len(self._choices):
            self._choices.append(Choice(of))
        choice = self._choices[self._made]
        if choice.of != of:
            raise RuntimeError("the program does not do the same when it is run under the same schedule again")
        self._made += 1
        return choice.number

    def _stop(self, me: ControlledThread) -> None:
        """Raise the error of a deadlock, or end the schedule, as no thread can go on."""
        stuck = [one for one in self._threads if one.alive]
        if stuck and not self.failure:
            self.failure = "nobody can go on: " + ", ".join(f"{one} wants to {one.what}" for one in stuck)
        self._done.set()
        if me.alive:
            me.sleep_until_let_go()

    # What modules ask of threading ---------------------------------------------------------------------------------

    def Lock(self) -> Lock:  # noqa: N802 - as threading calls it
        """See threading."""
        return Lock(self)

    def RLock(self) -> RLock:  # noqa: N802
        """See threading."""
        return RLock(self)

    def Condition(self, lock: Lock | None = None) -> Condition:  # noqa: N802
        """See threading."""
        return Condition(self, lock or RLock(self))

    def Event(self) -> Event:  # noqa: N802
        """See threading."""
        return Event(self)

    def Thread(self, *, target: Callable[..., object], args: tuple[Any, ...] = (), name: str = "", daemon: bool = True):  # noqa: N802
        """See threading."""
        name = name or "thread"
        namesakes = sum(one.name.partition("#")[0] == name for one in self._threads)
        thread = ControlledThread(self, target, args, f"{name}#{namesakes + 1}" if namesakes else name)
        self._threads.append(thread)
        return thread

    def current_thread(self) -> ControlledThread | threading.Thread:
        """See threading."""
        me = self._running
        return me if me is not None and me.is_this else threading.current_thread()

    def enumerate(self) -> list[ControlledThread]:
        """See threading."""
        return [one for one in self._threads if one.alive]

    def get_native_id(self) -> int:
        """See threading."""
        return threading.get_native_id()


class ControlledThread:
    """A real thread that runs only in its turn."""

    def __init__(self, control: Control, target: Callable[..., object], args: tuple[Any, ...], name: str) -> None:
        self.name = name
        self.begun = False
        self.finished = False
        self._key = control.new_key()
        self.wants("begin", lambda: True, None)
        self._control = control
        self._work = (target, args)
        self._turn = threading.Lock()  # free when it is this thread's turn
        self._turn.acquire()
        self._real = threading.Thread(target=self._run, name=name, daemon=True)
        self._real.start()

    def __str__(self) -> str:
        return self.name

    @property
    def is_this(self) -> bool:
        """Whether this is the thread."""
        return threading.current_thread() is self._real

    @property
    def alive(self) -> bool:
        """Whether it has begun and has not come to its end."""
        return self.begun and not self.finished

    @property
    def can_go_on(self) -> bool:
        """Whether it is alive and what it waits for is there."""
        return self.alive and self._ready()

    def wants(self, what: str, ready: Ready, deadline: float | None) -> None:
        """Say what it does next, and what it waits for."""
        self.what, self._ready, self.deadline, self.ran_out = what, ready, deadline, False

    def let_go(self) -> None:
        """Let it go on."""
        self._turn.release()

    def sleep_until_let_go(self) -> None:
        """In this thread: wait for its turn, for good when it has come to its end."""
        if self.finished:
            return
        self._turn.acquire()
        if self._control.failure:
            raise _Abandoned

    def end(self, *, abandon: bool) -> None:
        """Wait for the real thread."""
        if (abandon or not self.begun) and self._turn.locked():
            self._turn.release()
        self._real.join(_PATIENCE)

    # What modules ask of a thread

    def start(self) -> None:
        """See threading."""
        self.begun = True
        self._control.pause(f"start {self}", uses=self._key)

    def join(self, timeout: float | None = None) -> None:
        """See threading."""
        self._control.pause(f"join {self}", lambda: not self.alive, timeout, uses=self._key, changes=False)

    def is_alive(self) -> bool:
        """See threading."""
        return self.alive

    def _run(self) -> None:
        target, args = self._work
        self._turn.acquire()
        if not self.begun or self._control.failure:
            return
        error: BaseException | None = None
        try:
            target(*args)
        except _Abandoned:
            return
        except BaseException as raised:  # noqa: BLE001 - whatever it is, it is reported
            error = raised
        self.finished = True
        self._control.ended(error)


def start(control: Control, *jobs: Callable[[], object]) -> list[ControlledThread]:
    """A thread for each job, named after it."""
    threads = [control.Thread(target=job, name=job.__name__) for job in jobs]
    with control.undisturbed():
        for thread in threads:
            thread.start()
    return threads


def together(control: Control, *jobs: Callable[[], object]) -> None:
    """Run jobs at the same time to their end; the last of them in this thread."""
    threads = start(control, *jobs[:-1])
    jobs[-1]()
    for thread in threads:
        thread.join()
