"""The loop of the simulation: events, the lock for commands, the pace, and resets."""

from __future__ import annotations

import statistics
import threading
from importlib.util import find_spec
from itertools import chain

import numpy as np
import pytest

from icub import INDEX, build_icub
from rtf import clock
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.interfaces import PidType
from rtf.simulator.fair_lock import FairLock
from rtf.simulator.simulation import Simulation
from waiting import eventually

from .rig import Rig

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture
def simulation() -> Simulation:
    """A robot at home."""
    return Simulation(build_icub())


class Diary:
    """A publisher that notes the times at which it is called."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.times: list[float] = []

    def publish(self, now: float) -> None:
        """See Publisher."""
        self.times.append(now)


class TestHappenings:
    """The queue of events."""

    def test_each_at_its_step_in_the_order_of_asking(self, simulation: Simulation):
        """By time; at the same time in the order of the requests."""
        seen: list[tuple[str, int]] = []

        def note(name: str):
            return lambda: seen.append((name, simulation.boards.tick))

        for tick, name in ((7, "c"), (3, "a"), (7, "d"), (3, "b"), (0, "first"), (50, "later")):
            simulation.at(tick, note(name))
        simulation.advance(0.02)
        assert seen == [("first", 0), ("a", 3), ("b", 3), ("c", 7), ("d", 7)]

    def test_what_happens_may_ask_for_more(self, simulation: Simulation):
        """At the same step, too; ``after`` is never now."""
        seen: list[tuple[str, int]] = []

        def happening() -> None:
            simulation.at(simulation.boards.tick, lambda: seen.append(("now", simulation.boards.tick)))
            simulation.after(0.0, lambda: seen.append(("next", simulation.boards.tick)))
            simulation.after(0.0042, lambda: seen.append(("later", simulation.boards.tick)))

        simulation.at(10, happening)
        simulation.advance(0.02)
        assert seen == [("now", 10), ("next", 11), ("later", 14)]

    def test_what_is_late_happens_at_once(self, simulation: Simulation):
        """An event whose time has passed happens in the next step."""
        simulation.advance(0.01)
        seen: list[int] = []
        simulation.at(3, lambda: seen.append(simulation.boards.tick))
        simulation.advance(0.02)
        assert seen == [10]

    @pytest.mark.parametrize("stride", [0.001, 0.0033, 0.01, 0.5])
    def test_what_is_regular_comes_at_multiples_of_its_period(self, simulation: Simulation, stride: float):
        """Each is rounded to a step, whatever the steps of ``advance``, and none is left out."""
        simulation.advance(0.004)
        diaries = [Diary(0.01), Diary(0.003), Diary(1 / 30)]
        for diary in diaries:
            simulation.publish_regularly(diary)
        while simulation.now < 0.5:
            simulation.advance(min(simulation.now + stride, 0.5))
        assert diaries[0].times == [tick / 1000 for tick in range(10, 501, 10)]
        assert diaries[1].times == [tick / 1000 for tick in range(6, 501, 3)]
        assert diaries[2].times == [round(1000 * n / 30) / 1000 for n in range(1, 16)]

    def test_time_comes_to_what_was_asked_for(self, simulation: Simulation):
        """To the step that is not before it; sums of decimal fractions are no reason for another step."""
        assert simulation.advance(0.1 + 0.2) == 0.3
        assert simulation.advance(0.3004) == 0.301
        assert simulation.advance(0.2) == 0.301
        assert simulation.boards.tick == 301

    def test_measurements_are_those_of_the_moment(self, simulation: Simulation):
        """Values published at a step are those that are read after that step."""
        rig_axis = INDEX["l_elbow"]
        simulation.boards.move(np.array([rig_axis]), np.array([90.0]))
        seen: list[float] = []
        simulation.at(700, lambda: seen.append(float(simulation.boards.position[rig_axis])))
        simulation.advance(0.7)
        assert seen == [float(simulation.boards.position[rig_axis])]
        assert np.degrees(simulation.data.actuator_length[rig_axis]) == pytest.approx(seen[0], abs=0.01)

    def test_after_an_error_the_gate_is_free(self, simulation: Simulation):
        """The lock is released after an error in the loop."""

        def explode() -> None:
            raise ArithmeticError("boom")

        simulation.at(5, explode)
        with pytest.raises(ArithmeticError):
            simulation.advance(0.1)
        with simulation.lock:
            assert simulation.boards.tick == 5

    def test_settled_at_the_end_with_the_gate_open(self, simulation: Simulation):
        """Delivery is awaited once an advance, while commands may take the lock."""
        free: list[bool] = []

        def settle() -> None:
            other = threading.Thread(target=lambda: free.append(bool(simulation.lock.__enter__())))
            other.start()
            other.join(5.0)

        simulation.settle.append(settle)
        simulation.advance(0.003)
        assert free == [True]


class TestGate:
    """Commands from any thread while the loop runs."""

    def test_who_finds_it_free_waits_for_nobody(self):
        """A free lock is taken at once, and again by its owner."""
        lock = FairLock()
        with lock, lock:
            assert lock.waiting == 0
        lock.acquire()
        lock.yield_to_waiting()
        lock.release()

    def test_who_waits_has_it_before_the_loop_goes_on(self):
        """All waiting threads get the lock, one after the other, when the loop yields it."""
        lock, done = FairLock(), list[int]()

        def command(number: int) -> None:
            with lock:
                done.append(number)

        lock.acquire()
        others = [threading.Thread(target=command, args=(number,)) for number in range(3)]
        for other in others:
            other.start()
        eventually(lambda: lock.waiting == len(others), "a command does not wait")
        assert done == []
        lock.yield_to_waiting()
        assert sorted(done) == [0, 1, 2]
        assert lock.waiting == 0
        lock.release()
        for other in others:
            other.join(5.0)

    def test_commands_are_served_while_the_loop_runs_at_full_speed(self, simulation: Simulation):
        """Several threads get the lock within a few steps each."""
        ended = threading.Event()
        loop = threading.Thread(target=self.run, args=(simulation, ended))
        loop.start()
        waits: list[list[int]] = [[] for _ in range(4)]

        def command(own: list[int]) -> None:
            for _ in range(100):
                begin = simulation.boards.tick
                with simulation.lock:
                    simulation.boards.speeds[0] += 1.0
                    own.append(simulation.boards.tick - begin)

        others = [threading.Thread(target=command, args=(own,)) for own in waits]
        for other in others:
            other.start()
        for other in others:
            other.join(30.0)
        ended.set()
        loop.join(30.0)
        assert [len(own) for own in waits] == [100] * 4
        assert simulation.boards.speeds[0] == 10.0 + 400.0
        assert statistics.median(chain.from_iterable(waits)) < 5

    def run(self, simulation: Simulation, ended: threading.Event) -> None:
        """Let time pass as fast as it can."""
        while not ended.is_set():
            simulation.advance(simulation.now + 0.1)

    def test_commands_without_end_do_not_stop_the_time(self, simulation: Simulation):
        """Steps go on between any number of commands."""
        ended = threading.Event()

        def command() -> None:
            while not ended.is_set():
                with simulation.lock:
                    pass

        others = [threading.Thread(target=command) for _ in range(4)]
        for other in others:
            other.start()
        try:
            runner = threading.Thread(target=simulation.advance, args=(0.05,), daemon=True)
            runner.start()
            runner.join(60.0)
            assert simulation.now == 0.05, "commands keep the time standing still"
        finally:
            ended.set()
            for other in others:
                other.join(10.0)
            runner.join(10.0)

    def test_who_gets_through_finds_the_sensors_of_the_step(self):
        """The sensors are computed before the lock is yielded, though not in other steps."""

        def forces(simulation: Simulation) -> list[float]:
            return np.concatenate([sensor.read(simulation.data.sensordata) for sensor in sensors]).tolist()

        looked_at, stepped = Simulation(build_icub()), Simulation(build_icub())
        sensors = stepped.plant.ft_sensors
        for simulation in (looked_at, stepped):
            simulation.boards.move(np.array([INDEX["r_elbow"]]), np.array([90.0]))
        seen: dict[int, list[float]] = {}

        def run() -> None:
            while len(seen) < 5 and looked_at.now < 60.0:  # on a busy machine nobody looks for a while
                looked_at.advance(looked_at.now + 0.2)

        loop = threading.Thread(target=run)
        loop.start()
        while loop.is_alive():
            with looked_at.lock:
                seen[looked_at.boards.tick] = forces(looked_at)
        expected = {}
        while stepped.boards.tick < looked_at.boards.tick:
            stepped.advance(stepped.now + 0.001)
            expected[stepped.boards.tick] = forces(stepped)
        seen.pop(0, None)  # before the first step
        assert len(seen) > 2
        assert seen == {tick: expected[tick] for tick in seen}
        assert looked_at.data.qpos.tolist() == stepped.data.qpos.tolist()

    def test_it_may_be_entered_twice_by_one_thread(self):
        """The loop that takes a picture holds it already."""
        lock = FairLock()
        lock.acquire()
        with lock, lock:
            pass
        lock.release()
        assert not lock.waiting
        seen: list[bool] = []
        other = threading.Thread(target=lambda: seen.append(bool(lock.__enter__())))
        other.start()
        other.join(5.0)
        assert seen == [True]


class Machine:
    """A machine's clock on which nothing takes time but what the test says: ``cost`` seconds each look at it."""

    def __init__(self) -> None:
        self.time = 1000.0
        self.cost = 0.0

    def monotonic(self) -> float:
        """See clock."""
        self.time += self.cost
        return self.time

    def sleep(self, seconds: float) -> None:
        """See clock."""
        self.time += seconds


class TestPace:
    """How fast time passes."""

    @pytest.fixture
    def machine(self, monkeypatch: pytest.MonkeyPatch) -> Machine:
        """The machine's clock, as the loop sees it."""
        machine = Machine()
        monkeypatch.setattr("rtf.simulator.simulation.clock", machine)
        return machine

    def timed(self, simulation: Simulation, machine: Machine, seconds: float) -> float:
        """Simulate; return the ratio of simulated time to that of the machine."""
        begin, start = machine.time, simulation.now
        while simulation.now < start + seconds:
            simulation.advance(simulation.now + 0.01)
        return seconds / (machine.time - begin)

    @pytest.mark.parametrize("factor", [0.1, 1.0, 5.0])
    def test_factor(self, machine: Machine, factor: float):
        """So many times as fast as the machine's clock, also when steps themselves take most of the time."""
        simulation = Simulation(build_icub(), factor=factor)
        simulation.advance(0.1)
        assert self.timed(simulation, machine, 1.0) == pytest.approx(factor, rel=0.02)
        machine.cost = 0.008 / factor
        assert self.timed(simulation, machine, 1.0) == pytest.approx(factor, rel=0.02)

    def test_another_factor_holds_from_then_on(self, machine: Machine):
        """Time before the change is not made up for, in either direction."""
        simulation = Simulation(build_icub(), factor=10.0)
        for factor in (10.0, 1.0, 10.0):
            simulation.factor = factor
            assert self.timed(simulation, machine, 1.0) == pytest.approx(factor, rel=0.02)

    def test_a_standstill_is_not_made_up_for(self, machine: Machine):
        """After the lock was held for long the loop keeps its pace; delays of some milliseconds are made up for."""
        simulation = Simulation(build_icub(), factor=4.0)
        self.timed(simulation, machine, 0.2)
        machine.time += 3.0
        assert self.timed(simulation, machine, 1.0) == pytest.approx(4.0, rel=0.02)
        begin, start = machine.time, simulation.now
        machine.time += 0.05
        self.timed(simulation, machine, 1.0)
        assert (simulation.now - start) / (machine.time - begin) == pytest.approx(4.0, rel=0.02)

    def test_it_is_never_faster_on_a_real_machine(self):
        """However busy the machine is."""
        simulation = Simulation(build_icub(), factor=5.0)
        simulation.advance(0.01)
        begin, start = clock.monotonic(), simulation.now
        simulation.advance(1.0)
        assert (simulation.now - start) / (clock.monotonic() - begin) < 5.0 * 1.06

    def test_commands_get_in_while_it_waits(self):
        """The loop computes ten milliseconds, and does not hold the lock while it sleeps."""
        simulation = Simulation(build_icub(), factor=0.01)  # it would take twenty seconds
        runner = threading.Thread(target=simulation.advance, args=(0.2,))
        runner.start()
        eventually(lambda: simulation.now > 0.0, "time does not begin")
        with simulation.lock:
            came = simulation.now
            simulation.pace(None)
        runner.join(30.0)
        # The pace begins after the first stride. If the lock were held during the pause, one more step would be done.
        assert came <= 0.02


class TestReset:
    """Resets of the simulation."""

    def spoilt(self, rig: Rig) -> None:
        """Change settings, modes and faults of a robot."""
        boards, part = rig.boards, rig.part("left_arm")
        part.position_move(60.0, 3)
        part.set_control_modes(ControlMode.VELOCITY, 5)
        part.velocity_move(20.0, 5)
        part.set_control_modes(ControlMode.PWM, 6)
        part.set_reference_duty_cycles(30.0, 6)
        part.set_interaction_modes(InteractionMode.COMPLIANT, 0)
        part.set_limits(1, 10.0, 20.0)
        part.set_pwm_limit(2, 50.0)
        part.set_pid_offset(PidType.POSITION, 2, 5.0)
        part.set_gearbox_ratio(4, 7.0)
        part.set_encoders(3.0, 7)
        part.set_motor_encoders(3.0, 7)
        part.set_max_current(8, 0.0)
        part.set_impedance(0, 0.1, 0.1)
        boards.temperature[:] = 70.0
        boards.calibrate(9)
        rig.push("l_knee", 30.0)
        rig.simulation.noise(17)
        rig.run(0.98)

    def test_the_robot_is_as_when_it_was_new(self):
        """All settings and the motion afterwards are those of a new robot, to the last bit."""
        rig, fresh = Rig(), Rig()
        self.spoilt(rig)
        cleaned: list[bool] = []
        rig.simulation.on_reset.append(lambda: cleaned.append(True))
        rig.run(0.02)
        assert rig.boards.tick == 1000
        rig.simulation.reset()
        assert cleaned == [True]
        assert rig.simulation.now == 1.0
        for name, value in vars(fresh.boards).items():
            if isinstance(value, np.ndarray) and name not in ("_snapshot", "_scratch"):
                assert np.array_equal(getattr(rig.boards, name), value), name
        assert rig.boards.pids == fresh.boards.pids
        assert rig.boards.faults == fresh.boards.faults
        assert rig.boards._planned == []
        for one in (rig, fresh):
            one.part("right_arm").position_move(70.0, 3)
            one.run(1.0)
        assert rig.data.qpos.tolist() == fresh.data.qpos.tolist()
        assert rig.data.ctrl.tolist() == fresh.data.ctrl.tolist()
        assert rig.simulation.noise(9).tolist() == fresh.simulation.noise(9).tolist()

    def test_the_physics_hold_still_at_home(self):
        """No joint moves after a reset."""
        rig = Rig()
        self.spoilt(rig)
        rig.simulation.reset()
        assert rig.farthest(0.3, np.degrees(rig.simulation.plant.home_axes)) < 0.05


class TestNoise:
    """Random numbers of the simulation."""

    def test_they_are_normal_and_never_the_same_twice(self, simulation: Simulation):
        """For any number of values, also above the number that is drawn at once."""
        taken = np.concatenate([simulation.noise(count).copy() for count in (1, 6, 4000, 97, 10_000, 3)])
        assert len(np.unique(taken)) == len(taken)
        assert np.mean(taken) == pytest.approx(0.0, abs=0.05)
        assert np.std(taken) == pytest.approx(1.0, abs=0.05)

    def test_the_seed_decides(self):
        """Equal seeds give equal numbers, other seeds other numbers."""
        robot = build_icub()
        one, same, other = (Simulation(robot, seed=seed).noise(5).tolist() for seed in (3, 3, 4))
        assert one == same
        assert one != other
