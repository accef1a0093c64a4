"""The mechanics of the robot: motion, weight, contacts, and what its sensors measure of them."""

from __future__ import annotations

import math
from importlib.util import find_spec

import numpy as np
import pytest

from icub import AXES, INDEX, build_icub
from rtf.robot.model.engine import mujoco
from rtf.simulator.plant import GRAVITY, STOP, Options, Plant

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)

#: What a limb's sensor must carry: the link from which on.
FURTHER_LINKS = {
    "l_arm_ft_sensor": "l_upper_arm",
    "r_arm_ft_sensor": "r_upper_arm",
    "l_leg_ft_sensor": "l_hip_3",
    "r_leg_ft_sensor": "r_hip_3",
    "l_foot_ft_sensor": "l_foot",
    "r_foot_ft_sensor": "r_foot",
}


@pytest.fixture(scope="module")
def robot() -> Plant:
    """A robot that no test changes."""
    return build_icub()


@pytest.fixture(scope="module")
def ideal() -> Plant:
    """A robot without friction, damping and contacts that no test changes."""
    return build_icub(Options(friction=False, damping=False, collision="none"))


class Servo:
    """Holds all axes: gravity is known, friction is integrated, the rest is a spring and a damper for each axis.

    It works every other step, which is quick and still far from unstable.
    """

    STEPS = 2

    def __init__(self, robot: Plant, frequency: float = 20.0) -> None:
        self.robot = robot
        self.data = robot.data()
        omega = 2 * math.pi * frequency
        inertia = robot.axis_inertia(self.data)
        self.stiffness, self.damping = inertia * omega**2, 2 * inertia * omega
        self.share = omega / 8 * self.STEPS * robot.model.opt.timestep  # of the error that is integrated in a step
        self.integral = np.zeros(len(AXES))
        self.target = robot.home_axes.copy()
        self.touched = 0

    def reset(self) -> None:
        """Return to home at once."""
        self.robot.reset(self.data)
        self.target[:] = self.robot.home_axes
        self.integral[:] = 0

    def step(self) -> None:
        """Simulate two milliseconds."""
        data = self.data
        error = self.target - data.actuator_length
        self.integral = np.clip(self.integral + self.share * error, -0.02, 0.02)
        data.ctrl[:] = self.stiffness * (error + self.integral) - self.damping * data.actuator_velocity
        data.ctrl += self.robot.axis_torques(data.qfrc_bias)
        mujoco().mj_step(self.robot.model, data, self.STEPS)
        self.touched += data.ncon

    def settle(self, seconds: float) -> None:
        """Hold all axes for some time."""
        for _ in range(round(seconds / self.robot.model.opt.timestep / self.STEPS)):
            self.step()

    def sweep(self, axis: int, angle: float, speed: float) -> None:
        """Move one axis to an angle (rad) at a speed (rad/s)."""
        stride = speed * self.STEPS * self.robot.model.opt.timestep
        begin = self.target[axis]
        for place in np.linspace(begin, angle, 2 + int(abs(angle - begin) / stride)):
            self.target[axis] = place
            self.step()


def posed(robot: Plant, **degrees: float):
    """Give a state in which some axes (deg) are not at home."""
    axes = robot.home_axes.copy()
    for name, angle in degrees.items():
        axes[INDEX[name]] = math.radians(angle)
    data = robot.data()
    data.qpos[:] = robot.pose(axes)
    mujoco().mj_forward(robot.model, data)
    return data


def touching(robot: Plant, data) -> set[frozenset[str]]:
    """Name the pairs of links that touch."""
    links = [robot.model.body(body).name for body in robot.model.geom_bodyid]
    return {frozenset((links[contact.geom1], links[contact.geom2])) for contact in data.contact[: data.ncon]}


def balanced(robot: Plant, data) -> None:
    """Set the torques that exactly carry the robot's weight."""
    data.ctrl[:] = robot.axis_torques(data.qfrc_bias)
    mujoco().mj_forward(robot.model, data)


class TestMovement:
    """Every axis can be moved."""

    def test_every_axis_alone_reaches_both_limits_without_touching_anything(self, robot: Plant):
        """From home, at 120 degrees a second, within 0.06 degrees or on the stop behind it, all 106 of them."""
        servo = Servo(robot)
        short = {}
        for index, axis in enumerate(AXES):
            for limit in (axis.minimum, axis.maximum):
                servo.reset()
                servo.sweep(index, math.radians(limit), math.radians(120))
                servo.settle(0.2)
                error = abs(math.degrees(servo.data.actuator_length[index]) - limit)
                if error > STOP + 0.06 or servo.touched:
                    short[axis.name, limit] = (error, servo.touched)
                servo.touched = 0
        assert short == {}

    @pytest.mark.parametrize("name", ["l_elbow", "r_knee", "eyes_vergence", "l_pinky", "torso_yaw"])
    def test_stop_holds_against_the_whole_drive(self, robot: Plant, name):
        """Pushed with all the drive can give, an axis goes no more than 3 degrees beyond its stop."""
        servo, index = Servo(robot), INDEX[name]
        ratio = robot.model.actuator_gear[index, 0]
        push = AXES[index].max_torque
        servo.sweep(index, math.radians(AXES[index].maximum), math.radians(100))
        beyond = []
        for _ in range(200):
            servo.target[index] = servo.data.actuator_length[index] + push / servo.stiffness[index]
            servo.step()
            beyond.append(math.degrees(servo.data.actuator_length[index]) - AXES[index].maximum)
        assert 0 < beyond[-1] < 3 * ratio
        assert max(beyond) < 3 * ratio

    def test_moving_all_axes_at_once_stays_finite(self, robot: Plant):
        """Sinusoidal torques on all axes, with contacts, for a second."""
        servo = Servo(robot)
        low, high = (np.radians([getattr(axis, end) for axis in AXES]) for end in ("minimum", "maximum"))
        for step in range(500):
            wave = np.sin(2 * math.pi * 0.5 * step * 2e-3 + np.arange(53))
            servo.target[:] = np.clip(robot.home_axes + 0.35 * wave, low, high)
            servo.step()
        assert np.isfinite(servo.data.qpos).all()
        assert np.abs(servo.data.actuator_length - servo.target).max() < math.radians(10)


class TestDynamics:
    """The mechanics are those of theory."""

    def test_torques_of_a_held_pose_are_gravitys(self, ideal: Plant):
        """At rest, the torques of the drives are those of inverse dynamics."""
        servo = Servo(ideal)
        servo.target += np.radians(np.linspace(1, 8, 53))
        servo.settle(1.5)
        given = servo.data.actuator_force.copy()
        still = mujoco().MjData(ideal.model)
        still.qpos[:] = servo.data.qpos
        mujoco().mj_inverse(ideal.model, still)
        np.testing.assert_allclose(given, ideal.axis_torques(still.qfrc_inverse), atol=1e-4)
        assert np.abs(given).max() > 3

    def test_energy_is_kept_in_a_free_swing(self, ideal: Plant):
        """Without friction and stops, kinetic and potential energy add up to a constant."""
        swinging = build_icub(Options(friction=False, damping=False, collision="none", timestep=2e-4))
        swinging.model.jnt_limited[:] = 0
        swinging.model.tendon_limited[:] = 0
        swinging.model.opt.enableflags |= int(mujoco().mjtEnableBit.mjENBL_ENERGY)
        data = swinging.data()
        start = data.energy.sum()
        kinetic, drift = 0.0, 0.0
        for _ in range(1500):
            mujoco().mj_step(swinging.model, data)
            kinetic = max(kinetic, data.energy[1])
            drift = max(drift, abs(data.energy.sum() - start))
        assert kinetic > 3
        assert drift < 0.01 * kinetic

    def test_same_torques_make_the_same_movement_to_the_bit(self, robot: Plant):
        """A run can be repeated."""
        states = []
        for _ in range(2):
            data = robot.data()
            for step in range(300):
                data.ctrl[:] = np.sin(step / 20 + np.arange(53)) * 0.2
                mujoco().mj_step(robot.model, data)
            states.append((data.qpos.tobytes(), data.qvel.tobytes(), data.sensordata.tobytes()))
        assert states[0] == states[1]


class TestEyes:
    """Version and vergence."""

    @pytest.mark.parametrize(("axis", "signs"), [("eyes_version", (1, 1)), ("eyes_vergence", (1, -1))])
    def test_torque_moves_its_axis_and_not_the_other(self, ideal: Plant, axis, signs):
        """Version turns both eyes alike, vergence turns them in opposite directions; neither changes the other."""
        data = posed(ideal, eyes_vergence=20)
        other = {"eyes_version": "eyes_vergence", "eyes_vergence": "eyes_version"}[axis]
        before = data.actuator_length.copy()
        # The whole robot falls meanwhile; against that the weight of 300 grams of eyes does nothing, but it is carried.
        for _ in range(20):
            data.ctrl[:] = ideal.axis_torques(data.qfrc_bias)
            data.ctrl[INDEX[axis]] += 0.01
            mujoco().mj_step(ideal.model, data)
        moved = data.actuator_length - before
        assert moved[INDEX[axis]] > math.radians(0.2)
        assert abs(moved[INDEX[other]]) < 0.02 * moved[INDEX[axis]]
        pans = [data.joint(f"eyes_{side}_pan").qvel[0] for side in ("left", "right")]
        assert tuple(np.sign(pans)) == signs

    @pytest.mark.parametrize(
        ("axis", "degrees", "left", "right"),
        [("eyes_version", 20, 20, 20), ("eyes_vergence", 20, 10, -10), ("eyes_tilt", 20, 0, 0)],
    )
    def test_angles_of_the_axes_are_angles_of_the_view(self, robot: Plant, axis, degrees, left, right):
        """Forward is -x: positive version looks right (+y), vergence inwards, tilt up."""
        data = posed(robot, **{axis: degrees})
        for name, wanted in (("eyes_left", left), ("eyes_right", right)):
            view = -data.camera(name).xmat.reshape(3, 3)[:, 2]
            assert math.degrees(math.atan2(view[1], -view[0])) == pytest.approx(wanted, abs=0.1)
            tilt = degrees if axis == "eyes_tilt" else 0
            assert math.degrees(math.asin(view[2])) == pytest.approx(tilt, abs=0.1)

    def test_cameras_are_where_eyes_are(self, robot: Plant):
        """Left is -y; they are 68 mm apart, and upright."""
        data = robot.data()
        left, right = data.camera("eyes_left"), data.camera("eyes_right")
        np.testing.assert_allclose(right.xpos - left.xpos, [0, 0.068, 0], atol=1e-3)
        np.testing.assert_allclose(left.xmat.reshape(3, 3)[:, 1], [0, 0, 1], atol=1e-3)


class TestFingers:
    """The hands' own axes."""

    @pytest.mark.parametrize("side", ["l", "r"])
    @pytest.mark.parametrize("finger", ["index_proximal", "middle_distal", "pinky"])
    def test_fingers_close_towards_the_palm(self, robot: Plant, side, finger):
        """With a growing angle the tip comes to the hand's -y side, on both hands."""
        link = f"{side}_{finger}_link"
        tips = []
        for share in (0.0, 0.5):
            data = posed(robot, **{f"{side}_{finger}": share * AXES[INDEX[f"{side}_{finger}"]].maximum})
            hand = data.body(f"{side}_hand")
            geom = data.geom(robot.model.body(link).geomadr[0])
            tips.append((geom.xpos - hand.xpos) @ hand.xmat.reshape(3, 3)[:, 1])
        assert tips[1] < tips[0] - 0.005

    @pytest.mark.parametrize("side", ["l", "r"])
    def test_stretched_fingers_reach_forward_of_the_hand(self, robot: Plant, side):
        """At zero the fingers' tips are the far end of the arm."""
        data = robot.data()
        elbow = data.body(f"{side}_forearm").xpos
        far = [np.linalg.norm(data.body(f"{side}_{link}").xpos - elbow) for link in ("hand", "index_distal_link")]
        assert far[1] > far[0] + 0.08


class TestContacts:
    """What can touch."""

    @pytest.mark.parametrize(
        ("pose", "pair"),
        [
            ({"l_hip_pitch": 100, "l_hip_roll": 0, "l_shoulder_pitch": 0, "l_shoulder_roll": 5}, ("l_upper_leg", "l_")),
            ({"r_shoulder_pitch": -95, "r_shoulder_roll": 0, "r_shoulder_yaw": 45, "r_elbow": 100}, ("head", "r_")),
            ({f"{side}_{joint}": angle for side in "lr" for joint, angle in (
                ("shoulder_pitch", -45), ("shoulder_roll", 10), ("shoulder_yaw", 55), ("elbow", 60)
            )}, ("l_", "r_")),
            ({"l_hip_roll": -15, "r_hip_roll": -15}, ("l_", "r_")),
        ],
        ids=["arm and thigh", "hand and head", "both hands", "both legs"],
    )  # fmt: skip
    def test_limbs_that_meet_touch(self, robot: Plant, pose, pair):
        """Collisions of the robot with itself are found."""
        pairs = touching(robot, posed(robot, **pose))
        assert any(
            (one.startswith(pair[0]) and two.startswith(pair[1]))
            or (two.startswith(pair[0]) and one.startswith(pair[1]))
            for one, two in map(tuple, pairs)
        ), pairs

    def test_an_arm_does_not_go_through_a_thigh(self, robot: Plant):
        """The leg comes up under the forearm, and is stopped by it."""
        servo = Servo(robot, frequency=5)
        for name, angle in (("l_shoulder_roll", 10), ("l_shoulder_pitch", -20), ("l_hip_roll", 5)):
            servo.sweep(INDEX[name], math.radians(angle), math.radians(60))
        assert servo.touched == 0
        servo.sweep(INDEX["l_hip_pitch"], math.radians(100), math.radians(60))
        servo.settle(0.5)
        assert servo.touched > 0
        deepest = min(contact.dist for contact in servo.data.contact[: servo.data.ncon])
        assert -0.01 < deepest < 0

    def test_hulls_and_capsules_agree_on_what_touches(self, robot: Plant):
        """In nine of ten poses at random both shapes say the same."""
        hulls = build_icub(Options(collision="hulls"))
        generator = np.random.default_rng(53)
        low, high = (np.radians([getattr(axis, end) for axis in AXES]) for end in ("minimum", "maximum"))
        agreed = touched = 0
        for _ in range(200):
            pose, found = generator.uniform(low, high), []
            for each in (robot, hulls):
                data = mujoco().MjData(each.model)
                data.qpos[:] = each.pose(pose)
                mujoco().mj_fwdPosition(each.model, data)
                found.append(data.ncon > 0)
            agreed += found[0] == found[1]
            touched += found[0]
        assert agreed >= 180
        assert touched >= 20


class TestForceTorque:
    """The six-axis sensors."""

    @pytest.mark.parametrize("name", FURTHER_LINKS)
    def test_force_is_the_weight_of_what_hangs_on_it(self, ideal: Plant, name):
        """At rest the further links pull downwards with their weight, and turn about their centre of mass."""
        data = posed(ideal, l_knee=-40, r_knee=-40, torso_roll=10, l_elbow=80)
        balanced(ideal, data)
        sensor = next(sensor for sensor in ideal.ft_sensors if sensor.name == name)
        site = data.site(name)
        to_world = site.xmat.reshape(3, 3)
        body = ideal.model.body(FURTHER_LINKS[name]).id
        weight = np.array([0, 0, -GRAVITY * ideal.model.body_subtreemass[body]])
        wrench = sensor.read(data.sensordata)
        np.testing.assert_allclose(to_world @ wrench[:3], weight, atol=1e-6)
        lever = data.subtree_com[body] - site.xpos
        np.testing.assert_allclose(to_world @ wrench[3:], np.cross(lever, weight), atol=1e-6)
        np.testing.assert_array_equal(wrench[:3], -data.sensordata[sensor.force])
        np.testing.assert_array_equal(wrench[3:], -data.sensordata[sensor.torque])

    def test_frames_are_the_descriptions(self, ideal: Plant):
        """A sensor's frame is the link's that it names; in the leg that has z downwards, as the sensor is mounted."""
        data = posed(ideal, l_hip_roll=0)
        axis = data.site("l_leg_ft_sensor").xmat.reshape(3, 3)[:, 2]
        np.testing.assert_allclose(axis, [0, 0, -1], atol=1e-9)


class TestInertialUnit:
    """The unit in the head."""

    def test_at_rest_it_feels_gravity_upwards(self, ideal: Plant):
        """The accelerometer reads 0, 0, 9.81, the gyroscope nothing."""
        data = ideal.data()
        balanced(ideal, data)
        np.testing.assert_allclose(data.sensordata[ideal.imus[0].accelerometer], [0, 0, GRAVITY], atol=1e-3)
        np.testing.assert_allclose(data.sensordata[ideal.imus[0].gyroscope], 0, atol=1e-9)

    def test_orientation_turns_the_world_into_what_it_feels(self, ideal: Plant):
        """With the head aslant, gravity and field are those of the world, seen in the sensor's frame."""
        data = posed(ideal, neck_pitch=-30, neck_roll=10, torso_yaw=20)
        balanced(ideal, data)
        rotation = np.zeros(9)
        mujoco().mju_quat2Mat(rotation, data.sensordata[ideal.imus[0].orientation])
        to_sensor = rotation.reshape(3, 3).T
        np.testing.assert_allclose(data.sensordata[ideal.imus[0].accelerometer], to_sensor @ [0, 0, GRAVITY], atol=1e-6)
        np.testing.assert_allclose(
            data.sensordata[ideal.imus[0].magnetometer], to_sensor @ ideal.model.opt.magnetic, atol=1e-12
        )

    def test_gyroscope_feels_the_neck_turn(self, ideal: Plant):
        """Turning the upright head at 1 rad/s is 1 rad/s about the sensor's vertical."""
        data = ideal.data()
        data.qvel[ideal.dofs[INDEX["neck_yaw"]]] = 1.0
        mujoco().mj_forward(ideal.model, data)
        np.testing.assert_allclose(data.sensordata[ideal.imus[0].gyroscope], [0, 0, 1], atol=1e-3)


class TestFaults:
    """Broken mechanics are made in the arrays of the model."""

    def test_jammed_joint_does_not_move(self):
        """Friction beyond what the drive can give holds the joint."""
        robot = build_icub()
        servo, index = Servo(robot), INDEX["l_elbow"]
        robot.model.dof_frictionloss[robot.dofs[index]] = 60
        servo.sweep(index, math.radians(90), math.radians(60))
        assert math.degrees(servo.data.actuator_length[index]) == pytest.approx(45, abs=0.5)

    def test_cut_drive_lets_the_arm_fall_and_still_shows_its_angle(self):
        """Without gain there is no torque, and the encoder still shows the angle."""
        robot = build_icub()
        servo, index = Servo(robot), INDEX["l_shoulder_pitch"]
        robot.model.actuator_gainprm[index, 0] = 0
        servo.target[INDEX["l_shoulder_roll"]] = math.radians(30)
        servo.settle(0.6)
        angle = math.degrees(servo.data.actuator_length[index])
        assert angle > -25
        assert servo.data.actuator_force[index] == 0
