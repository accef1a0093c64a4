"""The elements of the model: actuators, limits, links, and options."""

from __future__ import annotations

import resource
import subprocess
import sys
import textwrap
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest

from icub import AXES, INDEX, build_icub
from rtf.robot.model import engine
from rtf.robot.model.engine import mujoco
from rtf.robot.model.errors import MissingPackageError
from rtf.simulator.plant import STOP, Options, Plant, axis_jacobian

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


@pytest.fixture(scope="module")
def robot() -> Plant:
    """A robot that no test changes."""
    return build_icub()


def saved(robot: Plant) -> bytes:
    """The model as it is written to a file."""
    buffer = np.zeros(mujoco().mj_sizeModel(robot.model), dtype=np.uint8)
    mujoco().mj_saveModel(robot.model, None, buffer)
    return buffer.tobytes()


class TestAxes:
    """The actuators are the axes."""

    def test_actuators_are_the_axes_in_order(self, robot: Plant):
        """Column i of the arrays is axis i."""
        assert robot.model.nu == robot.model.nactuator == robot.model.nv == 53
        assert [robot.model.actuator(index).name for index in range(53)] == [axis.name for axis in AXES]

    def test_lengths_of_the_actuators_are_angles_of_the_axes(self, robot: Plant):
        """A pose made from axes is read back as axes, all different, eyes and fingers included."""
        wanted = (
            np.radians([axis.minimum + 0.3 * (axis.maximum - axis.minimum) for axis in AXES]) + np.arange(53) * 1e-3
        )
        data = robot.data()
        data.qpos[:] = robot.pose(wanted)
        mujoco().mj_forward(robot.model, data)
        np.testing.assert_allclose(data.actuator_length, wanted, atol=1e-12)

    def test_velocities_of_the_actuators_are_the_rates_of_the_angles(self, robot: Plant):
        """The difference of two poses over the time between them is the speed."""
        data = robot.data()
        data.qvel[:] = np.linspace(-1, 1, 53)
        mujoco().mj_forward(robot.model, data)
        before, speed = data.actuator_length.copy(), data.actuator_velocity.copy()
        mujoco().mj_integratePos(robot.model, data.qpos, data.qvel, 1e-6)
        mujoco().mj_forward(robot.model, data)
        np.testing.assert_allclose((data.actuator_length - before) / 1e-6, speed, atol=1e-6)
        np.testing.assert_allclose(robot.jacobian @ data.qvel, speed, atol=1e-12)

    def test_jacobian_is_the_same_in_every_pose(self, robot: Plant):
        """The relation between axes and hinges is linear, so it is computed once."""
        data = robot.data()
        data.qpos[:] += 0.2
        mujoco().mj_forward(robot.model, data)
        np.testing.assert_array_equal(axis_jacobian(robot.model, data), robot.jacobian)

    def test_torque_is_cut_at_what_the_drive_can_give(self, robot: Plant):
        """A commanded torque beyond the limit has the effect of the limit."""
        data = robot.data()
        data.ctrl[:] = 1e6
        mujoco().mj_forward(robot.model, data)
        np.testing.assert_allclose(data.actuator_force, [axis.max_torque for axis in AXES])

    def test_torque_at_an_axis_does_the_axis_work(self, robot: Plant):
        """The power at the axes is that at the hinges, whatever the transmission."""
        data = robot.data()
        data.qvel[:] = np.linspace(-1, 1, 53)
        data.ctrl[:] = np.linspace(0.1, 0.2, 53)
        mujoco().mj_forward(robot.model, data)
        assert data.qfrc_actuator @ data.qvel == pytest.approx(data.ctrl @ data.actuator_velocity)
        np.testing.assert_allclose(robot.axis_torques(data.qfrc_actuator), data.ctrl, atol=1e-12)

    def test_home_is_the_home_of_the_axes(self, robot: Plant):
        """A new state is at home and at rest."""
        data = robot.data()
        np.testing.assert_allclose(np.degrees(data.actuator_length), [axis.home for axis in AXES], atol=1e-9)
        assert not data.qvel.any()
        assert data.time == 0

    def test_dofs_lead_to_the_hinges_of_an_axis(self, robot: Plant):
        """One for a joint, both pans for version and vergence."""
        pans = {int(robot.model.joint(name).dofadr[0]) for name in ("eyes_left_pan", "eyes_right_pan")}
        for axis, dofs in zip(AXES, robot.dofs, strict=True):
            if axis.name in {"eyes_version", "eyes_vergence"}:
                assert set(dofs) == pans
            else:
                assert list(dofs) == [robot.model.joint(axis.name).dofadr[0]]


class TestLimits:
    """Mechanical limits."""

    def test_software_limits_are_within_the_mechanical_ones(self, robot: Plant):
        """The stops are beyond the limits by the documented distance."""
        for index, axis in enumerate(AXES):
            actuator = robot.model.actuator(index)
            place = int(actuator.trnid[0])
            tendon = actuator.trntype[0] == mujoco().mjtTrn.mjTRN_TENDON
            assert (robot.model.tendon_limited if tendon else robot.model.jnt_limited)[place]
            limits = (robot.model.tendon_range if tendon else robot.model.jnt_range)[place]
            low, high = np.degrees(limits) * actuator.gear[0]
            assert low == pytest.approx(axis.minimum - STOP, abs=0.01), axis.name
            assert high == pytest.approx(axis.maximum + STOP, abs=0.01), axis.name

    def test_description_does_not_limit_the_drives(self, robot: Plant):
        """Torques are limited in one place only, the actuators."""
        assert not robot.model.jnt_actfrclimited.any()

    def test_losses_and_rotors_are_those_of_the_axes(self, robot: Plant):
        """Friction and armature of an ordinary joint are the table's; those of a finger count at its axis."""
        elbow, pinky = AXES[INDEX["l_elbow"]], AXES[INDEX["l_pinky"]]
        dof = robot.dofs[INDEX["l_elbow"]]
        assert robot.model.dof_frictionloss[dof] == pytest.approx(elbow.friction)
        assert robot.model.dof_armature[dof] == pytest.approx(elbow.armature)
        assert robot.model.dof_armature[robot.dofs[INDEX["l_pinky"]]] / 9 == pytest.approx(pinky.armature)
        assert robot.model.dof_frictionloss[robot.dofs[INDEX["l_pinky"]]] / 3 == pytest.approx(pinky.friction)

    def test_what_the_eyes_have_adds_up(self, robot: Plant):
        """Version moves two hinges, which share its torque; vergence has all of its torque at each of them."""
        version, vergence = AXES[INDEX["eyes_version"]], AXES[INDEX["eyes_vergence"]]
        pans = robot.dofs[INDEX["eyes_version"]]
        np.testing.assert_allclose(robot.model.dof_armature[pans] * 2, version.armature)
        np.testing.assert_allclose(robot.model.dof_armature[pans] / 2, vergence.armature)
        np.testing.assert_allclose(robot.model.dof_damping[pans] * 2, version.damping)
        np.testing.assert_allclose(robot.model.dof_damping[pans] / 2, vergence.damping)
        np.testing.assert_allclose(robot.model.dof_frictionloss[pans] * 2, version.friction)
        np.testing.assert_allclose(robot.model.dof_frictionloss[pans], vergence.friction)

    def test_inertia_of_an_axis_is_torque_over_acceleration(self):
        """The inertia by which the gains are scaled is that of the dynamics."""
        free = build_icub(Options(friction=False, damping=False, collision="none"))
        data = free.data()
        inertia = free.axis_inertia(data)
        for name in ("l_shoulder_pitch", "eyes_version", "eyes_vergence", "l_pinky", "torso_yaw"):
            index = INDEX[name]
            free.reset(data)
            data.ctrl[:] = free.axis_torques(data.qfrc_bias)
            data.ctrl[index] += 0.01
            mujoco().mj_forward(free.model, data)
            assert (free.jacobian @ data.qacc)[index] == pytest.approx(0.01 / inertia[index], rel=1e-6), name


class TestParts:
    """Links and options."""

    def test_whole_robot_is_there(self, robot: Plant):
        """The root keeps its own weight, and the published 33.06 kg gain only fingers and eyes."""
        assert robot.model.body("root_link").mass[0] == pytest.approx(5.09, abs=0.01)
        added = 2 * 0.106 + 2 * 0.03 + 0.05
        assert robot.model.body_mass.sum() == pytest.approx(33.06 + added, abs=0.02)

    def test_engine_is_set_as_promised(self, robot: Plant):
        """The time step is a millisecond, and damping is integrated implicitly."""
        assert robot.model.opt.timestep == 0.001
        assert robot.model.opt.integrator == mujoco().mjtIntegrator.mjINT_IMPLICITFAST

    def test_near_links_are_left_out_of_collisions(self, robot: Plant):
        """Forearm and upper arm never touch; forearm and thigh may."""
        pairs = {frozenset(divmod(int(pair), 1 << 16)) for pair in robot.model.exclude_signature}
        identity = {name: robot.model.body(name).id for name in ("l_forearm", "l_shoulder_3", "l_upper_leg", "l_hip_1")}
        assert frozenset((identity["l_forearm"], identity["l_shoulder_3"])) in pairs
        assert frozenset((identity["l_hip_1"], identity["l_upper_leg"])) in pairs
        assert frozenset((identity["l_forearm"], identity["l_upper_leg"])) not in pairs

    @pytest.mark.parametrize("collision", ["capsules", "hulls"])
    def test_nothing_touches_at_home(self, collision):
        """There are no contacts in the home pose."""
        assert build_icub(Options(collision=collision)).data().ncon == 0

    def test_without_collisions_nothing_ever_touches(self):
        """With that option no shape collides."""
        model = build_icub(Options(collision="none")).model
        assert not model.geom_contype.any()

    def test_frictionless_robot_has_no_losses(self):
        """Friction and damping can be left out, to check the mechanics against theory."""
        model = build_icub(Options(friction=False, damping=False)).model
        assert not model.dof_frictionloss.any()
        assert not model.dof_damping.any()

    def test_sensors_have_places_of_their_own(self, robot: Plant):
        """Six numbers for each of six force-torque sensors, then the inertial unit; nothing overlaps."""
        assert [sensor.name for sensor in robot.ft_sensors] == [
            f"{side}_{limb}_ft_sensor" for limb in ("arm", "leg", "foot") for side in "lr"
        ]
        (imu,) = robot.imus
        slices = [part for sensor in robot.ft_sensors for part in (sensor.force, sensor.torque)]
        slices += [imu.orientation, imu.gyroscope, imu.accelerometer, imu.magnetometer]
        assert [part.stop - part.start for part in slices] == [3] * 12 + [4, 3, 3, 3]
        assert all(one.stop == next_.start for one, next_ in pairwise(slices))
        assert slices[-1].stop == robot.model.nsensordata


class TestBuilding:
    """Making the model."""

    def test_building_is_quick(self):
        """A simulator has to start in 1.5 s; the time that other processes take is not counted."""

        def seconds() -> float:
            began = resource.getrusage(resource.RUSAGE_THREAD).ru_utime
            build_icub()
            return resource.getrusage(resource.RUSAGE_THREAD).ru_utime - began

        assert any(seconds() < 0.4 for _ in range(3))

    @pytest.mark.parametrize("options", [Options(), Options(cameras=True)], ids=["plain", "cameras"])
    def test_two_builds_are_the_same_to_the_byte(self, options):
        """The saved models of two builds are equal."""
        assert saved(build_icub(options)) == saved(build_icub(options))

    def test_cameras_change_nothing_in_the_mechanics(self, robot: Plant):
        """Visible shapes have no mass and do not collide."""
        seen = build_icub(Options(cameras=True))
        np.testing.assert_array_equal(seen.model.body_mass, robot.model.body_mass)
        np.testing.assert_array_equal(seen.model.body_inertia, robot.model.body_inertia)
        data, other = seen.data(), robot.data()
        for step in range(100):
            data.ctrl[:] = other.ctrl[:] = 0.1 * np.sin(step / 10 + np.arange(53))
            mujoco().mj_step(seen.model, data)
            mujoco().mj_step(robot.model, other)
        np.testing.assert_array_equal(data.qpos, other.qpos)

    def test_engine_is_loaded_when_needed_and_without_a_screen(self):
        """Importing the simulator is cheap; its engine looks for no window system and leaves the environment alone."""
        program = """
            import os, sys
            from rtf.robot.model import engine
            from rtf.simulator import plant
            assert not {"mujoco", "icub_models"} & set(sys.modules)
            before = dict(os.environ)
            engine.mujoco()
            assert "glfw" not in sys.modules and dict(os.environ) == before
        """
        subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=True, timeout=60)

    def test_missing_engine_is_named_with_its_hint(self, monkeypatch):
        """The error has the ``pip install`` line of the missing package."""
        monkeypatch.setitem(sys.modules, "mujoco", None)
        engine.mujoco.cache_clear()
        with pytest.raises(MissingPackageError, match=r"mujoco-core: pip install 'rtf\[sim\]'"):
            build_icub()
        engine.mujoco.cache_clear()
