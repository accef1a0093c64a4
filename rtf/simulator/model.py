"""The mechanics of the simulated iCub: published links and joints, own eyes and fingers, an actuator for each axis.

The robot's root is fixed in the air. Its frame, which is the world's, has x backwards: forward is -x, the robot's left
-y, upwards z.

:func:`build` makes a model whose actuators are the axes of :data:`rtf.simulator.axes.AXES`, in that order:

``data.ctrl``               torque at each axis (Nm), limited to that of the drive
``data.actuator_length``    angle of each axis (rad)
``data.actuator_velocity``  speed of each axis (rad/s)
``data.actuator_force``     torque that the drive gives (Nm)

For most axes that is a joint's own angle; version and vergence of the eyes are tendons, and some fingers have a ratio
between axis and hinge (:mod:`rtf.simulator.fingers`). Users of the arrays above need not know that.

Mechanical faults change arrays of the model at run time:

===================  ==================================================================================================
a jam, stiction      ``model.dof_frictionloss[IcubModel.dofs[i]]``, Nm at the hinge; in a simulation, which has a dry
                     friction of its own (:mod:`rtf.simulator.friction`), what is added to that
viscous friction     ``model.dof_damping[IcubModel.dofs[i]]``
a weak or cut drive  ``model.actuator_gainprm[i, 0]``, 1 when healthy, 0 when cut, -1 when it turns the wrong way. Not
                     the gear: that scales the angle, too
a payload            ``model.body_mass[...]``, and ``data.xfrc_applied`` for a push
===================  ==================================================================================================
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rtf.simulator import collisions, eyes, fingers, model_sensors, scene
from rtf.simulator.axes import AXES, INDEX, Axis
from rtf.simulator.engine import mujoco, robot_description, shared_folder

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.simulator.model_sensors import FtSensor, ImuSensor

TIMESTEP = 1e-3
GRAVITY = 9.81
#: Limits hold within 2 degrees against the whole torque of a drive, and a joint at rest on one is 0.02 degrees beyond.
_LIMIT_SOLREF = (0.004, 1.0)
_LIMIT_SOLIMP = (0.95, 0.99, 0.001, 0.5, 2.0)
#: Distance of the mechanical stops from the limits of the boards, deg of the axis, so that a joint at its limit does
#: not touch a stop. Many joints are at a limit at home, and contacts with stops would make a step half as slow again.
STOP = 0.1
#: Parameters of dry friction: with the engine's defaults a jammed elbow creeps at 24 degrees a second.
_FRICTION_SOLREF = (0.004, 1.0)
_FRICTION_SOLIMP = (0.9995, 0.9995, 0.001, 0.5, 2.0)
#: Strength and dip of the earth's field in Genoa (T); north is where the robot looks.
_MAGNETIC_FIELD = (-2.3e-5, 0.0, -4.2e-5)
_SCHEME = "package://iCub"
#: Elements of a description with the shapes of a link.
_SHAPE = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)

Collision = Literal["capsules", "hulls", "none"]


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a model beyond links and joints."""

    collision: Collision = "capsules"
    cameras: bool = False  # visible covers, a floor and objects; building takes some tenths of a second longer
    friction: bool = True
    damping: bool = True
    timestep: float = TIMESTEP  # s


@dataclass(frozen=True, slots=True)
class IcubModel:
    """A compiled robot, with the indices of its elements. Faults may change the model; see the module."""

    model: Any  # mujoco.MjModel
    home: NDArray[np.float64]  # qpos of the pose without contacts
    home_axes: NDArray[np.float64]  # the same as axes (rad)
    dofs: tuple[NDArray[np.intp], ...]  # the hinge of each axis; for version and vergence the pans of both eyes
    friction: NDArray[np.float64]  # (nv,), dry, Nm at each hinge, as built
    jacobian: NDArray[np.float64]  # (53, nv), in every pose: speeds of the axes = jacobian @ data.qvel
    ft_sensors: tuple[FtSensor, ...]
    imu: ImuSensor
    _forces_to_torques: NDArray[np.float64]

    def data(self) -> Any:
        """Return a new MjData at home and at rest, forwarded."""
        data = mujoco().MjData(self.model)
        self.reset(data)
        return data

    def reset(self, data: Any) -> None:
        """Reset ``data`` to home, at rest, at time 0."""
        mujoco().mj_resetData(self.model, data)
        data.qpos[:] = self.home
        mujoco().mj_forward(self.model, data)

    def pose(self, axes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the qpos of a pose of the 53 axes (rad)."""
        return _pose(self.model, axes)

    def axis_inertia(self, data: Any) -> NDArray[np.float64]:
        """Return the inertia of each axis while all others are free to move, (53,) in kg m2.

        ``data`` must have been forwarded. It depends on the pose; the gains of controllers are scaled with it.
        """
        solved = np.empty_like(self.jacobian)
        mujoco().mj_solveM(self.model, data, solved, self.jacobian)
        inertia: NDArray[np.float64] = 1.0 / np.einsum("ij,ij->i", self.jacobian, solved)
        return inertia

    def axis_torques(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the torques of the axes equivalent to ``forces`` on the degrees of freedom, such as data.qfrc_bias."""
        torques: NDArray[np.float64] = self._forces_to_torques @ forces
        return torques


def axis_jacobian(model: Any, data: Any) -> NDArray[np.float64]:
    """Return the Jacobian of the axes by the degrees of freedom, (53, nv); the same in every pose."""
    moment = np.zeros((model.nu, model.nv))
    mujoco().mju_sparse2dense(moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    return moment


def build(options: Options | None = None) -> IcubModel:
    """Build the model. Two builds with the same options give identical models.

    The message of MissingPackageError says how to install the missing package.
    """
    options = options or Options()
    spec = _described(shapes=options.cameras or options.collision == "hulls")
    _set_engine(spec, options)
    published = list(spec.geoms)
    eyes.add_eyes(spec.body("head"))
    eyes.add_tendons(spec)
    fingers = _add_fingers(spec)
    _set_joints(spec, options)
    _add_actuators(spec)
    model_sensors.add_sensors(spec)
    _shape(spec, published, fingers, options)
    moving = {joint.parent.name for joint in spec.joints}
    collisions.exclude_near(spec, moving | {"root_link"} | model_sensors.SENSED_LINKS)
    return _compiled(spec)


def _described(*, shapes: bool) -> Any:
    """Load the published description, with the paths of its meshes, or without any ``shapes``."""
    text = robot_description().read_text(encoding="utf-8")
    if not shapes:
        text = _SHAPE.sub("", text)
    return mujoco().MjSpec.from_string(text.replace(_SCHEME, str(shared_folder())))


def _set_engine(spec: Any, options: Options) -> None:
    spec.compiler.fusestatic = True
    spec.compiler.discardvisual = False
    spec.option.timestep = options.timestep
    spec.option.integrator = mujoco().mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.magnetic = _MAGNETIC_FIELD


def _add_fingers(spec: Any) -> list[Any]:
    capsule = mujoco().mjtGeom.mjGEOM_CAPSULE
    return [geom for side in "lr" for geom in fingers.add_fingers(spec.body(f"{side}_hand"), side, capsule)]


def _set_joints(spec: Any, options: Options) -> None:
    """Set the stops of every hinge, and its share of the inertia and the friction of its axis."""
    for joint in spec.joints:
        axis, inertia, friction = _share(joint.name)
        joint.armature = axis.armature * inertia
        joint.frictionloss = axis.friction * friction if options.friction else 0.0
        joint.damping = [axis.damping * inertia if options.damping else 0.0, 0.0, 0.0]
        joint.solref_friction = _FRICTION_SOLREF
        joint.solimp_friction = _FRICTION_SOLIMP
        joint.actfrclimited = False
        joint.solref_limit = _LIMIT_SOLREF
        joint.solimp_limit = _LIMIT_SOLIMP
        if joint.name not in eyes.PAN_JOINTS:  # which the tendons limit
            joint.range = _stops(joint.range, fingers.ratio(joint.name))
    for tendon in spec.tendons:
        tendon.range = _stops(tendon.range, 1.0)
        tendon.solref_limit = _LIMIT_SOLREF
        tendon.solimp_limit = _LIMIT_SOLIMP


def _stops(limits: Any, ratio: float) -> list[float]:
    """Return the stops (rad) of a hinge whose axis turns ``ratio`` times as far."""
    low, high = limits
    beyond = math.radians(STOP) / ratio
    return [low - beyond, high + beyond]


def _share(joint: str) -> tuple[Axis, float, float]:
    """Return the axis of a hinge, and the hinge's shares of the axis' inertia and dry friction.

    Each pan has half of those of the version; those of the vergence follow.
    """
    if joint in eyes.PAN_JOINTS:
        return AXES[INDEX["eyes_version"]], 0.5, 0.5
    ratio = fingers.ratio(joint)
    return AXES[INDEX[joint]], ratio**2, ratio


def _add_actuators(spec: Any) -> None:
    """Add one drive an axis: its control is the torque at the axis, its length the axis' angle."""
    transmissions = mujoco().mjtTrn
    for axis in AXES:
        tendon = axis.name in eyes.TENDONS
        actuator = spec.add_actuator(
            name=axis.name,
            target=axis.name,
            trntype=transmissions.mjTRN_TENDON if tendon else transmissions.mjTRN_JOINT,
            gear=[fingers.ratio(axis.name), 0, 0, 0, 0, 0],
            ctrllimited=True,
            ctrlrange=[-axis.max_torque, axis.max_torque],
        )
        actuator.set_to_motor()


def _shape(spec: Any, published: list[Any], fingers: list[Any], options: Options) -> None:
    """Set which shapes collide and which are visible."""
    for geom in [*published, *fingers]:
        collisions.make_visual(geom)
    if options.collision != "none":
        links = published if options.collision == "hulls" else collisions.add_capsules(spec)
        for geom in links:
            collisions.make_solid(geom)
        for geom in fingers:
            collisions.make_solid_finger(geom, geom.name[0])
    if options.cameras:
        scene.add_scene(spec, published, fingers, keep_meshes=options.collision == "hulls")


def _compiled(spec: Any) -> IcubModel:
    model = spec.compile()
    data = mujoco().MjData(model)
    mujoco().mj_forward(model, data)
    jacobian = axis_jacobian(model, data)
    home = np.radians([axis.home for axis in AXES])
    return IcubModel(
        model=model,
        home=_pose(model, home),
        home_axes=home,
        dofs=tuple(_dofs(model, axis.name) for axis in AXES),
        friction=model.dof_frictionloss.copy(),
        jacobian=jacobian,
        ft_sensors=model_sensors.ft_sensors(model),
        imu=model_sensors.imu_sensor(model),
        _forces_to_torques=np.linalg.inv(jacobian.T).astype(np.float64),
    )


def _dofs(model: Any, axis: str) -> NDArray[np.intp]:
    joints = eyes.PAN_JOINTS if axis in eyes.TENDONS else (axis,)
    return np.array([model.joint(joint).dofadr[0] for joint in joints], dtype=np.intp)


def _pose(model: Any, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    qpos = np.zeros(model.nq)
    for axis, angle in zip(AXES, axes, strict=True):
        if axis.name not in eyes.TENDONS:
            qpos[model.joint(axis.name).qposadr[0]] = angle / fingers.ratio(axis.name)
    pans = eyes.pan_angles(axes[INDEX["eyes_version"]], axes[INDEX["eyes_vergence"]])
    for joint, angle in zip(eyes.PAN_JOINTS, pans, strict=True):
        qpos[model.joint(joint).qposadr[0]] = angle
    return qpos
