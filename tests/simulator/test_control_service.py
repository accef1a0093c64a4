"""The control port of a simulated robot, over a network of this process."""

from __future__ import annotations

import math
import threading
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from icub import ICUB, INDEX
from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.middleware.clocks.network_clock import LockstepClock, NetworkClock, clock_from_environment
from rtf.middleware.errors import AddressError, ConnectError, NameNotFoundError, WaitTimeoutError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.errors import RefusedError
from rtf.simulator.control_client import SimulatorControl, control_port, describe_status
from rtf.simulator.faults import KINDS
from waiting import eventually, open_descriptors

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.simulator.robot import SimulatedRobot

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


class Bench:
    """A robot of two parts with its control service, and a client of it."""

    def __init__(self, network: Network, *, lockstep: bool = True, factor: float | None = 1.0) -> None:
        from rtf.simulator.control_service import SimulatorService
        from rtf.simulator.robot import SimulatedRobot

        self.network = network
        self.ended = threading.Event()
        parts = ("head", "left_arm")
        self.robot: SimulatedRobot = SimulatedRobot(
            ICUB, network=network, parts=parts, lockstep=lockstep, factor=factor
        )
        self.service = SimulatorService(self.robot, network=network, end=self.ended.set)
        self.control = SimulatorControl(network=network)

    def ask(self, question: str) -> str:
        """Send a request in the words of the port, and return the reply."""
        answer = self.service.answer(Bottle.parse(question))
        assert isinstance(answer, Bottle)
        return answer.to_text()

    def close(self) -> None:
        """Close client, service and robot."""
        self.control.close()
        self.service.close()
        self.robot.close()


@pytest.fixture
def said() -> list[str]:
    """Reports of the network; a test that expects one removes it."""
    return []


@pytest.fixture
def network(said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Network]:
    """A network of this process without error reports; afterwards no thread and no descriptor of it is left."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path / "runtime"))
    threads, descriptors = set(threading.enumerate()), open_descriptors()
    yield Network(LocalNames(), report=said.append)
    eventually(lambda: set(threading.enumerate()) <= threads, "a thread is left")
    eventually(lambda: open_descriptors() <= descriptors, "a descriptor is left")
    assert said == []


@pytest.fixture
def bench(network: Network) -> Iterator[Bench]:
    """A robot in lockstep."""
    made = Bench(network)
    yield made
    made.close()


@pytest.fixture
def moving(network: Network) -> Iterator[Bench]:
    """A robot whose time passes without participants, as fast as possible."""
    made = Bench(network, lockstep=False, factor=None)
    yield made
    made.close()


# How it is --------------------------------------------------------------------------------------------------------


def test_the_status_says_how_it_is(bench: Bench):
    """Name, time, parts, participants, contacts and faults, with their present values."""
    with clock.use(LockstepClock("/clock", "tester", network=bench.network)) as time:
        time.sleep(0.05)
        bench.control.inject("jam", "l_elbow", delay=2.0, duration=1.0)
        status = bench.control.status()
    assert (status.name, status.lockstep, status.clock, status.factor) == ("icubSim", True, "/clock", math.inf)
    assert status.time == pytest.approx(0.05)
    assert status.parts == ("head", "left_arm")
    assert status.participants == (("tester", None),)
    assert status.contacts == ()
    (fault,) = status.faults
    assert (fault.number, fault.kind, fault.target, fault.running) == (1, "jam", "l_elbow", False)
    assert (fault.begins, fault.ends) == pytest.approx((2.05, 3.05))
    assert status.broken == ""


def test_who_waits_is_in_the_status_with_the_time(bench: Bench):
    """The status names a participant that sleeps, and when it will wake up."""
    bench.control.pause()
    waiting = LockstepClock("/clock", "sleeper", network=bench.network)
    thread = threading.Thread(target=waiting.sleep, args=(1.5,))
    thread.start()
    eventually(lambda: ("sleeper", 1.5) in bench.control.status().participants, "nobody waits")
    waiting.leave()  # else the time would wait for this thread, too
    bench.control.resume()
    thread.join()
    waiting.close()


def test_time_that_has_ended_is_in_the_status(bench: Bench, said: list[str]):
    """An error in the loop is in every status after it."""

    def breaks() -> None:
        raise ArithmeticError("the physics exploded")

    bench.robot.simulation.after(0.01, breaks)
    bench.control.pause()
    bench.ask("step 0.1")
    assert bench.control.status().broken == "ArithmeticError: the physics exploded"
    assert "TIME ENDED" in describe_status(bench.control.status())
    assert "the physics exploded" in said.pop()


def test_what_was_achieved_is_measured(moving: Bench):
    """The factor without a limit is far above 1; with a limit it is that limit."""
    eventually(lambda: moving.control.status().time > 2.0, "time does not pass")
    eventually(lambda: moving.control.status().achieved > 1.5, "time is not faster than the machine's")
    moving.control.set_factor(0.5)
    then, began = clock.monotonic(), moving.control.status().time
    eventually(lambda: moving.control.status().time > began + 0.3, "time stands still")
    assert (moving.control.status().time - began) / (clock.monotonic() - then) < 0.7
    assert moving.control.status().factor == 0.5


def test_slowing_down_does_not_wait_for_what_has_passed(moving: Bench):
    """After a lower factor is set, the time goes on at once."""
    moving.control.set_factor(20.0)
    eventually(lambda: moving.control.status().time > 3.0, "time does not pass")
    moving.control.set_factor(1.0)
    now = moving.control.status().time
    eventually(lambda: moving.control.status().time > now + 0.05, "time stands still", 2.0)


def test_contacts_are_named(bench: Bench):
    """Two links that touch are listed as a pair, once, in order."""
    assert bench.control.contacts() == ()
    simulation = bench.robot.simulation
    with simulation.lock:
        pose = simulation.plant.home_axes.copy()
        for joint, angle in {"l_shoulder_pitch": 0.0, "l_shoulder_roll": 0.0, "l_elbow": 15.0}.items():
            pose[INDEX[joint]] = np.radians(angle)  # a stretched arm that hangs down, into the hip
        simulation.data.qpos[:] = simulation.plant.pose(pose)
        simulation.refresh()
    found = bench.control.contacts()
    assert ("l_forearm", "l_hip_1") in found
    assert all(first < second for first, second in found)
    assert len(set(found)) == len(found)
    assert found == bench.control.status().contacts


# Faults -----------------------------------------------------------------------------------------------------------


def test_faults_come_and_go(bench: Bench):
    """Injected by kind, target, parameters and times; listed by number; cleared one by one or all together."""
    boards, elbow = bench.robot.simulation.boards, INDEX["l_elbow"]
    first = bench.control.inject("encoder_bias", "l_elbow", {"bias": 3.0})
    second = bench.control.inject("jam", "l_elbow")
    third = bench.control.inject("crash", delay=1000.0)
    assert [one.number for one in bench.control.active()] == [first, second, third]
    bench.control.pause()
    bench.control.step(0.01)
    data = bench.robot.simulation.data
    assert boards.position[elbow] == pytest.approx(np.degrees(data.actuator_length[elbow]) + 3.0, abs=0.02)
    assert bench.control.clear(second) == 1
    assert bench.control.clear() == 2
    assert bench.control.active() == ()


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("inject jam l_elbow", "[ok] 1"),
        ("inject jam l_elbow (torque 5)", "[ok] 1"),
        ("inject jam l_elbow (torque 5) delay 1 duration 2", "[ok] 1"),
        ("inject jam delay 1 l_elbow", "[ok] 1"),
        ("inject crash delay 100", "[ok] 1"),
        ("clear", "[ok] 0"),
        ("active", "[ok]"),
        ("contacts", "[ok]"),
        ("factor inf", "[ok]"),
        ("factor 10", "[ok]"),
        ("quit", "[ok]"),
        ("", "[fail] \"'' is not a request; the requests are status, faults, describe"),
        ("dance", "[fail] \"'dance' is not a request; the requests are status, faults, describe"),
        ("inject", '[fail] "inject: the kind must be a word, not nothing"'),
        ("inject 5", '[fail] "inject: the kind must be a word, not 5"'),
        ("inject quake", "[fail] \"there is no fault 'quake'; there are jam"),
        (
            "inject jam l_elbow r_elbow",
            "[fail] \"inject: a fault has one target, l_elbow; there is another word, 'r_elbow'",
        ),
        ("inject jam l_elbow (torque)", '[fail] "inject: write (NAME VALUE), not torque"'),
        ("inject jam l_elbow (torque much)", '[fail] "inject: a parameter must be a number, not much"'),
        ("inject jam l_elbow delay", '[fail] "inject: delay must be a number, not nothing"'),
        ("inject jam l_elbow delay soon", '[fail] "inject: delay must be a number, not soon"'),
        ("inject jam l_elbow delay -1", '[fail] "jam: the delay must be 0 s or more'),
        ("clear 5", '[fail] "there is no fault number 5'),
        ("clear everything", "[fail] \"clear: 'everything' is not the number of a fault"),
        ("factor 0", '[fail] "factor: it must be 0.1 or more, not 0'),
        ("factor nan", '[fail] "factor: it must be 0.1 or more'),
        ("factor fast", '[fail] "factor must be a number, not fast"'),
        ("describe", '[fail] "describe: the kind must be a word, not nothing"'),
        ("step 1", '[fail] "pause first"'),
    ],
)
def test_answers(bench: Bench, question: str, answer: str):
    """A request is answered with its result, or with a message that names the error and a hint."""
    assert bench.ask(question).startswith(answer)


def test_kinds_are_listed_and_described(bench: Bench):
    """All kinds are listed with their parameters."""
    assert bench.control.faults() == tuple(KINDS)
    described = bench.control.ask("describe", "jam")
    assert described.find("kind") == "jam"
    assert described.find("layer") == "plant"
    parameters = described.find_group("parameters")
    assert parameters is not None
    assert parameters[1] == Bottle(["torque", 400.0, "Nm", "the torque that would move it", 0.0, 1e5])


def test_help_is_a_line_each(bench: Bench):
    """Each request has one line, which tools print."""
    with pytest.raises(RefusedError, match="there is no fault 'help'"):
        bench.control.inject("help")
    answer = bench.service.answer(Bottle.parse("help"))
    assert isinstance(answer, Bottle)
    assert answer[0] == Vocab("many")
    text = "\n".join(map(str, answer.tail()))
    for word in ("status", "inject", "clear", "active", "pause", "step", "reset", "factor", "quit", "contacts"):
        assert word in text


WORDS = st.one_of(
    st.sampled_from(
        ["inject", "clear", "jam", "l_elbow", "delay", "duration", "describe", "factor", "pause", "active"]
    ),
    st.floats(allow_nan=True),
    st.integers(-(2**31), 2**31 - 1),
    st.text(max_size=5),
    st.lists(st.one_of(st.sampled_from(["torque"]), st.floats(), st.integers(0, 9)), max_size=3).map(Bottle),
    st.binary(max_size=3),
    st.just(Vocab("fail")),
)
#: What would end the process, or wait for ever, is asked in tests of its own.
_BUSY = {"step", "reset", "quit", "crash", "hang"}


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(words=st.lists(WORDS.filter(lambda word: not isinstance(word, str) or word not in _BUSY), max_size=8))
def test_any_question_is_answered(bench: Bench, words: list[object]):
    """With ok or fail, for any bottle; an answer does not repeat a long question."""
    answer = bench.service.answer(Bottle(words))
    assert isinstance(answer, Bottle)
    assert answer[0] in (Vocab("ok"), Vocab("fail"))
    long = bench.service.answer(Bottle(["x" * 100_000]))
    assert isinstance(long, Bottle)
    assert len(long.to_text()) < 1000
    bench.robot.clock.resume()


# Time -------------------------------------------------------------------------------------------------------------


def test_time_is_directed_as_at_the_clock(moving: Bench):
    """It is paused, stepped exactly, and continued."""
    paused = moving.control.pause()
    stands = moving.control.status().time
    assert stands - paused < 0.02
    assert moving.control.step(0.25) == pytest.approx(moving.control.status().time)
    assert moving.control.status().time >= paused + 0.25 - 1e-9  # decimal fractions are rounded
    assert moving.control.status().time == moving.control.status().time
    moving.control.resume()
    eventually(lambda: moving.control.status().time > stands + 1.0, "time does not pass")


def test_a_reset_repairs_and_goes_home(bench: Bench):
    """Faults are cleared and joints are at home; the time goes on."""
    boards = bench.robot.simulation.boards
    home = boards.position.copy()
    bench.control.inject("motor_dead", "l_elbow")
    bench.control.pause()
    bench.control.step(0.5)
    assert abs(boards.position - home).max() > 5.0
    assert bench.control.reset() == pytest.approx(0.5)
    assert bench.control.active() == ()
    assert boards.position == pytest.approx(home)


def test_quit_ends_the_program(bench: Bench):
    """The request is answered, and the program is notified."""
    bench.control.quit()
    assert bench.ended.is_set()


# Clients -------------------------------------------------------------------------------------------------------------


def test_nobody_there(network: Network):
    """The error names the port."""
    with SimulatorControl("nobody", network=network) as control, pytest.raises(NameNotFoundError, match="/nobody/sim"):
        control.status()


def test_one_that_does_not_answer(network: Network, said: list[str]):
    """The client waits for the given time; the next request opens a new connection."""
    release = threading.Event()
    answers = iter([None, Bottle([Vocab("ok"), 3])])

    def answer(_: Bottle) -> object:
        found = next(answers)
        if found is None:
            release.wait(20.0)
        return found

    with (
        RpcServer(control_port("slow"), answer, network=network),
        SimulatorControl("slow", network=network, patience=0.05) as control,
    ):
        with pytest.raises(WaitTimeoutError):
            control.clear()
        release.set()
        assert control.clear() == 3
    del said[:]


def test_something_else_at_its_name(network: Network):
    """A reply without ok or fail is an error."""
    with (
        Port(control_port("odd"), lambda delivery: delivery.reply(Bottle()), network=network),
        SimulatorControl("odd", network=network) as control,
        pytest.raises(ConnectError, match="is not the control port of a simulator"),
    ):
        control.status()


def test_the_status_in_words(bench: Bench):
    """The text has all members of the status."""
    bench.control.inject("jam", "l_elbow", duration=3.0)
    with clock.use(LockstepClock("/clock", "tester", network=bench.network)):
        text = describe_status(bench.control.status())
    assert "icubSim at 0.000 s, lockstep" in text
    assert "participant   tester works" in text
    assert "jam l_elbow running, from 0.000 s to 3.000 s" in text


# The clock of a client ------------------------------------------------------------------------------------------------


def test_the_environment_says_by_which_clock_one_lives(bench: Bench):
    """Lockstep with a simulator, the time of a port, or that of the machine."""
    network = bench.network
    assert type(clock_from_environment(network, {})) is clock.SystemClock
    with clock.use(clock_from_environment(network, {"RTF_CLOCK": "lockstep:/clock", "YARP_CLOCK": "/else"})) as time:
        assert isinstance(time, LockstepClock)
        before = time.now()
        time.sleep(0.25)
        assert time.now() == pytest.approx(before + 0.25)
    with clock.use(clock_from_environment(network, {"YARP_CLOCK": "/clock"})) as time:
        assert isinstance(time, NetworkClock)


@pytest.mark.parametrize("text", ["clock", "lockstep:", "lockstep:clock", "real time"])
def test_what_names_no_clock_is_refused(network: Network, text: str):
    """The error lists the valid forms."""
    with pytest.raises(AddressError, match="write lockstep:/clock, or /clock, or nothing"):
        clock_from_environment(network, {"RTF_CLOCK": text})
