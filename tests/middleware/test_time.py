"""Clocks over the network: lockstep, and published time."""

from __future__ import annotations

import itertools
import threading
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.middleware.clocks.lockstep import LockstepServer
from rtf.middleware.clocks.network_clock import LockstepClock, NetworkClock
from rtf.middleware.errors import ConnectError, MiddlewareError, PortClosedError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network


class World:
    """A simulation in lockstep, which writes a message each millisecond."""

    def __init__(self, network: Network) -> None:
        self.server = LockstepServer("/clock/rpc", self.advance, network=network, patience=0.05)
        self.output = Port("/world:o", network=network, inputs=False)
        self.steps = 0

    def advance(self, until: float) -> float:
        """Make a step, and write its message, for each millisecond."""
        while (self.steps + 1) * 0.001 <= until + 1e-9:
            self.steps += 1
            self.output.write(Bottle([self.steps]), envelope=f"{self.steps} {self.steps * 0.001!r}")
        return until

    def close(self) -> None:
        """Close its ports."""
        self.server.close()
        self.output.close()


@pytest.fixture
def world(network: Network) -> Iterator[World]:
    """A world in lockstep."""
    made = World(network)
    yield made
    made.close()


class TestLockstep:
    """Time that advances only while every participant waits."""

    def test_sleep_takes_no_time_of_the_machine(self, world: World, network: Network):
        """A sleep of a simulated minute ends as soon as its steps are done."""
        began = clock.monotonic()
        with clock.use(LockstepClock("/clock/rpc", "tester", network=network)):
            clock.current().sleep(60.0)
            assert clock.current().now() == pytest.approx(60.0)
        assert world.steps == 60_000
        assert clock.monotonic() - began < 30.0

    def test_what_was_sent_before_the_end_of_a_sleep_is_there(self, world: World, network: Network):
        """After a sleep exactly the messages of its time have arrived."""
        with BufferedPort("/reader", strict=True, network=network) as reader:
            world.output.add_output("/reader")
            with clock.use(LockstepClock("/clock/rpc", "tester", network=network)) as time:
                for count in range(1, 20):
                    time.sleep(0.005)
                    assert [reader.poll()[0] for _ in range(5)] == [*range(5 * count - 4, 5 * count + 1)]  # type: ignore[index]
                    assert reader.poll() is None

    def test_the_slowest_participant_decides(self, world: World, network: Network):
        """Threads that sleep in steps of their own each wake at their own moments."""
        seen: dict[float, list[float]] = {}

        def live(step: float, time: LockstepClock) -> None:
            seen[step] = []
            for _ in range(20):
                time.sleep(step)
                seen[step].append(time.now())
            time.leave()

        time = LockstepClock("/clock/rpc", "tester", network=network)
        threads = [threading.Thread(target=live, args=(step, time)) for step in (0.003, 0.005)]
        for thread in threads:
            thread.start()
        eventually(lambda: len(seen) == 2, "a thread has not begun")
        time.leave()
        for thread in threads:
            thread.join(10)
        time.close()
        for step, moments in seen.items():
            start = moments[0] - step
            assert moments == pytest.approx([start + step * count for count in range(1, 21)])

    def test_time_passes_in_one_thread_at_a_time(self, network: Network):
        """Steps and resets are never executed at the same time, and steps are in order."""
        steps: list[float] = []
        busy = threading.Lock()

        def advance(until: float) -> float:
            assert busy.acquire(blocking=False), "time passes twice"
            steps.append(until)
            busy.release()
            return until

        def reset() -> None:
            assert busy.acquire(blocking=False), "it is reset while time passes"
            busy.release()

        def live(step: float) -> None:
            for _ in range(60):
                time.sleep(step)
            time.leave()

        server = LockstepServer("/clock/rpc", advance, network=network, reset=reset)
        with closing(server), RpcClient("/director", "/clock/rpc", network=network) as director:
            time = LockstepClock("/clock/rpc", "tester", network=network)
            threads = [threading.Thread(target=live, args=(step,)) for step in (0.003, 0.005, 0.007)]
            for thread in threads:
                thread.start()
            time.leave()
            for word in 10 * ("pause", "reset", "continue", "now"):
                assert director.call(Bottle([word])) is not None
            for thread in threads:
                thread.join(20.0)
            assert not any(thread.is_alive() for thread in threads)
            assert server.broken is None
        assert steps == sorted(set(steps))
        assert steps[-1] >= 60 * 0.007

    def test_it_is_closed_when_time_passes_no_more(self, network: Network):
        """``close`` waits for the running step, so that the simulation can be freed afterwards."""
        begun, may_go, ended = threading.Event(), threading.Event(), threading.Event()

        def advance(until: float) -> float:
            begun.set()
            assert may_go.wait(20.0)
            ended.set()
            return until

        server = LockstepServer("/clock/rpc", advance, network=network)
        time = LockstepClock("/clock/rpc", "tester", network=network)
        seen: list[str] = []

        def sleep() -> None:
            with pytest.raises(MiddlewareError):
                time.sleep(1.0)
            seen.append("refused")

        def close() -> None:
            server.close()
            assert ended.is_set()
            seen.append("closed")

        sleeper, closer = threading.Thread(target=sleep), threading.Thread(target=close)
        sleeper.start()
        time.leave()
        assert begun.wait(20.0)
        closer.start()
        eventually(lambda: server._closed, "it is not closed")
        may_go.set()
        closer.join(20.0)
        sleeper.join(20.0)
        time.close()
        assert sorted(seen) == ["closed", "refused"]

    @pytest.mark.parametrize("then", ["leave", "sleep"])
    def test_the_clock_is_closed_by_another_thread(self, world: World, network: Network, then: str):
        """A thread that takes part can still leave, and its next sleep is an error of the middleware."""
        time = LockstepClock("/clock/rpc", "tester", network=network)
        closer = threading.Thread(target=time.close)
        closer.start()
        closer.join(10)
        if then == "leave":
            time.leave()
        with pytest.raises(PortClosedError, match="the clock /clock/rpc is closed"):
            time.sleep(0.01)
        eventually(lambda: not world.server.participants, "a participant is left")

    def test_who_joins_while_the_clock_is_closed_is_refused(
        self, world: World, network: Network, monkeypatch: pytest.MonkeyPatch
    ):
        """A thread whose request to take part is answered after the clock was closed takes part no more."""
        time = LockstepClock("/clock/rpc", "tester", network=network)
        time.leave()
        join = world.server.join
        monkeypatch.setattr(world.server, "join", lambda *who: (time.close(), join(*who))[1])
        with pytest.raises(PortClosedError, match="the clock /clock/rpc is closed"):
            time.sleep(0.01)
        eventually(lambda: not world.server.participants, "a participant is left")

    def test_continue_ends_a_step(self, network: Network):
        """A step that waits when time may continue is not made up for in the next pause."""
        told: list[float] = []
        busy, may_go = threading.Event(), threading.Event()

        def advance(until: float) -> float:
            told.append(until)
            busy.set()
            assert may_go.wait(10)
            return until

        server = LockstepServer("/clock/rpc", advance, network=network, reset=lambda: None)
        with (
            closing(server),
            RpcClient("/director", "/clock/rpc", network=network) as director,
            RpcClient("/stepper", "/clock/rpc", network=network) as stepper,
        ):
            sleeper = threading.Thread(target=server.wait_until, args=(server.join("sleeper"), 1.0))
            sleeper.start()
            assert busy.wait(10)
            director.call(Bottle(["pause"]))
            step = threading.Thread(target=stepper.call, args=(Bottle(["step", 100.0]),))
            step.start()
            eventually(lambda: server._step_until == 100.0, "no step is due")
            director.call(Bottle(["continue"]))
            step.join(10)
            may_go.set()
            sleeper.join(10)
            director.call(Bottle(["pause"]))
            director.call(Bottle(["reset"]))  # its thread would go on with a step that is due
        assert told == [1.0]

    def test_participant_that_vanishes_is_dropped(self, world: World, network: Network):
        """A participant whose connection ends does not delay others any more."""
        lost = RpcClient("/lost", "/clock/rpc", network=network)
        lost.call(Bottle(["join", "lost"]))
        with clock.use(LockstepClock("/clock/rpc", "tester", network=network)) as time:
            done = threading.Event()
            thread = threading.Thread(target=lambda: (time.sleep(0.01), done.set()))
            thread.start()
            assert not done.wait(0.02)
            lost.close()
            time.leave()  # type: ignore[attr-defined]
            assert done.wait(10)
            thread.join()

    def test_participant_that_never_waits_is_named(self, world: World, network: Network, said: list[str]):
        """A participant that delays others is reported by name."""
        idle = RpcClient("/idle", "/clock/rpc", network=network)
        idle.call(Bottle(["join", "the idle one"]))
        time = LockstepClock("/clock/rpc", "tester", network=network)
        thread = threading.Thread(target=time.sleep, args=(0.01,))
        thread.start()
        time.leave()
        eventually(lambda: any("the idle one does not wait" in line for line in said), "nobody was named")
        idle.close()
        thread.join(10)
        time.close()

    def test_nonsense_is_refused(self, world: World, network: Network):
        """Every invalid request gets a reply."""
        with RpcClient("/client", "/clock/rpc", network=network) as client:
            for question in ("", "until 99 1.0", "dance", "leave 7", "join"):
                reply = client.call(Bottle.parse(question), timeout=5)
                assert reply is not None

    @pytest.mark.parametrize(
        ("reply", "reason"),
        [
            (Bottle(), "there was no reply; has its simulator ended?"),
            (Bottle([Vocab("fail"), "join first"]), "join first"),
            (Bottle([Vocab("fail")]), "[fail] is not the reply of a clock"),
        ],
    )
    def test_a_refusal_has_a_reason(self, network: Network, reply: Bottle, reason: str):
        """The error of a refused sleep has the reply's reason, or names the missing reply."""

        def answer(question: Bottle) -> Bottle:
            return Bottle([Vocab("ok"), 1, 0.0]) if question.get(0) == "join" else reply

        with RpcServer("/clock/rpc", answer, network=network):
            time = LockstepClock("/clock/rpc", "tester", network=network)
            with pytest.raises(ConnectError) as caught:
                time.sleep(1.0)
            time.close()
        assert str(caught.value) == f"the clock refused 'until': {reason}"


class TestNetworkClock:
    """The clock of published time."""

    def test_sleep_follows_the_publisher(self, network: Network):
        """Each sleep ends when the published time has come, independent of the machine's clock."""
        slept: list[tuple[float, float, float]] = []
        with Port("/clock", network=network, inputs=False, outputs=True) as publisher:
            time = NetworkClock("/clock", network=network)
            publisher.write(Bottle([100, 0]))
            assert time.now() == 100.0

            def sleep_often(seconds: float) -> None:
                for _ in range(10):
                    begin = time.now()
                    time.sleep(seconds)
                    slept.append((seconds, begin, time.now()))

            threads = [threading.Thread(target=sleep_often, args=(seconds,)) for seconds in (0.3, 0.7, 1.1)]
            for thread in threads:
                thread.start()
            ticks = itertools.count(1000)

            def done() -> bool:
                seconds, tenths = divmod(next(ticks), 10)
                publisher.write(Bottle([seconds, tenths * 100_000_000]))
                return not any(thread.is_alive() for thread in threads)

            eventually(done, "somebody sleeps on")
            time.close()
        assert len(slept) == 30
        assert all(end - begin >= seconds - 1e-9 for seconds, begin, end in slept)

    def test_who_sleeps_when_the_time_jumps_back_sleeps_as_long(self, network: Network):
        """If the published time restarts at zero, a sleep lasts its full time from there."""
        woken: list[float] = []
        with Port("/clock", network=network, inputs=False, outputs=True) as publisher:
            time = NetworkClock("/clock", network=network)
            publisher.write(Bottle([100, 0]))
            assert time.now() == 100.0
            thread = threading.Thread(target=lambda: (time.sleep(5.0), woken.append(time.now())))
            thread.start()
            ticks = itertools.count()
            eventually(lambda: publisher.write(Bottle([next(ticks), 0])) and woken, "the sleeper sleeps on")
            thread.join()
            time.close()
        assert woken[0] >= 5.0

    def test_close_wakes_all_waiting_threads(self, network: Network):
        """Closing the clock ends the wait for the first message."""
        time = NetworkClock("/clock", network=network)

        def ask() -> None:
            with pytest.raises(PortClosedError):
                time.now()

        thread = threading.Thread(target=ask)
        thread.start()
        time.close()
        thread.join(5)
        assert not thread.is_alive()


def test_system_clock_is_the_default():
    """Without another clock in use the current one is that of the system."""
    assert isinstance(clock.current(), clock.SystemClock)
    assert clock.current().now() == pytest.approx(clock.now(), abs=1.0)
