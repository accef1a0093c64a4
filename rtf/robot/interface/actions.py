"""What the kinds of actions do with devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from rtf.robot.device import Calibrator, Device
from rtf.robot.errors import NotSupportedError
from rtf.robot.interface.model import ActionKind
from rtf.robot.interface.targets import attachments, is_describing, target

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.bottle import Property
    from rtf.robot.interface.model import Action, Robot


@runtime_checkable
class OffersCustom(Protocol):
    """A device with actions of its own, which the configuration asks for by ``type="custom"``."""

    def custom(self, parameters: Property) -> object:
        """Do what the action's parameters say; by habit ``name`` says which of several things. Raises RobotError."""


@runtime_checkable
class OffersConfigure(Protocol):
    """A device that can be told more while it is open, by ``type="configure"``."""

    def configure(self, parameters: Property) -> object:
        """Take over the parameters of the action. Raises RobotError."""


@runtime_checkable
class TakesCalibrator(Protocol):
    """A device that others ask for calibration, and that is given a calibrator for that."""

    def set_calibrator(self, calibrator: Calibrator) -> object:
        """Ask this one from now on."""


class Description(Device):
    """The devices of the robot, for those that tell others: ``devices`` are names and types."""

    def __init__(self, robot: Robot) -> None:
        super().__init__("robotDescription")
        self.robot_name = robot.name
        self.devices = tuple((entry.name, entry.kind) for entry in robot.devices)

    def open(self, configuration: Property) -> None:
        """There is nothing to open."""

    def close(self) -> None:
        """There is nothing to close."""


class Job(NamedTuple):
    """What is to be called for an action, which blocks, and the calibrator that can be told to stop it."""

    run: Callable[[], object]
    calibrator: Calibrator | None = None


def job_of(robot: Robot, action: Action, devices: Mapping[str, Device]) -> Job:
    """What an action means. Raises RobotError for what its device is not able to, or what names no device."""
    device = devices[action.device]
    if not action.kind.moves:
        return Job(_call_of(robot, action, device, devices))
    calibrator, moved = _calibrator(device), devices[target(robot, action)]
    if action.kind is ActionKind.PARK:
        return Job(lambda: calibrator.park(moved), calibrator)
    return Job(lambda: _calibrate(calibrator, moved), calibrator)


def _call_of(robot: Robot, action: Action, device: Device, devices: Mapping[str, Device]) -> Callable[[], object]:
    match action.kind:
        case ActionKind.ATTACH:
            found = {key: devices[name] for key, name in attachments(robot, action).items()}
            described: dict[str, Device] = {"robotDescription": Description(robot)}
            return lambda: device.attach(described if is_describing(robot, action) else found)
        case ActionKind.DETACH:
            return device.detach
        case ActionKind.ABORT if isinstance(device, Calibrator):
            return device.abort
        case ActionKind.CONFIGURE if isinstance(device, OffersConfigure):
            return lambda: device.configure(_handed(action))
        case ActionKind.CUSTOM if isinstance(device, OffersCustom):
            return lambda: device.custom(_handed(action))
        case ActionKind.CUSTOM:
            raise NotSupportedError(f"{device.name} ({type(device).__name__}) has no actions of its own")
    return _nothing


def _handed(action: Action) -> Property:
    return action.parameters.copy()


def _calibrator(device: Device) -> Calibrator:
    if not isinstance(device, Calibrator):
        raise NotSupportedError(f"{device.name} ({type(device).__name__}) is no calibrator")
    return device


def _calibrate(calibrator: Calibrator, moved: Device) -> None:
    if isinstance(moved, TakesCalibrator):
        moved.set_calibrator(calibrator)
    calibrator.calibrate(moved)


def _nothing() -> None:
    """What is done where a device has nothing to abort or to configure, as robots' files take for granted."""
