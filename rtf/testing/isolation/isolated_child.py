"""Calls one function in a child process and ends whatever that leaves behind: how plug-ins are looked into.

Two processes are forked. The inner one calls the function. The outer one, the keeper, runs no author's code: as a
subreaper it inherits whatever the inner one starts, and kills it before it reports how the inner one ended. The keeper
also does so when this process closes its end of their socket, which the kernel does when this process dies.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import struct
import sys
from typing import TYPE_CHECKING, Any, NoReturn

from rtf import clock
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from collections.abc import Callable

#: Seconds in which the keeper must have ended what was left, once it was told to.
_GRACE = 5.0
_STATUS = struct.Struct("=i")
_RESULT_FD = 3


def run_isolated(function: Callable[[], dict[str, Any]], limit: float) -> dict[str, Any] | str:
    """Call a function in a child process; return the JSON object it made, or a sentence on why there is none.

    The function is given ``limit`` seconds. Nothing that it started is alive afterwards.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    read_end, write_end = os.pipe()
    here, there = socket.socketpair()
    keeper = os.fork()
    if keeper == 0:
        here.close()
        os.close(read_end)
        _keep(function, there, write_end)
    there.close()
    os.close(write_end)
    try:
        data = _read_until(read_end, clock.Deadline.after(limit))
    finally:
        status = _end(keeper, here)
        os.close(read_end)
        here.close()
    if data is None:
        return f"it did not load within {limit:g} s"
    return _understand(data) or f"its process ended while it was being loaded: {status}"


def _understand(data: bytes) -> dict[str, Any] | str | None:
    try:
        answer = json.loads(data)
    except ValueError:
        return None  # the process ended before it had written all
    if isinstance(answer, dict) and isinstance(answer.get("result"), dict):
        result: dict[str, Any] = answer["result"]
        return result
    return str(answer["raised"]) if isinstance(answer, dict) and "raised" in answer else None


def _read_until(descriptor: int, deadline: clock.Deadline) -> bytes | None:
    data = b""
    while select.select([descriptor], [], [], deadline.remaining())[0]:
        piece = os.read(descriptor, 1 << 16)
        if not piece:
            return data
        data += piece
    return None


def _end(keeper: int, lifeline: socket.socket) -> str:
    """Have the keeper end what is left, and return how the function's process ended."""
    lifeline.shutdown(socket.SHUT_WR)
    processes.signal_process(keeper, signal.SIGCONT)
    reported = b""
    if select.select([lifeline], [], [], _GRACE)[0]:
        reported = lifeline.recv(_STATUS.size)
    if len(reported) < _STATUS.size:
        processes.signal_process(keeper, signal.SIGKILL)
    os.waitpid(keeper, 0)
    if len(reported) < _STATUS.size:
        return "the process that kept it was killed"
    return processes.describe_end(*processes.split_status(*_STATUS.unpack(reported)))


# In the keeper -------------------------------------------------------------------------------------------------------


def _keep(function: Callable[[], dict[str, Any]], lifeline: socket.socket, result: int) -> NoReturn:
    """Fork the process that calls the function, and leave none of its descendants alive."""
    try:
        os.setsid()
        signal.set_wakeup_fd(-1)
        for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(signum, signal.SIG_DFL)
        processes.adopt_orphans()
        processes.no_core_dumps()
        child = os.fork()
        if child == 0:
            _call(function, result)
        os.close(result)
        lifeline.sendall(_STATUS.pack(processes.keep(child, lifeline.fileno())))
    finally:
        os._exit(0)


def _call(function: Callable[[], dict[str, Any]], result: int) -> NoReturn:
    """Call the function and write what it returns. A copy of this process that the function forked writes nothing."""
    own = os.getpid()
    try:
        os.setpgid(0, 0)
        processes.die_with_parent()
        null = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(null, descriptor)
        os.dup2(result, _RESULT_FD, inheritable=False)
        os.closerange(_RESULT_FD + 1, 1 << 20)
        answer = _answer(function)
        if os.getpid() == own:
            view = memoryview(answer)
            while view:
                view = view[os.write(_RESULT_FD, view) :]
    finally:
        os._exit(0)


def _answer(function: Callable[[], dict[str, Any]]) -> bytes:
    try:
        return json.dumps({"result": function()}).encode()
    except BaseException as error:  # noqa: BLE001 - whatever the function raises is the answer
        return json.dumps({"raised": f"{type(error).__name__}: {error}"}).encode()
