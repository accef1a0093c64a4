"""Contacts: a joint that hits an obstacle is stopped and named, a free motion is not, and the forces are recorded."""

from __future__ import annotations

import sys
import threading
from contextlib import ExitStack
from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader

from harness import run_command, write_files
from icub import ICUB
from robot_outcomes import said
from rtf import clock
from rtf.bottle import Property
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.types import VECTOR
from rtf.robot.boards.client import connect
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.model.file import ForceTorque
from rtf.robot.network.outlets import PipelinedOutlets
from rtf.robot_testing.guard.contacts import ContactWatch, Forces, NoForcesError, force_port
from rtf.robot_testing.guard.limits import GuardError, Limits
from rtf.robot_testing.guard.motion_guard import MotionGuard
from rtf.robot_testing.guard.reactions import BACK
from rtf.robot_testing.motion.part import Part
from rtf.simulator.robot import SimulatedRobot
from rtf.testing.events import Attached, SeriesRecorded
from rtf.testing.verdict import Verdict

from ...robot.sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import AxisSelection

SENSOR = "/fake/left_arm/analog:o"
WEIGHT = (0.0, 0.0, 20.0)


class FastBoard(FakeBoard):
    """A board whose second joint reports any speed (deg/s).

    ``noise`` is added to all speeds; ``frozen``: encoders do not move.
    """

    speed = noise = 0.0
    frozen = False

    def __init__(self, name: str, *, network: Network) -> None:
        super().__init__(name, network=network)
        self.released: list[AxisSelection] = []
        self._random = np.random.default_rng(1)

    def set_control_modes(self, modes: ControlMode | Sequence[ControlMode], joints: AxisSelection = None) -> None:
        """See IControlMode."""
        if list(np.atleast_1d(modes)) == [ControlMode.IDLE] * 2:
            self.released.append(joints)
        super().set_control_modes(modes, joints)

    def fill_state(self, state: ExtendedState) -> float:
        """See IStateSource."""
        time = super().fill_state(state)
        if self.frozen:
            state.joint_positions[:] = state.joint_velocities[:] = 0.0
        state.joint_velocities[1] = self.speed
        state.joint_velocities += self._random.normal(0.0, self.noise, len(state.joint_velocities))
        return time


class Limb:
    """An arm of three joints, its force-torque sensor, and a guard that watches both, in steps of 10 ms."""

    def __init__(self, stack: ExitStack) -> None:
        self.network = Network(LocalNames())
        self.time = stack.enter_context(clock.use(ManualClock()))
        self.device = FastBoard("fake", network=self.network)
        self.device.open(Property.parse("(GENERAL (Joints 3))"))
        stack.callback(self.device.close)
        self.server = ControlBoardServer(
            self.device, "/fake/left_arm", network=self.network, outlets=PipelinedOutlets()
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
        """Return a guard of the arm."""
        return MotionGuard(
            self.board,
            "/fake/left_arm",
            clock=self.time,
            report=self.said.append,
            limits=limits,
            contacts=ContactWatch(self.board, self.forces, ICUB, "left_arm"),
        )

    def step(
        self, force: tuple[float, ...] = WEIGHT, *, steps: int = 1, numbers: int = 6, stamped: bool = True
    ) -> None:
        """Publish forces and states, and let the guard check them."""
        for _ in range(steps):
            self.time.sleep(0.01)
            self.feel(force, numbers=numbers, at=self.time.now() if stamped else None)
            self.show()
            self.guard.watch()

    def feel(self, force: tuple[float, ...], *, numbers: int = 6, at: float | None) -> None:
        """Publish a force with this stamp; None: without a stamp."""
        values = np.zeros(numbers)
        values[:3] = force
        self.sensor.write(values, VECTOR, envelope="" if at is None else f"{self.sent} {at:.6f}")
        self.sent += 1

    def show(self) -> None:
        """Publish the state of the board."""
        self.server.publish(self.time.now())
        self.server.settle()


@pytest.fixture
def limb() -> Iterator[Limb]:
    """The arm after a second of free motion."""
    with ExitStack() as stack:
        limb = Limb(stack)
        limb.step(steps=100)
        yield limb


def test_a_sudden_force_stops_all_joints(limb: Limb):
    """The message has joint, part, sensor, force and limit; the named joint is the fastest. It goes back."""
    limb.board.set_reference_speeds([20.0, 20.0], [0, 2])
    limb.board.position_move([50.0, 90.0], [0, 2])
    limb.step(steps=120)
    with pytest.raises(
        GuardError,
        match=r"joint\d \(/fake/left_arm joint \d\) is in contact with an obstacle; "
        r"/fake/left_arm/analog:o shows at least \d\d N of contact within 0.2 s, more than 15 N; "
        r"all joints of the part were stopped",
    ) as caught:
        limb.step((60.0, 0.0, 20.0), steps=20)
    assert caught.value.joint in (0, 2)
    touched = limb.board.encoders()
    limb.step(steps=80)
    assert touched[[0, 2]] - limb.board.encoders()[[0, 2]] == pytest.approx([BACK, BACK], abs=0.01)


def test_a_force_on_a_resting_part_has_two_possible_causes(limb: Limb):
    """The named joint is the one farthest from its target, and the message does not claim an obstacle."""
    limb.device.frozen = True
    limb.board.position_move([50.0], [2])
    with pytest.raises(GuardError, match="is at rest by its encoder, but in contact") as caught:
        limb.step((60.0, 0.0, 20.0), steps=20)
    assert caught.value.joint == 2


def test_a_slow_force_is_no_contact(limb: Limb):
    """A load that is put on, or the drift of a sensor: the limit is 15 N within a fifth of a second."""
    for force in np.arange(0.0, 100.0, 0.6):
        limb.step((float(force), 0.0, 20.0))


def test_the_inertial_force_of_an_acceleration_is_no_contact(limb: Limb):
    """A load of 2 kg that reaches 60 deg/s in 10 ms causes about this force."""
    for speed, force in ((30.0, 30.0), (60.0, 30.0), (60.0, 0.0), (60.0, 0.0), (30.0, -30.0), (0.0, -30.0)):
        limb.device.speed = speed
        limb.step((force, 0.0, 20.0))
    limb.step(steps=30)


@pytest.mark.parametrize("begin", np.arange(0.0, 0.01, 0.001))
def test_a_short_burst_of_motor_torque_is_no_contact(limb: Limb, begin: float):
    """A full motor torque of 20 ms shows in two or three messages, and as a slope of the states."""
    limb.guard = limb.watched(Limits(speed=np.inf))
    limb.step(steps=30)
    inertia, rate = 20.0 / 9.81 * 0.3, 6000.0
    for elapsed in np.arange(0.0, 0.3, 0.01):
        pushed = min(max(float(elapsed) - begin, 0.0), 0.02)
        limb.device.speed = rate * pushed
        limb.step((inertia * np.radians(rate) * (0.0 < pushed < 0.02), 0.0, 20.0))


def test_noise_of_the_speeds_hides_no_contact(limb: Limb):
    """A noise of 6 deg/s would explain 60 N. The reduced sensitivity is reported once."""
    limb.device.noise = 6.0
    limb.step(steps=200)
    (said,) = limb.said
    assert said.startswith("/fake/left_arm is watched for contacts with less sensitivity: the noise of its speeds")
    with pytest.raises(GuardError, match="in contact"):
        limb.step((40.0, 0.0, 20.0), steps=20)


def test_a_single_wrong_message_is_no_contact(limb: Limb):
    """Real sensors have spikes and values that are not finite."""
    for wrong in ((500.0, 0.0, 0.0), (np.nan,) * 3):
        limb.step(wrong)
        limb.step(steps=30)


def test_a_sensor_without_finite_values_is_reported(limb: Limb):
    """After a second it is reported, once, and the other limits are still watched."""
    limb.step((np.nan,) * 3, steps=90)
    assert limb.said == []
    limb.step((np.nan,) * 3, steps=30)
    assert limb.said == [
        f"/fake/left_arm is not watched for contacts: the values of {SENSOR} are not finite",
    ]
    limb.step((np.nan,) * 3, steps=150)
    assert len(limb.said) == 1


def test_speeds_that_are_not_finite_cause_no_contact(limb: Limb):
    """After a second it is reported that contacts cannot be detected."""
    guard = limb.guard = limb.watched(Limits(speed=np.inf))
    limb.device.speed = np.nan
    limb.step(steps=90)
    assert limb.said == []
    limb.step(steps=30)
    assert limb.said == [f"{guard.name} is not watched for contacts: positions or speeds of its joints are not finite"]


def test_contacts_are_detected_after_a_clock_was_set_back(limb: Limb):
    """Messages with earlier stamps count like those before."""
    limb.time.time -= 50.0
    limb.step(steps=100)
    with pytest.raises(GuardError, match="in contact"):
        limb.step((60.0, 0.0, 20.0), steps=20)


def test_the_end_of_a_contact_is_no_second_contact(limb: Limb):
    """A limb that hits, presses and is released has had one contact; another hit is stopped again."""
    for _ in range(2):
        with pytest.raises(GuardError):
            limb.step((60.0, 0.0, 20.0), steps=20)
        limb.step((60.0, 0.0, 20.0), steps=50)
        limb.step(steps=50)


def test_excluded_joints_are_not_stopped(limb: Limb):
    """They are idle, and a board may refuse the command."""
    limb.guard.exclude(1, "it does not obey")
    with pytest.raises(GuardError):
        limb.step((60.0, 0.0, 20.0), steps=20)
    assert limb.device.released == [[0, 2]]


def test_without_a_limit_no_contact_is_detected(limb: Limb):
    """For tests in which joints fall on purpose."""
    limb.guard = limb.watched(Limits(contact=None))
    limb.step((60.0, 0.0, 20.0), steps=20)


@pytest.mark.parametrize(
    ("sent", "said_of_it"),
    [({"numbers": 3}, "3 numbers, not the 6 of a force-torque sensor"), ({"stamped": False}, "no stamps")],
)
def test_a_port_that_sends_no_forces_is_reported_once(limb: Limb, sent: dict[str, Any], said_of_it: str):
    """The part does not fail because of an unsuitable sensor."""
    limb.step(steps=10, **sent)
    assert limb.said == [f"/fake/left_arm is not watched for contacts: {SENSOR} sends {said_of_it}"]


def test_a_silent_sensor_is_reported_once(limb: Limb):
    """The report shows that contacts were not detected from then on."""
    for _ in range(150):
        limb.time.sleep(0.01)
        limb.server.publish(limb.time.now())
        limb.server.settle()
        limb.guard.watch()
    assert limb.said == [f"/fake/left_arm is not watched for contacts: nothing has come from {SENSOR} for 1 s"]


def test_forces_and_states_are_matched_by_their_stamps(limb: Limb):
    """A force is evaluated when the states of its time have arrived."""
    limb.device.speed = 60.0
    for number in range(4):
        at = limb.time.now() + 0.05 + 0.01 * number
        limb.sensor.write(np.array([40.0, 0, 20, 0, 0, 0]), VECTOR, envelope=f"{limb.sent} {at:.6f}")
    limb.guard.watch()


def test_a_force_waits_for_late_states(limb: Limb):
    """States may be late on a busy machine; then they explain the force."""
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


def test_the_motion_in_a_gap_of_the_states_is_unknown(limb: Limb):
    """A force in a gap is no contact; a contact that lasts is detected after the gap."""
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


def test_many_missing_states_are_reported_once(limb: Limb):
    """The report shows that contacts may be detected late, or not at all."""
    for number in range(300):
        limb.time.sleep(0.01)
        limb.feel(WEIGHT, at=limb.time.now())
        if number % 5 < 2:
            limb.show()
        limb.guard.watch()
    assert len(limb.said) == 1
    assert "is watched for contacts with less sensitivity: for 1 s too many of its states were missing" in limb.said[0]


def test_a_part_uses_the_limits_that_its_guard_has_read(limb: Limb):
    """Each request is one for each joint, so none is repeated when a part is opened."""
    limb.device.limits = limb.device.velocity_limits = None  # type: ignore[method-assign, assignment]
    part = Part("left_arm", limb.board, limb.time, limb.guard)
    assert part.high.tolist() == [high for _, high in limb.guard.snapshot.limits]
    assert part.fastest.tolist() == limb.guard.fastest.tolist()


def test_messages_may_arrive_during_a_check(limb: Limb):
    """They arrive in another thread, at any time."""
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


def test_a_missing_sensor_is_reported():
    """With its name."""
    with pytest.raises(NoForcesError, match="/nobody/left_arm/analog:o"):
        Forces("/nobody/left_arm/analog:o", network=Network(LocalNames()))


def test_the_model_says_which_parts_have_sensors():
    """The outermost of the sensor's parts, whatever its port is called; one without a weight cannot be judged."""
    assert force_port(ICUB, "/icub/right_leg") == "/icub/right_leg/analog:o"
    assert force_port(ICUB, "/icub/head") is force_port(ICUB, "/icub/torso") is None
    wrist = ForceTorque(link="l_hand", port="wrist", weight=5.0, parts=["torso", "head"])
    sensors = msgspec.structs.replace(ICUB.sensors, force_torque={"wrist_ft": wrist})
    robot = replace(ICUB, sensors=sensors)
    assert force_port(robot, "/bot/head") == "/bot/wrist/analog:o"
    assert force_port(robot, "/bot/torso") is force_port(robot, "/bot/right_leg") is None


# On the simulated robot ------------------------------------------------------------------------------------------

simulated = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture
def arm(tmp_path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Part]:
    """The left arm of a simulated robot in lockstep, with a guard, and with its elbow bent."""
    monkeypatch.setenv("YARP_RUNTIME_DIR", str(tmp_path))
    network = Network(LocalNames())
    with ExitStack() as stack:
        stack.enter_context(SimulatedRobot(ICUB, network=network, parts=("left_arm",), lockstep=True))
        time = stack.enter_context(clock.use(LockstepClock("/clock", "test", network=network)))
        stack.callback(time.close)
        board = stack.enter_context(connect("/icubSim/left_arm", carrier="tcp", network=network))
        time.sleep(0.1)
        forces = Forces("/icubSim/left_arm/analog:o", network=network)
        stack.callback(forces.close)
        watch = ContactWatch(board, forces, ICUB, "left_arm")
        guard = MotionGuard(board, "/icubSim/left_arm", clock=time, report=print, contacts=watch)
        part = Part("left_arm", board, time, guard)
        assert part.move([-5.0, 60.0, 90.0], [0, 2, 3], speed=60.0).reached
        yield part


@simulated
@pytest.mark.parametrize(("speed", "rest"), [(10.0, 4.0), (60.0, 0.5)])
def test_an_arm_that_hits_the_body_is_stopped(arm: Part, speed: float, rest: float):
    """At low and at high speed it stops within 0.8 deg of the contact at 4.9 deg, and comes to rest."""
    with pytest.raises(GuardError, match=r"l_shoulder_roll .* is in contact with an obstacle"):
        arm.move([0.0], [1], speed=speed)
    assert arm.board.encoder(1) > 4.1
    arm.clock.sleep(2.0)
    assert np.abs(arm.board.encoder_speeds()[:7]).max() < 1.0
    assert arm.board.encoder(1) > rest


@simulated
def test_a_fast_free_arm_is_not_stopped_by_the_guard(arm: Part):
    """All joints together at full speed, with a sudden stop halfway."""
    joints = [0, 1, 2, 3, 4, 5, 6]
    far = [arm.within(joint, 0.6) for joint in joints]
    arm.board.set_reference_speeds([60.0] * 7, joints)  # on its way a joint is twice as fast; the limit is 150
    for targets in (far, arm.home[joints], far):
        arm.board.position_move(targets, joints)
        arm.wait(0.4)
        arm.board.stop()
        arm.wait(0.4)
    assert arm.move(arm.home[joints], joints, speed=60.0).reached


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
from rtf.robot.publishing import PeriodicPublishing
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot_testing import RobotTest, Safety
class Bare(RobotTest):
    """Opens it."""
    safety = Safety.MOTION
    def setup(self) -> None:
        """Ask nobody: it is no robot."""
        self._may_move = True
        super().setup()
    def run(self) -> None:
        """Open it."""
        board = FakeBoard("fake", network=self.network)
        board.open(Property.parse("(GENERAL (Joints 3))"))
        self.add_cleanup(board.close)
        for name in ("head", "left_leg"):
            server = ControlBoardServer(board, f"/bare/{name}", network=self.network)
            self.add_cleanup(server.close)
            self.add_cleanup(PeriodicPublishing(server, name=name, report=self.report).stop)
            self.open_part(name).wait(0.1)
'''
SUITE = """<suite name="s"><fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names"> <parameter name="parts">left_arm</parameter> simulator </fixture>
<test name="strikes"> strikes.py </test>
</suite>"""


@simulated
def test_a_failure_has_the_recorded_forces(tmp_path):
    """Numbers, stamps and all six values up to the contact, without those of the way back."""
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
    (attached,) = [one for one in outcome.of(Attached) if one.name == "before the end - left_arm.mcap"]
    with (outcome.folder / attached.path).open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics == {"/left_arm", "/icubSim/left_arm/analog:o"}
    assert np.linalg.norm(forces[-1] - forces[-21]) > 15.0
    assert np.linalg.norm(forces[-30] - forces[-50]) < 5.0


def test_a_limb_without_a_sensor_is_reported_once(tmp_path):
    """Other parts without a sensor are not reported, and neither is an error."""
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
