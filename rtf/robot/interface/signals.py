"""A listener for termination signals, without a handler that could deadlock on a lock."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def signal_listener(on_signal: Callable[[signal.Signals], object]) -> Iterator[None]:
    """Call ``on_signal`` for each signal, in a thread of its own, while the block runs.

    For the main thread of a program that ends afterwards: the signals stay ignored after the block, so that a late one
    does not disturb the exit. A signal that was ignored before stays ignored. Child processes started meanwhile get the
    default handling.
    """
    reading, writing = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writing, False)

    def listen() -> None:
        while data := os.read(reading, 64):
            for number in data:
                if number in taken:
                    on_signal(signal.Signals(number))

    # The interpreter writes the number of each signal to the pipe, whichever thread receives it.
    former = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    taken = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, _take)
    thread = threading.Thread(target=listen, name="rtf-signals", daemon=True)
    thread.start()
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(former)
        os.close(writing)
        thread.join()
        os.close(reading)


def _take(_number: int, _frame: object) -> None:
    """Do nothing: the listening thread handles the signal."""
