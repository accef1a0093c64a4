"""The mechanics of a simulated robot: its description, what is attached to it, and an actuator for each axis.

The robot's root is fixed in the air.

:func:`build` makes a model whose actuators are the axes of a :class:`~rtf.robot.model.RobotModel`, in that order:

``data.ctrl``               torque at each axis (Nm; N of a prismatic one), limited to that of the drive; in a
                            simulation, by its motors alone (:mod:`rtf.simulator.motors`)
``data.actuator_length``    position of each axis (rad, m)
``data.actuator_velocity``  speed of each axis (rad/s, m/s)
``data.actuator_force``     torque that the drive gives (Nm, N)

For most axes that is a joint's own position; an axis may also be a fixed tendon over several joints, and have a ratio
to its joint. Users of the arrays above need not know that.

Mechanical faults change arrays of the model at run time:

===================  ==================================================================================================
a jam, stiction      ``model.dof_frictionloss[Plant.dofs[i]]``, Nm at the joint; in a simulation, which has a dry
                     friction of its own (:mod:`rtf.simulator.friction`), what is added to that
viscous friction     ``model.dof_damping[Plant.dofs[i]]``
a motor              not here, but ``Motors.faults`` of :mod:`rtf.simulator.motors`
a payload            ``model.body_mass[...]``, and ``data.xfrc_applied`` for a push
===================  ==================================================================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from rtf.robot.model.bodies import attach_bodies
from rtf.robot.model.description import fix_root, load_description
from rtf.robot.model.engine import mujoco
from rtf.robot.model.errors import RobotModelError
from rtf.simulator import collisions, model_sensors, scene, workspace
from rtf.simulator.units import Unit, vary

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.robot.model import Axis, RobotModel
    from rtf.simulator.model_sensors import FtSensor, ImuSensor

TIMESTEP = 1e-3
GRAVITY = 9.81
#: Limits hold within 2 degrees against the whole torque of a drive, and a joint at rest on one is 0.02 degrees beyond.
_LIMIT_SOLREF = (0.004, 1.0)
_LIMIT_SOLIMP = (0.95, 0.99, 0.001, 0.5, 2.0)
#: Distance of the mechanical stops from the limits, deg of the axis (m of a prismatic one), so that a joint at its
#: limit does not touch a stop. Many joints are at a limit at home, and contacts with stops would make a step half as
#: slow again.
STOP, _SLIDE_STOP = 0.1, 1e-3
#: Parameters of dry friction: with the engine's defaults a jammed elbow creeps at 24 degrees a second.
_FRICTION_SOLREF = (0.004, 1.0)
_FRICTION_SOLIMP = (0.9995, 0.9995, 0.001, 0.5, 2.0)
#: Strength and dip of the earth's field in Genoa (T); north is where an iCub looks.
_MAGNETIC_FIELD = (-2.3e-5, 0.0, -4.2e-5)

Collision = Literal["capsules", "hulls", "none"]


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a model beyond links and joints."""

    collision: Collision = "capsules"
    cameras: bool = False  # visible covers, a floor and objects; building takes some tenths of a second longer
    friction: bool = True
    damping: bool = True
    timestep: float = TIMESTEP  # s
    ball: tuple[float, float, float] | None = (
        None  # with cameras: where the red ball is, else where robot.toml says (m)
    )
    workspace: bool = False  # with cameras: a drawing of the robot's workspace
    unit: int = 0  # the robot of the population (rtf.simulator.units); 0: the nominal one


@dataclass(frozen=True, slots=True)
class Plant:
    """A compiled robot, with the indices of its elements. Faults may change the model; see the module."""

    robot: RobotModel
    model: Any  # mujoco.MjModel
    home: NDArray[np.float64]  # qpos of the pose without contacts
    home_axes: NDArray[np.float64]  # the same as axes, by the encoders (rad, m)
    dofs: tuple[NDArray[np.intp], ...]  # the joint of each axis; of a tendon those of all its joints
    friction: NDArray[np.float64]  # (nv,), dry, Nm at each joint, as built
    jacobian: NDArray[np.float64]  # (axes, nv), in every pose: speeds of the axes = jacobian @ data.qvel
    ft_sensors: tuple[FtSensor, ...]
    imus: tuple[ImuSensor, ...]
    unit: Unit
    inertia: NDArray[np.float64]  # of each axis at home, of the nominal robot, for the gains of controllers (kg m2, kg)
    _addresses: NDArray[np.intp]  # in qpos of the joints that the axes move
    _axes_to_joints: NDArray[np.float64]
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
        """Return the qpos of a pose of all axes (rad, m); joints that no axis moves are where they were built."""
        qpos: NDArray[np.float64] = self.model.qpos0.copy()
        qpos[self._addresses] = self._axes_to_joints @ axes
        return qpos

    def axis_inertia(self, data: Any) -> NDArray[np.float64]:
        """Return the inertia of each axis while all others are free to move, (axes,) in kg m2, or kg.

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
    """Return the Jacobian of the axes by the degrees of freedom, (axes, nv); the same in every pose."""
    moment = np.zeros((model.nu, model.nv))
    mujoco().mju_sparse2dense(moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    return moment


def build(robot: RobotModel, options: Options | None = None) -> Plant:
    """Build the model. Two builds with the same options give identical models.

    Raises RobotModelError where robot.toml and description disagree; the message of MissingPackageError says how to
    install the missing package.
    """
    options = options or Options()
    shapes = options.cameras or options.collision == "hulls"
    spec = load_description(robot.description, shapes=shapes)
    _set_engine(spec, options)
    published = list(spec.geoms)
    attached = _attach(spec, robot)
    _set_joints(spec, robot, options)
    _add_actuators(spec, robot)
    model_sensors.add_sensors(spec, robot)
    workspace.add_points(spec, robot)
    _shape(spec, robot, published, attached, options)
    moving = {joint.parent.name for joint in spec.joints}
    fixed = {robot.body.root, *(sensor.link for sensor in robot.sensors.force_torque.values())}
    if robot.description.suffix.lower() != ".urdf":  # whose shapes collide as they are, those of fixed links, too
        fixed |= {body.name for body in spec.bodies if body.geoms and body.name != "world"}
    collisions.exclude_near(spec, moving | fixed, robot.body.near)
    return _compiled(spec, robot, Unit(options.unit))


def _set_engine(spec: Any, options: Options) -> None:
    spec.compiler.fusestatic = True
    spec.compiler.discardvisual = False
    spec.option.timestep = options.timestep
    spec.option.integrator = mujoco().mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.magnetic = _MAGNETIC_FIELD
    fix_root(spec)  # the axes have drives of their own


def _attach(spec: Any, robot: RobotModel) -> list[Any]:
    """Add the bodies that the description lacks; return their shapes."""
    before = {body.name for body in spec.bodies}
    attach_bodies(spec, robot)
    return [geom for geom in spec.geoms if geom.parent.name not in before]


def _shares(spec: Any, robot: RobotModel) -> dict[str, list[tuple[Axis, float]]]:
    """Return for each joint the axes that move it, each with the units of the axis a unit of the joint."""
    tendons = {tendon.name: tendon for tendon in spec.tendons}
    joints = {joint.name for joint in spec.joints}
    found: dict[str, list[tuple[Axis, float]]] = {}
    for axis in robot.axes:
        if axis.name in tendons:
            for wrap in tendons[axis.name].path:
                found.setdefault(wrap.target.name, []).append((axis, float(wrap.coef)))
        elif axis.name in joints:
            found.setdefault(axis.name, []).append((axis, axis.ratio))
        else:
            raise RobotModelError(
                f"{robot.place('parts', axis.part, 'joints', axis.name)}: {robot.description.name} has no joint "
                f"{axis.name!r}, but {', '.join(sorted(joints))}"
            )
    return found


def _set_joints(spec: Any, robot: RobotModel, options: Options) -> None:
    """Set the stops of every joint, and its share of the inertia and the friction of its axes."""
    shares = _shares(spec, robot)
    turns = 180.0 / math.pi if spec.compiler.degree else 1.0  # of the numbers of the description a radian
    slide = mujoco().mjtJoint.mjJNT_SLIDE
    for joint in spec.joints:
        joint.solref_friction = _FRICTION_SOLREF
        joint.solimp_friction = _FRICTION_SOLIMP
        joint.actfrclimited = False
        joint.solref_limit = _LIMIT_SOLREF
        joint.solimp_limit = _LIMIT_SOLIMP
        axes = shares.get(joint.name)
        if axes is not None:
            _set_share(joint, axes, options)
            low, high = joint.range
            axis, ratio = axes[0]
            beyond = _SLIDE_STOP if joint.type == slide else turns * math.radians(STOP)
            if low >= high and len(axes) == 1:  # the description has no limits
                unit = 1.0 if joint.type == slide else turns * axis.internal
                low, high = sorted((axis.minimum * unit / ratio, axis.maximum * unit / ratio))
            if low < high:
                joint.range = [low - beyond / abs(ratio), high + beyond / abs(ratio)]
                joint.limited = True
    for tendon in spec.tendons:
        low, high = tendon.range
        tendon.range = [low - math.radians(STOP), high + math.radians(STOP)]
        tendon.solref_limit = _LIMIT_SOLREF
        tendon.solimp_limit = _LIMIT_SOLIMP


def _set_share(joint: Any, axes: list[tuple[Axis, float]], options: Options) -> None:
    """Set inertia, damping and dry friction of a joint; what robot.toml does not say is left as the description has it.

    Of several axes over one joint the inertias and dampings add up, and the largest friction counts.
    """
    if all(axis.armature is not None for axis, _ in axes):
        joint.armature = sum((axis.armature or 0.0) * share**2 for axis, share in axes)
    if all(axis.damping is not None for axis, _ in axes):
        joint.damping = [sum((axis.damping or 0.0) * share**2 for axis, share in axes), 0.0, 0.0]
    if all(axis.friction is not None for axis, _ in axes):
        joint.frictionloss = max((axis.friction or 0.0) * abs(share) for axis, share in axes)
    if not options.friction:
        joint.frictionloss = 0.0
    if not options.damping:
        joint.damping = [0.0, 0.0, 0.0]


def _add_actuators(spec: Any, robot: RobotModel) -> None:
    """Add one drive an axis: its control is the torque at the axis, its length the axis' position."""
    transmissions = mujoco().mjtTrn
    tendons = {tendon.name for tendon in spec.tendons}
    for axis in robot.axes:
        actuator = spec.add_actuator(
            name=axis.name,
            target=axis.name,
            trntype=transmissions.mjTRN_TENDON if axis.name in tendons else transmissions.mjTRN_JOINT,
            gear=[axis.ratio, 0, 0, 0, 0, 0],
            ctrllimited=True,
            ctrlrange=[-axis.max_torque, axis.max_torque],
        )
        actuator.set_to_motor()


def _shape(spec: Any, robot: RobotModel, published: list[Any], attached: list[Any], options: Options) -> None:
    """Set which shapes collide and which are visible."""
    own = attached if robot.description.suffix == ".urdf" else [*published, *attached]  # whose bits mean something
    bits = {id(geom): (geom.contype, geom.conaffinity) for geom in own}
    for geom in [*published, *attached]:
        collisions.make_visual(geom)
    if options.collision != "none":
        if options.collision == "hulls":
            links = [geom for geom in published if id(geom) not in bits]
        else:
            links = collisions.add_outlines(spec, robot)
        for geom in links:
            collisions.make_solid(geom)
        for geom in own:
            collisions.make_solid(geom, *bits[id(geom)])
    if options.cameras:
        if options.workspace:
            workspace.draw(spec, robot, 2 * math.dist(robot.scene.outside, robot.scene.centre))
        bench = robot.scene if options.ball is None else msgspec.structs.replace(robot.scene, ball=options.ball)
        scene.add_scene(spec, bench, published, attached, keep_meshes=options.collision == "hulls")


def _compiled(spec: Any, robot: RobotModel, unit: Unit) -> Plant:
    try:
        model = spec.compile()
    except ValueError as error:
        raise RobotModelError(f"{robot.description}: the physics engine refuses this robot: {error}") from error
    data = mujoco().MjData(model)
    mujoco().mj_forward(model, data)
    jacobian = axis_jacobian(model, data)
    driven = np.flatnonzero(jacobian.any(axis=0))
    square = jacobian[:, driven]
    inverse = np.linalg.inv if len(driven) == len(robot.axes) else np.linalg.pinv
    home = np.array([axis.home * axis.internal for axis in robot.axes])
    to_torques = np.zeros_like(jacobian)
    to_torques[:, driven] = inverse(square.T)
    plant = Plant(
        robot=robot,
        model=model,
        home=np.empty(0),
        home_axes=home,
        dofs=tuple(np.flatnonzero(row) for row in jacobian),
        friction=np.empty(0),
        jacobian=jacobian,
        ft_sensors=model_sensors.ft_sensors(model, robot),
        imus=model_sensors.imu_sensors(model, robot),
        unit=unit,
        inertia=np.empty(0),
        _addresses=model.jnt_qposadr[model.dof_jntid[driven]].astype(np.intp),
        _axes_to_joints=inverse(square).astype(np.float64),
        _forces_to_torques=to_torques,
    )
    nominal = replace(plant, home=plant.pose(home))
    inertia = nominal.axis_inertia(nominal.data())
    vary(model, unit, robot.axes, jacobian, [*robot.sensors.force_torque, *robot.sensors.inertial])
    offsets = unit.zeros(robot.axes) * np.array([axis.internal for axis in robot.axes])
    return replace(nominal, home=plant.pose(home - offsets), friction=model.dof_frictionloss.copy(), inertia=inertia)
