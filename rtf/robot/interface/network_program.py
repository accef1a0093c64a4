"""Programs that use a robot in the network: how they wait for its ports, and how they begin and end."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, LockstepClock
from rtf.middleware.ports import remote
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import DeviceError
from rtf.robot.interface.signals import signal_listener

if TYPE_CHECKING:
    import signal
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network

FINE, FAILED = 0, 1
#: How long programs wait for the robot, by default, and between two looks (s).
PATIENCE, _LOOK = 20.0, 0.1


def say(sentence: str) -> None:
    """Print a line to stderr. A closed stderr is ignored: it must not end the thread that says something."""
    with suppress(OSError, ValueError):
        sys.stderr.write(f"{sentence}\n")
        sys.stderr.flush()


def use_clock(name: str) -> None:
    """Have this process live by a clock, as if it were named in the environment: ``/clock``, or ``lockstep:/clock``."""
    if name:
        os.environ[CLOCK_VARIABLE] = name


def await_ports(names: Sequence[str], network: Network, patience: float, end: threading.Event | None = None) -> None:
    """Wait for ports, as the robot may still be starting. Raises DeviceError with those that are missing.

    It also gives up, in the same way, when ``end`` is set.
    """
    deadline = clock.Deadline.after(patience)
    missing = list(names)
    while missing := [name for name in missing if not remote.exists(network, Contact(name))]:
        if deadline.expired or (end is not None and end.is_set()):
            waited = patience - deadline.remaining()
            raise DeviceError(f"there is no {', '.join(missing)} after {waited:.3g} s; is it running?")
        clock.sleep(_LOOK)


def run_program(
    name: str,
    start: Callable[[ExitStack], Callable[[threading.Event], object] | None],
    end: threading.Event | None = None,
) -> int:
    """Start a program, and run it until a signal, or ``end``; return the exit code. For the main thread.

    ``start`` opens all that is closed at the end, and may return what is run until the event is set.
    """
    over = end or threading.Event()

    def on_signal(number: signal.Signals) -> None:
        say(f"{number.name}: ends")
        over.set()
        clock.current().close()  # in lockstep its time may never pass

    with signal_listener(on_signal), ExitStack() as opened:
        try:
            run = start(opened)
        except (RtfError, OSError) as error:
            if over.is_set():
                return FINE
            say(f"FAILED: {name} could not be started: {error}")
            return FAILED
        time = clock.current()
        if run is None and isinstance(time, LockstepClock):
            time.leave()  # this thread only waits for the end, and time must not wait for it
        say(f"READY {name}")
        try:
            (run or threading.Event.wait)(over)
        except (RtfError, OSError) as error:
            if not over.is_set():
                say(f"FAILED: {name}: {error}")
                return FAILED
    return FINE
