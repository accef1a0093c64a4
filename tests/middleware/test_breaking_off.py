"""Calls that a signal interrupts: the calls after them get their own answers."""

from __future__ import annotations

import signal
import threading
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Bottle
from rtf.middleware.clocks.lockstep import LockstepServer
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.ports.rpc import RpcClient, RpcServer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network


class Interrupted(BaseException):
    """Raised by the signal handler."""


@pytest.fixture
def break_off() -> Iterator[Callable[[], None]]:
    """Return a function that makes the main thread raise Interrupted in its call, and returns when it has."""
    raised = threading.Event()

    def interrupt(*_: object) -> None:
        if not raised.is_set():
            raised.set()
            raise Interrupted

    def interrupt_until_raised() -> None:
        main = threading.main_thread().ident
        assert main is not None
        while not raised.is_set():  # a signal that comes just before the wait in the kernel does not wake it
            signal.pthread_kill(main, signal.SIGUSR1)
            raised.wait(0.02)

    before = signal.signal(signal.SIGUSR1, interrupt)
    yield interrupt_until_raised
    signal.signal(signal.SIGUSR1, before)


def test_an_answer_that_comes_too_late_is_not_taken_for_another(network: Network, break_off: Callable[[], None]):
    """An interrupted request closes its connection, so that its late answer is not taken for the next."""
    interrupted, may_answer = threading.Event(), threading.Event()

    def answer(question: Bottle) -> Bottle:
        if question.get(0) == "late":
            break_off()
            interrupted.set()
            assert may_answer.wait(10)
        return Bottle(["to", *question])

    with RpcServer("/server", answer, network=network), RpcClient("", "/server", network=network) as client:
        with pytest.raises(Interrupted):
            client.call(Bottle(["late"]))
        assert interrupted.wait(10)
        assert not client.outputs
        may_answer.set()
        client.add_output("/server")
        assert client.call(Bottle(["soon"])) == Bottle(["to", "soon"])


def test_a_sleep_that_is_broken_off_is_not_the_end_of_time(network: Network, break_off: Callable[[], None]):
    """After an interrupted sleep a test can sleep again, for instance until the robot is parked."""
    passing = threading.Event()

    def advance(until: float) -> float:
        if until == 1.0:
            break_off()
            assert passing.wait(10)
        return until

    with closing(LockstepServer("/clock", advance, network=network)) as server:
        clock = LockstepClock("/clock", "test", network=network)
        with pytest.raises(Interrupted):
            clock.sleep(1.0)
        passing.set()
        for _ in range(3):
            before = clock.now()
            clock.sleep(0.5)
            assert clock.now() >= before + 0.5
        clock.close()
        assert server.broken is None
