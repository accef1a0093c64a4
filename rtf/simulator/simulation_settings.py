"""The parameters of a simulated robot in a robot configuration, and what tests of it find in their environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, get_args

from rtf.bottle import as_float, as_list, as_string, to_string
from rtf.middleware.clocks.network_clock import CLOCK_PORT, CLOCK_VARIABLE, YARP_CLOCK_VARIABLE
from rtf.robot.errors import RefusedError
from rtf.robot.model import DEFAULT_ROBOT, ROBOT_MODEL_VARIABLE, load_robot
from rtf.robot.model.errors import RobotModelError
from rtf.robot.parameters import flag, names, port_name, positive, wrong
from rtf.simulator.ball import place_of_ball
from rtf.simulator.plant import Collision

if TYPE_CHECKING:
    from rtf.bottle import Property
    from rtf.robot.interface.model import Robot
    from rtf.robot.model import RobotModel

#: The types of the device.
SIMULATION = ("simulatedRobot", "simulatedICub")


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """The parameters of ``simulatedRobot``, all with defaults.

    ============= =====================================================================================
    ``model``     the name or path of a robot (icub)
    ``robot``     the beginning of the names of its ports (that of the model)
    ``clock``     the name of the clock's port (``/clock``)
    ``lockstep``  whether time passes only while all participants wait for it (no)
    ``factor``    otherwise the greatest real-time factor (1)
    ``seed``      of the random numbers (0)
    ``unit``      the robot of the population (0, the nominal one)
    ``collision`` capsules, hulls or none (capsules)
    ``cameras``   whether its cameras render (no)
    ``ball``      with cameras: where the red ball is, ``(x y z)`` in the root's frame (m; as robot.toml says)
    ``can``       whether its boards are on CAN buses, with the interface ``simulated`` (no)
    ``drives``    the parts whose motors have a board each, which drives them (none)
    ============= =====================================================================================
    """

    model: RobotModel
    name: str
    clock: str
    lockstep: bool
    factor: float
    seed: int
    unit: int
    collision: Collision
    cameras: bool
    ball: tuple[float, float, float] | None
    can: bool
    drives: tuple[str, ...]

    @classmethod
    def read(cls, configuration: Property) -> Self:
        """Read a configuration. Raises ConfigurationError."""
        try:
            model = load_robot(as_string(configuration.get("model", DEFAULT_ROBOT)))
        except RobotModelError as error:
            raise wrong(configuration, "model", str(error)) from error
        return cls(
            model=model,
            name=(as_string(configuration.get("robot", "")) or model.simulated_name).strip("/"),
            clock=port_name(configuration, "clock", CLOCK_PORT),
            lockstep=flag(configuration, "lockstep"),
            factor=positive(configuration, "factor", 1.0),
            seed=_number(configuration, "seed"),
            unit=_number(configuration, "unit"),
            collision=_collision(configuration),
            cameras=flag(configuration, "cameras"),
            ball=_place(configuration, "ball"),
            can=flag(configuration, "can"),
            drives=_parts(configuration, model),
        )

    @property
    def environment(self) -> dict[str, str]:
        """See :func:`environment_of`."""
        return environment_of(self.name, str(self.model.folder), self.clock, lockstep=self.lockstep)


def environment_of(name: str, model: str, clock: str, *, lockstep: bool) -> dict[str, str]:
    """Return the variables of tests of a simulated robot: its name, its model, and its clock."""
    time = f"lockstep:{clock}" if lockstep else clock
    return {
        "YARP_ROBOT_NAME": name,
        ROBOT_MODEL_VARIABLE: model,
        CLOCK_VARIABLE: time,
        YARP_CLOCK_VARIABLE: clock,
    }


def simulation_in(robot: Robot) -> SimulationSettings | None:
    """Return the parameters of the simulated robot in a configuration, None if it has none. Raises as ``read``."""
    for entry in robot.devices:
        if entry.kind in SIMULATION:
            return SimulationSettings.read(entry.configuration)
    return None


def _number(configuration: Property, key: str) -> int:
    value = configuration.get(key, 0)
    if not isinstance(value, int) or value < 0:
        raise wrong(configuration, key, f"{to_string(value)} is no whole number from 0")
    return value


def _place(configuration: Property, key: str) -> tuple[float, float, float] | None:
    if not configuration.check(key):
        return None
    values = as_list(configuration.find(key))
    numbers = [] if values is None else [as_float(one) for one in values if isinstance(one, int | float)]
    try:
        return place_of_ball(numbers)
    except RefusedError as error:
        raise wrong(configuration, key, str(error)) from None


def _parts(configuration: Property, model: RobotModel) -> tuple[str, ...]:
    found = names(configuration, "drives")
    if unknown := [part for part in found if part not in model.parts]:
        raise wrong(
            configuration, "drives", f"there is no part {', '.join(unknown)!r}; there are {', '.join(model.parts)}"
        )
    return found


def _collision(configuration: Property) -> Collision:
    word = as_string(configuration.get("collision", "capsules"))
    for known in get_args(Collision):
        if word == known:
            return known  # type: ignore[no-any-return]  # one of its words
    raise wrong(configuration, "collision", f"{word!r} is none of {', '.join(get_args(Collision))}")
