"""The keys of ``robot.toml``, with their types: the schema that a file is read by.

Every table forbids unknown keys. Units: degrees for revolute axes, metres for prismatic ones and for places; newton
metres, amperes, kilograms.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0.0)]
NotNegative = Annotated[float, Meta(ge=0.0)]
Vector = tuple[float, float, float]
Text = Annotated[str, Meta(min_length=1)]


class Table(Struct, frozen=True, forbid_unknown_fields=True):
    """Base class of the tables."""


class Description(Table, frozen=True):
    """Where the URDF or MJCF file is: beside robot.toml, or in an installed distribution."""

    file: Text  # relative to the folder of robot.toml; with ``package``: how its path in the package ends
    package: str = ""  # the name of the distribution, as pip knows it


class Attachment(Table, frozen=True):
    """An MJCF file beside robot.toml whose bodies the description lacks."""

    body: Text  # of the description, to which the bodies are attached
    file: Text
    prefix: Text  # of the names in the file, such as l_ of the fingers of a left hand; angles in it are in radians


class Motor(Table, frozen=True):
    """A type of motor."""

    rotor_resolution: Positive  # ticks a turn of its encoder
    nominal_current: Positive  # A
    peak_current: Positive  # A
    overload_current: Positive  # A, beyond which the drive switches off
    #: Whether the amplifier controls the current, or only sets a voltage; see :mod:`rtf.robot.model.drives`, also for
    #: what follows from the joint if it is not given.
    drive: Literal["voltage", "current"] = "current"
    supply: Positive | None = None  # V
    torque_constant: Positive | None = None  # Nm/A, of the rotor
    resistance: Positive | None = None  # Ohm, of the winding
    current_noise: NotNegative = 0.005  # of the current sensor, a share of the peak current, standard deviation
    current_step: Positive = 0.001  # A, of the current sensor


class Joint(Table, frozen=True):
    """A joint of a part. What is missing comes from ``[defaults]``, then from the description."""

    limits: tuple[float, float] | None = None  # configured
    max_velocity: Positive | None = None
    max_torque: Positive | None = None
    motor_torque: Positive | None = (
        None  # of the motor behind its gear, where coupled motors add up; default: max_torque
    )
    gearbox: float | None = None
    motor: str | None = None
    encoder_resolution: Positive | None = None  # ticks a unit
    armature: NotNegative | None = None
    friction: NotNegative | None = None
    stribeck: NotNegative | None = None  # what friction at rest has more, a share of the dry friction
    stribeck_speed: Positive | None = None  # unit/s, at which half of that is left
    damping: NotNegative | None = None
    play: NotNegative | None = None  # unit, the whole play of its gear; default: none
    stiffness: Positive | None = None  # Nm/rad (N/m) of its gear; default: rigid
    home: float | None = None
    torque_control: bool | None = None
    ratio: float | None = None  # units of the axis a unit of its joint in the description
    prismatic: bool | None = None
    degree: Positive | None = None  # m, of a prismatic joint: what stands for a degree in the parameters of tests


class CouplingBlock(Table, frozen=True):
    """The coupling of neighbouring joints; see :class:`rtf.robot.model.values.Coupling`."""

    first: Annotated[int, Meta(ge=0)]
    joint_to_motor: Annotated[list[list[float]], Meta(min_length=1)]


class PartTable(Table, frozen=True):
    """A control board. Joints that no coupling names have a motor each."""

    joints: dict[Text, Joint]
    couplings: list[CouplingBlock] = []
    boards: list[Annotated[int, Meta(gt=0)]] = []  # joints of each of its electronics; default: one for all
    together: list[list[list[str]]] = []  # queues of groups of joints that move together; default: one after another
    light: list[str] = []  # joints that move hardly any mass
    kinematic: bool = False  # moves hardly any mass: without physics, not in the description


class Outline(Table, frozen=True):
    """An outline of a link: a capsule between two points of its frame, or a box along the axes of it."""

    link: Text
    start: Vector | None = None
    end: Vector | None = None
    radius: Positive | None = None
    centre: Vector | None = None
    half: Vector | None = None  # half its edges


class Body(Table, frozen=True):
    """What the description lacks, or what is simulated otherwise than it says."""

    attach: list[Attachment] = []
    outlines: list[Outline] = []  # for collisions, in place of the description's own shapes
    near: Annotated[int, Meta(ge=0)] = 2  # links with at most this number of joints between them do not collide
    root: str = ""  # a fixed link that takes part in this


class Accuracy(Table, frozen=True):
    """How the numbers of a sensor differ from what it measures, in its unit; for the simulation."""

    noise: NotNegative = 0.0  # standard deviation, white
    drift: NotNegative = 0.0  # standard deviation of the bias after a minute; it grows with the root of the time
    count: NotNegative = 0.0  # the step between two numbers; 0: there is none


class ForceTorque(Table, frozen=True):
    """A force-torque sensor at the joint of a link, in the link's frame."""

    link: Text
    port: Text  # /ROBOT/PORT/analog:o
    weight: NotNegative | None = None  # N, of the limb beyond it; with it, the guard watches the part for contacts
    lever: NotNegative = 0.3  # m, about the greatest distance of that weight from a joint
    parts: list[str] = []  # whose joints decide the direction of its load, from the upright root outwards
    force: Accuracy = Accuracy(noise=0.05)  # N
    torque: Accuracy = Accuracy(noise=0.002)  # Nm


class Inertial(Table, frozen=True):
    """An inertial unit on a link."""

    link: Text
    port: Text = "inertial"
    position: Vector = (0.0, 0.0, 0.0)  # m, in the frame of the link
    rotation: Vector = (0.0, 0.0, 0.0)  # rad: roll, pitch, yaw about fixed axes
    gyroscope: Accuracy = Accuracy(noise=0.05)  # deg/s
    accelerometer: Accuracy = Accuracy(noise=0.02)  # m/s²
    magnetometer: Accuracy = Accuracy(noise=1e-7)  # T
    orientation: Accuracy = Accuracy(noise=0.02)  # deg


class CameraTable(Table, frozen=True):
    """A camera of the description, or of an attached file."""

    camera: Text
    port: Text  # /ROBOT/PORT


class AngleSensors(Table, frozen=True):
    """Sensors that measure joint angles as counts: one number a channel, on one port."""

    port: Text  # /ROBOT/PORT/analog:o
    channels: list[tuple[str, float]]  # an axis, and the share of it that bends the joint
    open: float  # counts of an open joint
    bent: float  # counts of one bent by 90 deg
    noise: NotNegative = 0.0  # counts, standard deviation


class Battery(Table, frozen=True):
    """The battery that supplies the motors and the electronics."""

    capacity: Positive  # Wh
    full: Positive  # V, without load
    empty: Positive  # V, likewise
    max_current: Positive  # A
    port: Text = "battery"  # /ROBOT/PORT/data:o
    resistance: Positive = 0.1  # Ohm, of the cells and the cables
    idle_power: NotNegative = 0.0  # W, of the electronics
    charge: Annotated[float, Meta(ge=0.0, le=100.0)] = 100.0  # per cent, at the start of a simulation
    charge_step: Positive = 1.0  # per cent, in which the charge is shown
    voltage_noise: NotNegative = 0.01  # V, standard deviation
    current_noise: NotNegative = 0.01  # A, likewise

    @property
    def ampere_seconds(self) -> float:
        """The charge of the full battery (As): its energy at its mean voltage."""
        return self.capacity * 3600.0 / ((self.full + self.empty) / 2.0)


class SkinPatch(Table, frozen=True):
    """A patch of skin that covers a shape of a link with triangles of twelve taxels."""

    link: Text
    port: Text  # /ROBOT/PORT
    triangles: Annotated[int, Meta(gt=0, le=1000)]
    shape: str = ""  # the name of the covered shape; default: the first one of the link that collides
    rest: Annotated[float, Meta(ge=0.0, le=255.0)] = 240.0  # counts of a taxel that nothing touches
    sensitivity: Positive = 20.0  # counts that a reading falls for one newton upon its taxel
    noise: NotNegative = 1.0  # counts, standard deviation


class KnownDepth(Table, frozen=True):
    """The known depth of a place in the images of a depth camera, while the robot is at home."""

    at: tuple[Annotated[float, Meta(ge=0.0, le=1.0)], Annotated[float, Meta(ge=0.0, le=1.0)]]  # from left and from top
    depth: Positive  # m, along the optical axis


class DepthCamera(Table, frozen=True):
    """A depth camera at the place of a camera of the model."""

    camera: Text  # of the description, of an attached file, or ``outside``, that of the scene
    port: Text  # /ROBOT/PORT/rgbImage:o
    width: Annotated[int, Meta(gt=0, le=1280)] = 320
    height: Annotated[int, Meta(gt=0, le=960)] = 240
    near: Positive = 0.2  # m, the least depth that is measured
    far: Positive = 6.0  # m, the greatest one
    accuracy: Positive = 0.01  # m
    noise: NotNegative = 0.001  # m, standard deviation
    known: list[KnownDepth] = []


class JointTorques(Table, frozen=True):
    """How the torque sensors of the joints measure, for the simulation; shares are of the greatest torque of a joint.

    Strain gauges of robots are good for some tenths of a per cent of their range; the iCub's estimator of torques
    computes them every 10 ms.
    """

    noise: NotNegative = 0.001  # a share, standard deviation
    offset: NotNegative = 0.002  # a share, the greatest one
    delay: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.01  # s


class Encoders(Table, frozen=True):
    """How boards compute from the counts of encoders, for the simulation.

    A board reads its encoders once a millisecond, and uses a reading in the next one. Speeds are differences of counts
    over a window: a longer one has finer steps, and makes the damping of a controller late.
    """

    latency: Annotated[float, Meta(ge=0.0, le=0.01)] = 0.001  # s, of the encoders of joints
    speed_window: Annotated[float, Meta(ge=0.001, le=0.05)] = 0.008  # s
    acceleration_window: Annotated[float, Meta(ge=0.001, le=0.05)] = 0.02  # s, of each of the two speeds


class Sensors(Table, frozen=True):
    """The sensors, by their names."""

    encoders: Encoders = Encoders()
    joint_torques: JointTorques = JointTorques()

    force_torque: dict[str, ForceTorque] = {}
    inertial: dict[str, Inertial] = {}
    cameras: dict[str, CameraTable] = {}
    angles: dict[str, AngleSensors] = {}
    skin: dict[str, SkinPatch] = {}
    depth_cameras: dict[str, DepthCamera] = {}
    battery: Battery | None = None


class GuardTable(Table, frozen=True):
    """How long joints may press before the guard of a test releases them.

    The times are shorter than the half second within which pressing has to end, and longer than healthy motion needs:
    to reach or leave its greatest speed *v* a joint of inertia *I* needs its whole torque *T* for *I v / T*, for the
    heaviest joint of the iCub (3 kg m², 100 deg/s, 80 Nm) 0.07 s.
    """

    peak_time: Positive = 0.3  # s, for which a motor may have its peak current (I2t above the nominal one)
    saturated_time: Positive = 0.3  # s, for which a controller may give its whole duty cycle
    stalled_time: Positive = 0.25  # s, for which a joint may stand still although its motor works
    stalled_error: Positive = 1.0  # deg, twice the distance at which a move counts as arrived
    #: Greatest share of the full output that friction takes: 0.02 in the model of the iCub, up to 0.1 with the harmonic
    #: drives and cables of real ones.
    breakaway: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.15


class Cut(Table, frozen=True):
    """A visible mesh that is cut off beyond coordinates of its link, as attached bodies take its place."""

    links: list[str]
    length: Positive  # of x, to both sides
    width: float  # of z


class Bench(Table, frozen=True):
    """The visible surroundings: nothing of them collides."""

    floor: float = 0.0  # height
    outside: Vector = (2.0, 1.0, 1.0)  # the place of a camera that shows all of the robot
    centre: Vector = (0.0, 0.0, 0.5)  # where it looks
    ball: Vector | None = None  # the place of a red ball
    box: Vector | None = None  # the place of a green box
    cut: Cut | None = None


class Box(Table, frozen=True):
    """A box along the axes of the root's frame."""

    low: Vector
    high: Vector


class PlaneTable(Table, frozen=True):
    """A plane that bounds the workspace, such as a table or a wall."""

    point: Vector  # of the plane
    normal: Vector  # pointing into the workspace


class PointTable(Table, frozen=True):
    """A point of a link that has to stay in the workspace."""

    link: Text
    position: Vector = (0.0, 0.0, 0.0)  # m, in the frame of the link
    radius: NotNegative = 0.0  # m, of a ball about it that stays within, too


class WorkspaceTable(Table, frozen=True):
    """What the robot may reach, in the frame of its root: a box, or planes, or both."""

    box: Box | None = None
    planes: dict[Text, PlaneTable] = {}
    points: dict[Text, PointTable] = {}  # default: the origins of all links that an axis moves


#: The thresholds of a test: values of its parameters by their keys, and the key ``origin``.
ThresholdTable = dict[Text, bool | int | float | str | list[int | float | str]]


class RobotFile(Table, frozen=True):
    """The whole file."""

    schema: Literal[1]
    name: Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    description: Description
    parts: dict[Annotated[str, Meta(pattern=r"^[A-Za-z0-9_]+$")], PartTable]
    title: str = ""
    profile: Literal["measured", "chosen", "unvalidated"] = "unvalidated"
    assumed: list[str] = []
    defaults: Joint = Joint()
    motors: dict[str, Motor] = {}
    body: Body = Body()
    sensors: Sensors = Sensors()
    guard: GuardTable = GuardTable()
    scene: Bench = Bench()
    workspace: WorkspaceTable | None = None
    thresholds: dict[Text, ThresholdTable] = {}  # by the names of tests
    safe: dict[Text, dict[str, float]] = {}  # poses in which it may be left: joints; others are at home


def json_schema() -> dict[str, object]:
    """Return the schema as JSON Schema, for editors."""
    return msgspec.json.schema(RobotFile)
