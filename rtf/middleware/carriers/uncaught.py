"""Errors of callbacks in threads that go on."""

from __future__ import annotations

import threading


def report_uncaught(error: BaseException) -> None:
    """Report what a callback raised as Python reports what ends a thread; the calling thread goes on."""
    details = type(error), error, error.__traceback__, threading.current_thread()
    threading.excepthook(threading.ExceptHookArgs(details))
