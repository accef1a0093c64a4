"""The request vocabulary of YARP 3's control boards: a table from the words of a request to a device method.

A request is ``[get]`` or ``[set]``, the words of a topic, and arguments. :mod:`rtf.robot.yarp3.server` answers
by this table, and clients form their requests from it. The few words that stand alone have a table of their own at the
end. The words are those of protocol 1.9.
"""

from __future__ import annotations

from enum import Enum
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from rtf.bottle import Vocab
from rtf.bottle.tags import vocabs
from rtf.robot.control_modes import ControlMode
from rtf.robot.interfaces import (
    IAmplifierControl,
    IAxisInfo,
    IControlCalibration,
    IControlLimits,
    IControlMode,
    ICurrentControl,
    IEncoders,
    IImpedanceControl,
    IInteractionMode,
    IJointFault,
    IMotor,
    IMotorEncoders,
    IPidControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    IRemoteCalibrator,
    IRemoteVariables,
    ITorqueControl,
    IVelocityControl,
)
from rtf.robot.yarp3 import values as kinds

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rtf.robot.yarp3.values import Kind

#: The protocol version, the answer to ``[get] [prot]``.
PROTOCOL = (1, 9, 0)


def word(text: str) -> Vocab:
    """Return the shared object of a word, the one in decoded messages, so that words can be compared by identity."""
    return vocabs[Vocab(text).value]


GET, SET, IS, OK, FAIL, NAK, STAMP = map(word, ("get", "set", "is", "ok", "fail", "nak", "tsta"))
PROTOCOL_VERSION = word("prot")


class Shape(Enum):
    """The arguments of a request: how axes are selected, and the values. j: a joint or motor, n: their number.

    For SINGLE the method is called as ``get(j)`` and ``set(j, *values)``; for ONE, ALL and GROUP, the shapes of methods
    with any selection of axes, as ``get(axes)`` and ``set(values, axes)``.
    """

    NONE = "no axis: the values stand alone"
    SINGLE = "j, then the values of it"
    ONE = "j, then its value"
    ALL = "a list of n values"
    GROUP = "k, a list of k axes, a list of k values"
    EACH = "no axis; what get(j) gives for all of them, in lists"
    NAMED = "a name, then the values of it"

    # Requests are looked up by shape; an enumeration's own hash, that of its name, is slow.
    __hash__ = object.__hash__


#: The shapes of methods with any selection of axes.
PLURAL = (Shape.ONE, Shape.ALL, Shape.GROUP)


class Echo(Enum):
    """The elements of an answer before its data."""

    TOPIC = "[is], and the second word of the request"
    METHOD = "[is], and the word of the method, or the joint when it was one"
    BARE_IS = "[is] alone"
    NOTHING = "nothing: the data come first"


class Family(NamedTuple):
    """The common properties of the topics of one interface. Topics without an interface word have the family "".

    ``stamped`` answers end with ``[tsta]``, a count and the time; ``typed`` requests name a PID type first.
    """

    echo: Echo = Echo.TOPIC
    stamped: bool = False
    typed: bool = False


FAMILIES: Mapping[str, Family] = {
    "": Family(stamped=True),
    "icmd": Family(Echo.METHOD, stamped=True),
    "intm": Family(Echo.NOTHING, stamped=True),
    "torq": Family(stamped=True),
    "iimp": Family(stamped=True),
    "pid": Family(typed=True),
    "icur": Family(),
    "ipwm": Family(),
    "ivar": Family(),
    "reca": Family(),
    "ijfl": Family(Echo.BARE_IS),
}


class Topic(NamedTuple):
    """A row of the table: the words, the interface, the methods to get and to set, and the kind of values.

    An empty ``get`` or ``set`` is not part of the protocol. ``fixed`` are arguments that the words imply. With
    ``together``, one boolean (``motion_done``) is the answer for all selected axes. ``kind`` is the kind of values to
    get and to set, unless ``given`` is another kind to set.
    """

    words: tuple[str, ...]
    interface: type[Any]
    kind: Kind
    shape: Shape
    get: str = ""
    set: str = ""
    fixed: tuple[object, ...] = ()
    together: bool = False
    given: Kind | None = None

    @property
    def family(self) -> Family:
        """The family of the topic."""
        return FAMILIES[self.words[0] if len(self.words) > 1 else ""]


def _plural(
    interface: type[Any],
    kind: Kind,
    one: str,
    every: str = "",
    group: str = "",
    *,
    family: str = "",
    get: str = "",
    set: str = "",  # noqa: A002 - the word of the protocol
    together: bool = False,
) -> Iterator[Topic]:
    """Return the topics of a method with any selection of axes: a word each for one, all and several."""
    for word, shape in ((one, Shape.ONE), (every, Shape.ALL), (group, Shape.GROUP)):
        if word:
            words = (family, word) if family else (word,)
            yield Topic(words, interface, kind, shape, get, set, together=together)


def _single(
    words: str,
    interface: type[Any],
    kind: Kind,
    *,
    get: str = "",
    set: str = "",  # noqa: A002
    given: Kind | None = None,
) -> Iterator[Topic]:
    """Return the topic of a method of a single axis."""
    yield Topic((*words.split(),), interface, kind, Shape.SINGLE, get, set, given=given)


def _whole(
    words: str,
    interface: type[Any],
    kind: Kind = kinds.NOTHING,
    *,
    get: str = "",
    set: str = "",  # noqa: A002
    fixed: tuple[object, ...] = (),
    shape: Shape = Shape.NONE,
) -> Iterator[Topic]:
    """Return the topic of a method of the whole board."""
    yield Topic((*words.split(),), interface, kind, shape, get, set, fixed)


_ROWS = chain(
    # Axes and moves
    _whole("axes", IAxisInfo, kinds.INT, get="axes"),
    _single("name", IAxisInfo, kinds.TEXT, get="axis_name"),
    _single("type", IAxisInfo, kinds.JOINT_TYPE, get="joint_type"),
    _plural(IPositionControl, kinds.FLOAT, "pos", "poss", "posg", get="target_positions", set="position_move"),
    _plural(IPositionControl, kinds.FLOAT, "rel", "rels", "relg", set="relative_move"),
    _plural(IPositionControl, kinds.FLOAT, "vel", "vels", "velg", get="reference_speeds", set="set_reference_speeds"),
    _plural(
        IPositionControl,
        kinds.FLOAT,
        "acc",
        "accs",
        "accg",
        get="reference_accelerations",
        set="set_reference_accelerations",
    ),
    _plural(IPositionControl, kinds.NOTHING, "sto", "stos", "stog", set="stop"),
    _plural(IPositionControl, kinds.FLAG, "don", "dons", "dong", get="motion_done", together=True),
    _plural(IVelocityControl, kinds.FLOAT, "vmo", group="vmog", get="target_velocities"),
    _plural(IVelocityControl, kinds.FLOAT, "", "vmos", get="target_velocities", set="velocity_move"),
    _plural(IPositionDirect, kinds.FLOAT, "dpo", "dpos", "dpog", get="reference_positions"),
    # Encoders
    _plural(IEncoders, kinds.FLOAT, "enc", "encs", get="encoders", set="set_encoders"),
    _plural(IEncoders, kinds.NOTHING, "ere", "eres", set="reset_encoders"),
    _plural(IEncoders, kinds.FLOAT, "esp", "esps", get="encoder_speeds"),
    _plural(IEncoders, kinds.FLOAT, "eac", "eacs", get="encoder_accelerations"),
    _plural(IMotorEncoders, kinds.FLOAT, "mnc", "mncs", get="motor_encoders", set="set_motor_encoders"),
    _plural(IMotorEncoders, kinds.NOTHING, "mre", "mres", set="reset_motor_encoders"),
    _plural(IMotorEncoders, kinds.FLOAT, "msp", "msps", get="motor_encoder_speeds"),
    _plural(IMotorEncoders, kinds.FLOAT, "mac", "macs", get="motor_encoder_accelerations"),
    _single("mcpr", IMotorEncoders, kinds.FLOAT, get="counts_per_revolution", set="set_counts_per_revolution"),
    _whole("mnum", IMotorEncoders, kinds.INT, get="motor_encoder_count"),
    # Motors and amplifiers
    _whole("mtnm", IMotor, kinds.INT, get="motor_count"),
    _plural(IMotor, kinds.FLOAT, "tmp", "tmps", get="temperatures"),
    _single("tmpl", IMotor, kinds.FLOAT, get="temperature_limit", set="set_temperature_limit"),
    _single("gbxr", IMotor, kinds.FLOAT, get="gearbox_ratio", set="set_gearbox_ratio"),
    _single("aen", IAmplifierControl, kinds.NOTHING, set="enable_amplifier"),
    _single("adi", IAmplifierControl, kinds.NOTHING, set="disable_amplifier"),
    _plural(IAmplifierControl, kinds.INT, "asts", "asta", get="amplifier_status"),
    _plural(IAmplifierControl, kinds.FLOAT, "acu", "acus", get="currents"),
    _single("maxc", IAmplifierControl, kinds.FLOAT, get="max_current", set="set_max_current"),
    _single("acno", IAmplifierControl, kinds.FLOAT, get="nominal_current", set="set_nominal_current"),
    _single("acpk", IAmplifierControl, kinds.FLOAT, get="peak_current", set="set_peak_current"),
    _single("pwm", IAmplifierControl, kinds.FLOAT, get="pwm"),
    _single("pwml", IAmplifierControl, kinds.FLOAT, get="pwm_limit", set="set_pwm_limit"),
    _single("avsu", IAmplifierControl, kinds.FLOAT, get="supply_voltage"),
    # Limits
    _single("llim", IControlLimits, kinds.RANGE, get="limits", set="set_limits"),
    _single("vlim", IControlLimits, kinds.RANGE, get="velocity_limits", set="set_velocity_limits"),
    # Modes
    _plural(
        IControlMode, kinds.MODE, "cmod", "cmds", "cmog", family="icmd", get="control_modes", set="set_control_modes"
    ),
    _plural(
        IInteractionMode,
        kinds.INTERACTION_MODE,
        "mode",
        "mods",
        "modg",
        family="intm",
        get="interaction_modes",
        set="set_interaction_modes",
    ),
    _single("ijfl jhfl", IJointFault, kinds.FAULT, get="last_joint_fault"),
    # Torques and impedance
    _plural(ITorqueControl, kinds.FLOAT, "trq", "trqs", family="torq", get="torques"),
    _plural(
        ITorqueControl,
        kinds.FLOAT,
        "ref",
        "refs",
        family="torq",
        get="reference_torques",
        set="set_reference_torques",
    ),
    _single("torq rng", ITorqueControl, kinds.RANGE, get="torque_range"),
    _whole("torq rngs", ITorqueControl, kinds.RANGES, get="torque_range", shape=Shape.EACH),
    _single(
        "torq mtps",
        ITorqueControl,
        kinds.MOTOR_TORQUE,
        get="motor_torque_parameters",
        set="set_motor_torque_parameters",
    ),
    _whole("torq trqd", IControlMode, set="set_control_modes", fixed=(ControlMode.TORQUE,)),
    _single("iimp ipr", IImpedanceControl, kinds.IMPEDANCE, get="impedance", set="set_impedance"),
    _single("iimp iof", IImpedanceControl, kinds.IMPEDANCE_OFFSET, get="impedance_offset", set="set_impedance_offset"),
    _single("iimp llim", IImpedanceControl, kinds.IMPEDANCE_LIMITS, get="impedance_limits"),
    # Currents and duty cycles; their setpoints are only streamed
    _plural(ICurrentControl, kinds.FLOAT, "ref", "refs", family="icur", get="reference_currents"),
    _single("icur rng", ICurrentControl, kinds.RANGE, get="current_range"),
    _whole("icur rngs", ICurrentControl, kinds.RANGES, get="current_range", shape=Shape.EACH),
    _plural(IPWMControl, kinds.FLOAT, "ref", "refs", family="ipwm", get="reference_duty_cycles"),
    _plural(IPWMControl, kinds.FLOAT, "pwm", "pwms", family="ipwm", get="duty_cycles"),
    # Controllers
    _single("pid pid", IPidControl, kinds.PID, get="pid", set="set_pid"),
    _whole("pid pids", IPidControl, kinds.PIDS, get="pids", set="set_pids"),
    _plural(IPidControl, kinds.FLOAT, "ref", "refs", family="pid", get="pid_references", set="set_pid_references"),
    _plural(IPidControl, kinds.FLOAT, "err", "errs", family="pid", get="pid_errors"),
    _plural(IPidControl, kinds.FLOAT, "out", "outs", family="pid", get="pid_outputs"),
    _plural(IPidControl, kinds.FLOAT, "lim", "lims", family="pid", get="pid_error_limits", set="set_pid_error_limits"),
    _single("pid off", IPidControl, kinds.FLOAT, set="set_pid_offset"),
    _single("pid res", IPidControl, kinds.NOTHING, set="reset_pid"),
    _single("pid ena", IPidControl, kinds.FLAG, get="pid_enabled", set="enable_pid", given=kinds.NOTHING),
    _single("pid dis", IPidControl, kinds.NOTHING, set="disable_pid"),
    # Remote variables, and the calibrator behind the board
    _whole("ivar lvar", IRemoteVariables, kinds.NAMES, get="variables"),
    _whole("ivar mvar", IRemoteVariables, kinds.VARIABLE, get="variable", set="set_variable", shape=Shape.NAMED),
    _whole("reca isca", IRemoteCalibrator, kinds.FLAG, get="has_calibrator"),
    _single("reca cal", IRemoteCalibrator, kinds.NOTHING, set="calibrate_joint"),
    _whole("reca cals", IRemoteCalibrator, set="calibrate_part"),
    _single("reca hom", IRemoteCalibrator, kinds.NOTHING, set="home_joint"),
    _whole("reca homs", IRemoteCalibrator, set="home_part"),
    _single("reca par", IRemoteCalibrator, kinds.NOTHING, set="park_joint"),
    _whole("reca pars", IRemoteCalibrator, set="park_part"),
    _whole("reca quca", IRemoteCalibrator, set="quit_calibrate"),
    _whole("reca qupa", IRemoteCalibrator, set="quit_park"),
)
#: All topics by their words.
TOPICS: Mapping[tuple[str, ...], Topic] = {topic.words: topic for topic in _ROWS}

#: Commands without ``[get]`` or ``[set]``. The answer to a ``get`` is whether it is true. Commands for the whole board
#: need a second word, which is ignored.
COMMANDS: Mapping[str, Topic] = {
    topic.words[0]: topic
    for topic in chain(
        _single("calj", IControlCalibration, kinds.CALIBRATION, set="calibrate_axis"),
        _single("cljp", IControlCalibration, kinds.CALIBRATION, set="set_calibration_parameters"),
        _single("cald", IControlCalibration, kinds.FLAG, get="calibration_done"),
        _whole("cal", IRemoteCalibrator, kinds.ANYTHING, set="calibrate_part"),
        _whole("park", IRemoteCalibrator, kinds.ANYTHING, set="park_part"),
    )
}
