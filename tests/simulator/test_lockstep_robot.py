"""The simulated robot in lockstep on the network: messages before the end of a sleep, participants, all limits."""

from __future__ import annotations

import subprocess
import sys
import threading
from contextlib import ExitStack, closing
from importlib.util import find_spec
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from icub import ICUB, PARTS
from rtf import clock
from rtf.bottle import Bottle, Property, Vocab, as_float
from rtf.middleware.clocks.network_clock import LockstepClock, NetworkClock
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.remote import connect
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.simulator.contacts import touching
from rtf.simulator.robot import SimulatedRobot
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture
def network(tmp_path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Network]:
    """A network of this process; afterwards no thread and no descriptor of it is left."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    threads = set(threading.enumerate())
    descriptors = open_descriptors()
    yield Network(LocalNames(), report=lambda _sentence: None)
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")


@pytest.fixture
def robot(network: Network) -> Iterator[SimulatedRobot]:
    """A robot of two parts."""
    with SimulatedRobot(ICUB, network=network, parts=("left_arm", "head"), lockstep=True) as robot:
        yield robot


@pytest.fixture
def time(network: Network, robot: SimulatedRobot) -> Iterator[clock.Clock]:
    """The robot's clock, of which this process is a participant."""
    with clock.use(LockstepClock("/clock", "test", network=network)) as time:
        yield time


def client_of(network: Network, part: str) -> RemoteControlBoard:
    """A client that receives every message."""
    client = RemoteControlBoard(part, network=network)
    client.open(Property({"remote": f"/icubSim/{part}", "local": f"/test/{part}", "carrier": "tcp"}))
    return client


def ear(network: Network, source: str) -> BufferedPort[Bottle]:
    """A port that keeps all received messages."""
    port = BufferedPort(f"/ear{source}", strict=True, network=network, outputs=False)
    connect(network, Contact.parse(source), Contact.parse(port.name))
    return port


def stamps(port: BufferedPort[Bottle]) -> list[float]:
    """The times of all envelopes so far."""
    return [as_float(Bottle.parse(port.receive(1.0).envelope).get(1)) for _ in range(port.pending)]


class TestMessages:
    """What has arrived when a sleep ends."""

    def test_every_state_of_two_seconds_is_there_with_its_stamp(self, network: Network, time: clock.Clock):
        """A hundred a second, none missing, each at its moment, and none comes after the sleep that it belongs to."""
        with closing(ear(network, "/icubSim/head/state:o")) as port:
            time.sleep(0.005)
            stamps(port)
            heard = []
            for index in range(200):
                time.sleep(0.01)
                heard += stamps(port)
                assert len(heard) == index + 1
        assert heard == [(index + 1) / 100 for index in range(200)]

    def test_all_that_happened_in_a_long_sleep_is_there_at_its_end(self, network: Network, time: clock.Clock):
        """States, sensors and the time itself, in the order in which they were sent."""
        sources = ("/icubSim/head/stateExt:o", "/icubSim/left_arm/analog:o", "/icubSim/inertial/measures:o")
        with ExitStack() as opened:
            ears = [opened.enter_context(closing(ear(network, source))) for source in sources]
            time.sleep(0.001)
            for one in ears:
                stamps(one)
            time.sleep(1.0)
            for one in ears:
                assert stamps(one) == [(index + 1) / 100 for index in range(100)], one.name

    def test_a_state_read_after_a_sleep_is_that_of_its_end(
        self, network: Network, robot: SimulatedRobot, time: clock.Clock
    ):
        """A client of the board reads the position at the end of the sleep."""
        board = robot.parts["left_arm"]
        with client_of(network, "left_arm") as arm:
            time.sleep(0.02)
            arm.set_reference_speeds(20.0, 3)
            arm.position_move(70.0, 3)
            for _ in range(20):
                time.sleep(0.03)
                assert arm.encoders().tolist() == board.encoders().tolist()
                assert arm.motor_encoders().tolist() == board.motor_encoders().tolist()
                assert arm.encoder_times()[0] == pytest.approx(time.now(), abs=1e-9)
                assert arm.control_modes() == board.control_modes()
            assert arm.encoder(3) > 50.0

    def test_a_command_counts_from_the_moment_it_was_said(self, network: Network, time: clock.Clock):
        """A move that takes a second is done a second after its command, to the millisecond."""
        with client_of(network, "left_arm") as arm:
            time.sleep(0.02)
            arm.set_reference_speeds(30.0, 3)
            arm.position_move(75.0, 3)
            time.sleep(0.998)
            assert not arm.motion_done(3)
            time.sleep(0.004)
            assert arm.motion_done(3)


class TestParticipants:
    """Processes that take part in the time."""

    def test_each_wakes_at_its_own_moments(self, network: Network, robot: SimulatedRobot):
        """The time advances to the earliest wake-up, however the participants sleep."""
        woken: list[tuple[str, float]] = []
        ready = threading.Barrier(2)

        def live(name: str, period: float) -> None:
            with closing(LockstepClock("/clock", name, network=network)) as time:
                ready.wait(10.0)
                for _ in range(round(0.3 / period)):
                    time.sleep(period)
                    woken.append((name, round(time.now(), 6)))

        threads = [threading.Thread(target=live, args=one) for one in (("a", 0.03), ("b", 0.05))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(20.0)
        assert [at for name, at in woken if name == "a"] == [round(0.03 * n, 6) for n in range(1, 11)]
        assert [at for name, at in woken if name == "b"] == [round(0.05 * n, 6) for n in range(1, 7)]

    def test_one_that_is_killed_holds_the_time_no_more(self, tmp_path, monkeypatch: pytest.MonkeyPatch):
        """A participant that does not sleep is killed; the others go on."""
        monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
        with NameServer() as server, ExitStack() as opened:
            names = RemoteNames(server.contact)
            opened.callback(names.close)
            network = Network(names, report=lambda _sentence: None)
            robot = opened.enter_context(SimulatedRobot(ICUB, network=network, parts=("head",), lockstep=True))
            words = [sys.executable, "-c", _PARTICIPANT, str(server.contact.port)]
            other = opened.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE, text=True))
            opened.callback(other.kill)
            assert other.stdout is not None
            assert other.stdout.readline() == "works at 0.1\n"
            time = opened.enter_context(closing(LockstepClock("/clock", "survivor", network=network)))
            sleeper = threading.Timer(0.0, lambda: eventually(waits, "nobody waits") or other.kill())

            def waits() -> bool:
                """One participant waits while the other works."""
                return sorted(one.until is None for one in robot.clock.participants) == [False, True]

            sleeper.start()
            time.sleep(0.5)
            sleeper.join()
            assert time.now() == 0.6
            assert [one.name for one in robot.clock.participants] == ["survivor"]


_PARTICIPANT = """
import signal
import sys
from rtf.middleware.wire.contact import Contact
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.ports.network import Network
from rtf.middleware.clocks.network_clock import LockstepClock

time = LockstepClock(
    "/clock", "victim", network=Network(RemoteNames(Contact("/root", "127.0.0.1", int(sys.argv[1]), "tcp")))
)
time.sleep(0.1)
print("works at", time.now(), flush=True)
signal.pause()
"""


class TestDirecting:
    """Time that is paused, stepped and reset."""

    @pytest.fixture
    def ask(self, network: Network, robot: SimulatedRobot) -> Iterator[Any]:
        """A client of the clock that takes no part in the time."""
        with closing(RpcClient("", "/clock", network=network)) as client:
            yield lambda *words: client.call(Bottle(words), timeout=20.0)

    def test_pause_step_and_continue(self, network: Network, robot: SimulatedRobot, ask: Any):
        """While it is paused only steps advance the time, and sleepers go on sleeping."""
        assert ask("pause") == Bottle([Vocab("ok"), 0.0])
        woken: list[float] = []

        def live() -> None:
            with closing(LockstepClock("/clock", "sleeper", network=network)) as time:
                time.sleep(0.25)
                woken.append(time.now())

        sleeper = threading.Thread(target=live)
        sleeper.start()
        eventually(lambda: any(one.until for one in robot.clock.participants), "nobody sleeps")
        assert ask("step", 0.2) == Bottle([Vocab("ok"), 0.2])
        assert robot.simulation.now == 0.2
        assert woken == []
        ask("continue")
        sleeper.join(10.0)
        assert woken == [0.25]

    def test_reset(self, network: Network, robot: SimulatedRobot, time: clock.Clock, ask: Any):
        """The robot is at home at once, and time goes on."""
        with client_of(network, "left_arm") as arm:
            time.sleep(0.02)
            arm.set_reference_speeds(50.0, 3)
            arm.position_move(90.0, 3)
            time.sleep(1.0)
            assert arm.encoder(3) > 80.0
            assert ask("reset").get(0) == Vocab("ok")
            time.sleep(0.02)
            assert arm.encoder(3) == pytest.approx(45.0, abs=0.1)
            assert time.now() == pytest.approx(1.04)
            assert arm.target_positions(3) == pytest.approx([45.0], abs=0.1)

    def test_the_clock_is_published_and_followed(self, network: Network, robot: SimulatedRobot, ask: Any):
        """A process that reads ``/clock`` has the simulated time, to the millisecond."""
        with closing(NetworkClock("/clock", network=network)) as follower:
            ask("pause")
            ask("step", 0.5)
            eventually(lambda: follower.now() == pytest.approx(0.5, abs=1e-9), "the clock stands still")
            woken = threading.Thread(target=follower.sleep, args=(0.1,))
            woken.start()
            while woken.is_alive():
                ask("step", 0.05)
                woken.join(0.05)
            assert 0.6 - 1e-9 <= follower.now() <= robot.simulation.now + 1e-9


#: Parts that move at the same time; one of each pair goes through its joints backwards, so that limbs do not meet.
_TOGETHER = (("left_arm", "right_arm"), ("left_leg", "right_leg", "head"), ("torso",))
_BACKWARDS = frozenset({"right_arm", "right_leg"})


def moves(part: str) -> list[tuple[int, float]]:
    """The program of a part: each joint moves to its lower limit, its upper limit, and home."""
    joints = [*enumerate(PARTS[part])]
    if part in _BACKWARDS:
        joints.reverse()
    return [(joint, target) for joint, axis in joints for target in (axis.minimum, axis.maximum, axis.home)]


def test_all_limits_of_all_parts_are_reached(network: Network):
    """Each of the 53 joints reaches both limits and home within 0.2 degrees, without contacts."""
    touched: set[tuple[str, str]] = set()
    missed: list[str] = []
    reached = 0
    with (
        SimulatedRobot(ICUB, network=network, lockstep=True) as robot,
        clock.use(LockstepClock("/clock", "sweep", network=network)) as time,
        ExitStack() as opened,
    ):
        clients = {part: opened.enter_context(client_of(network, part)) for part in PARTS}
        time.sleep(0.02)
        for part, client in clients.items():
            client.set_reference_speeds(np.array([axis.max_velocity for axis in PARTS[part]]))
        for group in _TOGETHER:
            for turn in zip_longest(*(moves(part) for part in group)):
                commands = [(clients[part], *move) for part, move in zip(group, turn, strict=True) if move is not None]
                for client, joint, target in commands:
                    client.position_move(target, joint)
                while not all(client.motion_done(joint) for client, joint, _ in commands):
                    time.sleep(0.1)
                    touched |= {*touching(robot.simulation.plant.model, robot.simulation.data)}
                time.sleep(0.2)
                for client, joint, target in commands:
                    reached += 1
                    if abs(client.encoder(joint) - target) > 0.2:
                        missed.append(f"{client.name} {joint}: {client.encoder(joint):g} instead of {target:g}")
    assert missed == []
    assert touched == set()
    assert reached == 3 * 53
