"""Contacts: a joint that hits an obstacle is stopped and named, a free motion is not, and the forces are recorded."""

from __future__ import annotations

import sys
import threading
from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness import run_command, write_files
from robot_outcomes import said
from rtf import clock
from rtf.bottle import Property
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.types import VECTOR
from rtf.robot.client.boards import connect
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.server.control_board import ControlBoardServer
from rtf.robot.server.outlets import PipelinedOutlets
from rtf.robot_testing.guard.contacts import ContactWatch, Forces, NoForcesError, force_port
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.motion.part import Part
from rtf.simulator.icub import SimulatedIcub
from rtf.testing.events import SeriesRecorded
from rtf.testing.verdict import Verdict

from ...robot.sensor_bench import ManualClock  # noqa: TID252 - a neighbour among the tests

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection

SENSOR = "/fake/left_arm/analog:o"
WEIGHT = (0.0, 0.0, 20.0)


class HastyBoard(FakeBoard):
    """A board whose second joint says that it turns as fast as it is told to say (deg/s); ``frozen``: none moves.

    ``noise`` is that of all its speeds (deg/s).
    """

    speed = noise = 0.0
    frozen = False

    def __init__(self, name: str, *, network: Network) -> None:
        super().__init__(name, network=network)
        self.stopped: list[AxisSelection] = []
        self._random = np.random.default_rng(1)

    def stop(self, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self.stopped.append(joints)
        super().stop(joints)

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource."""
        time = super().fill_state(state)
        if self.frozen:
            state.joint_positions[:] = state.joint_velocities[:] = 0.0
        state.joint_velocities[1] = self.speed
        state.joint_velocities += self._random.normal(0.0, self.noise, len(state.joint_velocities))
        return time


class Limb:
    """An arm of three joints, its sensor, and a guard that watches both. A step is 10 ms."""

    def __init__(self, stack: ExitStack) -> None:
        self.network = Network(LocalNames())
        self.time = stack.enter_context(clock.use(ManualClock()))
        self.device = HastyBoard("fake", network=self.network)
        self.device.open(Property.parse("(GENERAL (Joints 3))"))
        stack.callback(self.device.close)
        self.server = ControlBoardServer(
            self.device, "/fake/left_arm", network=self.network, outlets=PipelinedOutlets(self.network)
        )
        stack.callback(self.server.close)
        self.sensor = Port(SENSOR, network=self.network, inputs=False)
        stack.callback(self.sensor.close)
        self.board = stack.enter_context(connect("/fake/left_arm", carrier="tcp", network=self.network))
        self.forces = Forces(SENSOR, network=self.network)
        stack.callback(self.forces.close)
        self.said: list[str] = []
        self.sent = 0
        self.server.publish(self.time.now())
        self.server.settle()
        self.guard = self.watched()

    def watched(self, limits: Limits | None = None) -> MotionGuard:
        """A guard of it."""
        return MotionGuard(
            self.board,
            "/fake/left_arm",
            clock=self.time,
            report=self.said.append,
            limits=limits,
            contacts=ContactWatch(self.board, self.forces),
        )

    def step(
        self, force: tuple[float, ...] = WEIGHT, *, steps: int = 1, numbers: int = 6, stamped: bool = True
    ) -> None:
        """Let the sensor and the board say how things are, and the guard look."""
        for _ in range(steps):
            self.time.sleep(0.01)
            self.feel(force, numbers=numbers, at=self.time.now() if stamped else None)
            self.show()
            self.guard.watch()

    def feel(self, force: tuple[float, ...], *, numbers: int = 6, at: float | None) -> None:
        """Let the sensor say a force, as of such a moment; None: without a stamp."""
        values = np.zeros(numbers)
        values[:3] = force
        self.sensor.write(values, VECTOR, envelope="" if at is None else f"{self.sent} {at:.6f}")
        self.sent += 1

    def show(self) -> None:
        """Let the board say how it is."""
        self.server.publish(self.time.now())
        self.server.settle()


@pytest.fixture
def limb() -> Iterator[Limb]:
    """The arm, free for a second."""
    with ExitStack() as stack:
        limb = Limb(stack)
        limb.step(steps=100)
        yield limb


def test_force_that_comes_suddenly_stops_all_joints_and_is_named(limb: Limb):
    """The sentence has joint, part, sensor, force and limit; the joint is the one that moved."""
    limb.board.set_reference_speeds([20.0, 20.0], [0, 2])
    limb.board.position_move([50.0, 90.0], [0, 2])
    limb.step(steps=30)
    with pytest.raises(
        GuardError,
        match=r"joint\d \(/fake/left_arm joint \d\) is in contact with an obstacle; "
        r"/fake/left_arm/analog:o shows at least \d\d N of contact within 0.2 s, more than 15 N; "
        r"all joints of the part were stopped",
    ) as caught:
        limb.step((60.0, 0.0, 20.0), steps=20)
    assert caught.value.joint in (0, 2)
    assert limb.device.motion_done()


def test_part_that_does_not_move_is_pushed_or_its_encoder_is_frozen(limb: Limb):
    """Nothing is said of striking; the joint is the one that is farthest from where it was told to be."""
    limb.device.frozen = True
    limb.board.position_move([50.0], [2])
    with pytest.raises(GuardError, match="is at rest by its encoder, but in contact") as caught:
        limb.step((60.0, 0.0, 20.0), steps=20)
    assert caught.value.joint == 2


def test_force_that_comes_slowly_is_no_contact(limb: Limb):
    """Something heavy that is laid on, or a sensor that warms up: 15 N in a fifth of a second is the limit."""
    for force in np.arange(0.0, 100.0, 0.6):
        limb.step((float(force), 0.0, 20.0))


def test_force_of_a_joint_that_is_hastened_is_no_contact(limb: Limb):
    """A load of 2 kg that is brought to 60 deg/s in 10 ms presses with about as much."""
    for speed, force in ((30.0, 30.0), (60.0, 30.0), (60.0, 0.0), (60.0, 0.0), (30.0, -30.0), (0.0, -30.0)):
        limb.device.speed = speed
        limb.step((force, 0.0, 20.0))
    limb.step(steps=30)


@pytest.mark.parametrize("begin", np.arange(0.0, 0.01, 0.001))
def test_a_push_that_is_over_at_once_is_no_contact(limb: Limb, begin: float):
    """A motor that gives all it has for 20 ms: it is felt in two messages or three, and states show a slope."""
    limb.guard = limb.watched(Limits(speed=np.inf))
    limb.step(steps=30)
    inertia, rate = 20.0 / 9.81 * 0.3, 6000.0
    for elapsed in np.arange(0.0, 0.3, 0.01):
        pushed = min(max(float(elapsed) - begin, 0.0), 0.02)
        limb.device.speed = rate * pushed
        limb.step((inertia * np.radians(rate) * (0.0 < pushed < 0.02), 0.0, 20.0))


def test_noise_of_speeds_hides_no_contact(limb: Limb):
    """6 deg/s of it would explain 60 N that nobody presses with. That it is so is reported once."""
    limb.device.noise = 6.0
    limb.step(steps=200)
    (said,) = limb.said
    assert said.startswith("/fake/left_arm is watched for contacts with less sensitivity: the noise of its speeds")
    with pytest.raises(GuardError, match="in contact"):
        limb.step((40.0, 0.0, 20.0), steps=20)


def test_single_message_that_is_wrong_is_no_contact(limb: Limb):
    """Real sensors have spikes. What is no number is none either."""
    for wrong in ((500.0, 0.0, 0.0), (np.nan,) * 3):
        limb.step(wrong)
        limb.step(steps=30)


def test_a_sensor_that_sends_no_numbers_is_told(limb: Limb):
    """Nobody may think that it watches: after a second it is said, once, and the rest is watched on."""
    limb.step((np.nan,) * 3, steps=90)
    assert limb.said == []
    limb.step((np.nan,) * 3, steps=30)
    assert limb.said == [
        f"/fake/left_arm is not watched for contacts: the values of {SENSOR} are not finite",
    ]
    limb.step((np.nan,) * 3, steps=150)
    assert len(limb.said) == 1


def test_joints_whose_speeds_are_no_numbers_strike_nothing(limb: Limb):
    """A board may not measure one of them: it is told that nobody can tell contacts then."""
    guard = limb.guard = limb.watched(Limits(speed=np.inf))
    limb.device.speed = np.nan
    limb.step(steps=90)
    assert limb.said == []
    limb.step(steps=30)
    assert limb.said == [f"{guard.name} is not watched for contacts: positions or speeds of its joints are not finite"]


def test_stamps_that_jump_back_blind_nobody(limb: Limb):
    """The robot's clock was set: what comes then is watched like what came before."""
    limb.time.time -= 50.0
    limb.step(steps=100)
    with pytest.raises(GuardError, match="in contact"):
        limb.step((60.0, 0.0, 20.0), steps=20)


def test_letting_go_is_no_second_contact(limb: Limb):
    """A limb that strikes, presses, and is taken away has struck once; if it strikes again it is stopped again."""
    for _ in range(2):
        with pytest.raises(GuardError):
            limb.step((60.0, 0.0, 20.0), steps=20)
        limb.step((60.0, 0.0, 20.0), steps=50)
        limb.step(steps=50)


def test_joints_that_were_excluded_are_not_stopped(limb: Limb):
    """They are idle, and a board may refuse."""
    limb.guard.exclude(1, "it does not obey")
    with pytest.raises(GuardError):
        limb.step((60.0, 0.0, 20.0), steps=20)
    assert limb.device.stopped == [[0, 2]]


def test_without_a_limit_nothing_is_watched(limb: Limb):
    """A test in which joints fall on purpose says so."""
    limb.guard = limb.watched(Limits(contact=None))
    limb.step((60.0, 0.0, 20.0), steps=20)


@pytest.mark.parametrize(
    ("sent", "said_of_it"),
    [({"numbers": 3}, "3 numbers, not the 6 of a force-torque sensor"), ({"stamped": False}, "no stamps")],
)
def test_port_that_sends_something_else_is_told_once(limb: Limb, sent: dict[str, Any], said_of_it: str):
    """It is no failure of the part that its sensor cannot be understood."""
    limb.step(steps=10, **sent)
    assert limb.said == [f"/fake/left_arm is not watched for contacts: {SENSOR} sends {said_of_it}"]


def test_sensor_that_falls_silent_is_told_once(limb: Limb):
    """Anyone who reads the log knows that nobody felt what came then."""
    for _ in range(150):
        limb.time.sleep(0.01)
        limb.server.publish(limb.time.now())
        limb.server.settle()
        limb.guard.watch()
    assert limb.said == [f"/fake/left_arm is not watched for contacts: nothing has come from {SENSOR} for 1 s"]


def test_streams_that_are_behind_each_other_are_brought_together(limb: Limb):
    """Forces of a moment of which the state is not there yet wait for it."""
    limb.device.speed = 60.0
    for number in range(4):
        at = limb.time.now() + 0.05 + 0.01 * number
        limb.sensor.write(np.array([40.0, 0, 20, 0, 0, 0]), VECTOR, envelope=f"{limb.sent} {at:.6f}")
    limb.guard.watch()


def test_a_force_of_which_the_motion_is_not_known_yet_is_no_contact(limb: Limb):
    """States may be late, as on a busy machine: when they are there they explain it."""
    limb.guard = limb.watched(Limits(speed=np.inf))
    for behind in (2, 3, 5, 8):
        limb.step(steps=30)
        for number in range(behind):  # the joint is hastened, the sensor feels it, and no state shows it
            limb.feel((40.0, 0.0, 20.0), at=limb.time.now() + 0.01 * (number + 1))
            limb.guard.watch()
        for _ in range(behind):
            limb.time.sleep(0.01)
            limb.device.speed += 50.0
            limb.show()
            limb.guard.watch()
        limb.device.speed = 0.0
    assert limb.said == []


def test_what_a_limb_did_in_a_gap_of_its_states_is_not_known(limb: Limb):
    """It may have been hastened and stopped there; a contact that lasts is felt behind it all the same."""
    limb.step(steps=30)
    for force in (40.0, 40.0, 40.0, 0.0):  # no state
        limb.time.sleep(0.01)
        limb.feel((force, 0.0, 20.0), at=limb.time.now())
        limb.guard.watch()
    limb.step(steps=30)
    for _ in range(4):
        limb.time.sleep(0.01)
        limb.feel((40.0, 0.0, 20.0), at=limb.time.now())
        limb.guard.watch()
    with pytest.raises(GuardError, match="but in contact"):
        limb.step((40.0, 0.0, 20.0), steps=12)
    assert limb.said == []


def test_a_limb_of_which_many_states_are_missing_is_told_once(limb: Limb):
    """Anyone who reads the log knows that contacts were felt late, if at all."""
    for number in range(300):
        limb.time.sleep(0.01)
        limb.feel(WEIGHT, at=limb.time.now())
        if number % 5 < 2:
            limb.show()
        limb.guard.watch()
    assert len(limb.said) == 1
    assert "is watched for contacts with less sensitivity: for 1 s too many of its states were missing" in limb.said[0]


def test_limits_that_the_guard_has_asked_for_are_not_asked_for_again(limb: Limb):
    """Opening a part asks each question once: it is a question a joint."""
    limb.device.limits = limb.device.velocity_limits = None  # type: ignore[method-assign, assignment]
    part = Part("left_arm", limb.board, limb.time, limb.guard)
    assert part.high.tolist() == [high for _, high in limb.guard.snapshot.limits]
    assert part.fastest.tolist() == limb.guard.fastest.tolist()


def test_messages_that_come_while_it_looks_disturb_nobody(limb: Limb):
    """They come from another thread, at any moment."""
    forces = limb.forces
    message = forces.newest(1)[0]
    over = threading.Event()

    def hear() -> None:
        while not over.is_set():
            forces._messages.append(message)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    hearing = threading.Thread(target=hear, name="hearing")
    hearing.start()
    try:
        assert all(len(forces.newest(30)) == 30 for _ in range(500))
    finally:
        over.set()
        hearing.join()
        sys.setswitchinterval(before)


def test_sensor_that_is_not_there_is_told():
    """And its name with it."""
    with pytest.raises(NoForcesError, match="/nobody/left_arm/analog:o"):
        Forces("/nobody/left_arm/analog:o", network=Network(LocalNames()))


def test_only_arms_and_legs_have_sensors():
    """Nobody looks for one at the head."""
    assert force_port("/icub/right_leg") == "/icub/right_leg/analog:o"
    assert force_port("/icub/head") is force_port("/icub/torso") is None


# On the simulated robot ------------------------------------------------------------------------------------------

simulated = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture
def arm(tmp_path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Part]:
    """The left arm of a simulated robot in lockstep, guarded, with its elbow bent."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    network = Network(LocalNames())
    with ExitStack() as stack:
        stack.enter_context(SimulatedIcub(network=network, parts=("left_arm",), lockstep=True))
        time = stack.enter_context(clock.use(LockstepClock("/clock", "test", network=network)))
        stack.callback(time.close)
        board = stack.enter_context(connect("/icubSim/left_arm", carrier="tcp", network=network))
        time.sleep(0.1)
        forces = Forces("/icubSim/left_arm/analog:o", network=network)
        stack.callback(forces.close)
        guard = MotionGuard(board, "/icubSim/left_arm", clock=time, report=print, contacts=ContactWatch(board, forces))
        part = Part("left_arm", board, time, guard)
        assert part.move([-5.0, 60.0, 90.0], [0, 2, 3], speed=60.0).reached
        yield part


@simulated
@pytest.mark.parametrize(("speed", "rest"), [(10.0, 4.0), (60.0, 0.5)])
def test_arm_that_runs_into_the_body_is_stopped(arm: Part, speed: float, rest: float):
    """Whether it comes slowly or fast, it is named within 0.8 deg of where it touches, 4.9 deg, and comes to rest."""
    with pytest.raises(GuardError, match=r"l_shoulder_roll .* is in contact with an obstacle"):
        arm.move([0.0], [1], speed=speed)
    assert arm.board.encoder(1) > 4.1
    arm.clock.sleep(2.0)
    assert np.abs(arm.board.encoder_speeds()[:7]).max() < 1.0
    assert arm.board.encoder(1) > rest


@simulated
def test_arm_that_moves_fast_and_stops_at_once_is_not_stopped_by_the_guard(arm: Part):
    """All of its joints together, at their full speed, and a stop in the middle."""
    joints = [0, 1, 2, 3, 4, 5, 6]
    far = [arm.within(joint, 0.6) for joint in joints]
    arm.board.set_reference_speeds([70.0] * 7, joints)  # on its way a joint is nearly twice as fast
    for targets in (far, arm.home[joints], far):
        arm.board.position_move(targets, joints)
        arm.wait(0.4)
        arm.board.stop()
        arm.wait(0.4)
    assert arm.move(arm.home[joints], joints, speed=70.0).reached


STRIKES = '''"""An arm that runs into the robot."""
from rtf.robot_testing import RobotTest, Safety
class Strikes(RobotTest):
    """Bends the elbow, and brings the arm to the hip."""
    safety = Safety.MOTION
    def run(self) -> None:
        """Move."""
        part = self.open_part("left_arm")
        part.move([-5.0, 60.0, 90.0], [0, 2, 3], speed=60.0)
        part.move([0.0], [1])
'''
BARE = '''"""A board without a sensor."""
from rtf.bottle import Property
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.periodic_thread import PeriodicThread
from rtf.robot.server.control_board import ControlBoardServer
from rtf.robot_testing import RobotTest, Safety
class Bare(RobotTest):
    """Opens it."""
    safety = Safety.MOTION
    def _ask_for_permission(self) -> None:
        """It is no robot."""
    def run(self) -> None:
        """Open it."""
        board = FakeBoard("fake", network=self.network)
        board.open(Property.parse("(GENERAL (Joints 3))"))
        self.add_cleanup(board.close)
        for name in ("head", "left_leg"):
            server = ControlBoardServer(board, f"/bare/{name}", network=self.network)
            self.add_cleanup(server.close)
            self.add_cleanup(PeriodicThread(server, name=name, report=self.report).stop)
            self.open_part(name).wait(0.1)
'''
SUITE = """<suite name="s"><fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names"> <parameter name="parts">left_arm</parameter> simulator </fixture>
<test name="strikes"> strikes.py </test>
</suite>"""


@simulated
def test_failure_keeps_what_the_sensor_sent(tmp_path):
    """Numbers, stamps and all six values, up to the contact; what came while the arm was put back is not there."""
    write_files(tmp_path, {"suite.xml": SUITE, "strikes.py": STRIKES})
    outcome = run_command(tmp_path, "--suite", "suite.xml", limit=120.0)
    assert outcome.verdict("strikes") is Verdict.FAILED, outcome.detail("strikes")
    assert "is in contact with an obstacle" in outcome.detail("strikes")
    (kept,) = [one for one in outcome.of(SeriesRecorded) if one.name == "before the end: /icubSim/left_arm/analog:o"]
    with np.load(outcome.folder / kept.path) as series:
        assert set(np.diff(series["number"])) == {1.0}
        assert np.diff(series["time"]) == pytest.approx(0.01)
        forces = np.stack([series[f"force_{axis}"] for axis in "xyz"], axis=1)
        assert {"torque_x", "torque_y", "torque_z"} <= set(series)
    assert np.linalg.norm(forces[-1] - forces[-21]) > 15.0
    assert np.linalg.norm(forces[-30] - forces[-50]) < 5.0


def test_limb_without_a_sensor_is_told_once_and_other_parts_are_not(tmp_path):
    """It is no error."""
    write_files(
        tmp_path,
        {
            "suite.xml": '<suite name="s"><fixture name="names"> yarpserver </fixture>'
            '<test name="bare"> <parameter name="robot">bare</parameter> bare.py </test></suite>',
            "bare.py": BARE,
        },
    )
    outcome = run_command(tmp_path, "--suite", "suite.xml", limit=60.0)
    assert outcome.verdict("bare") is Verdict.PASSED, outcome.detail("bare")
    assert said(outcome, "bare").count("not watched for contacts") == 1
    assert "/bare/left_leg is not watched for contacts: " in said(outcome, "bare")
