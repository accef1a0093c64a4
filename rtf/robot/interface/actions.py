"""The implementation of the actions on devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from rtf.robot.device import Calibrator, Device
from rtf.robot.errors import NotSupportedError
from rtf.robot.interface.action_targets import attachments, is_describing, target
from rtf.robot.interface.model import ActionKind

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rtf.bottle import Property
    from rtf.robot.interface.model import Action, Robot


@runtime_checkable
class OffersCustom(Protocol):
    """A device with custom actions, requested by ``type="custom"``."""

    def custom(self, parameters: Property) -> object:
        """Execute a custom action; by convention the parameter ``name`` selects it. Raises RobotError."""


@runtime_checkable
class OffersConfigure(Protocol):
    """A device that can be reconfigured while it is open, by ``type="configure"``."""

    def configure(self, parameters: Property) -> object:
        """Apply the parameters of the action. Raises RobotError."""


@runtime_checkable
class TakesCalibrator(Protocol):
    """A board that passes calibration requests on to a calibrator."""

    def set_calibrator(self, calibrator: Calibrator) -> object:
        """Use this calibrator from now on."""


class Description(Device):
    """The list of the robot's devices, for devices that publish it: ``devices`` are names and types."""

    def __init__(self, robot: Robot) -> None:
        super().__init__("robotDescription")
        self.robot_name = robot.name
        self.devices = tuple((entry.name, entry.kind) for entry in robot.devices)

    def open(self, configuration: Property) -> None:
        """Do nothing: there are no resources."""

    def close(self) -> None:
        """Do nothing: there are no resources."""


class Job(NamedTuple):
    """The blocking call of an action, and the calibrator that can abort it."""

    run: Callable[[], object]
    calibrator: Calibrator | None = None


def job_of(robot: Robot, action: Action, devices: Mapping[str, Device]) -> Job:
    """Return the call of an action. Raises RobotError if the device does not support it, or a device is missing."""
    device = devices[action.device]
    if not action.kind.moves:
        return Job(_call_of(robot, action, device, devices))
    calibrator, moved = _calibrator(device), devices[target(robot, action)].implementation
    if action.kind is ActionKind.PARK:
        return Job(lambda: calibrator.park(moved), calibrator)
    return Job(lambda: _calibrate(calibrator, moved), calibrator)


def _call_of(robot: Robot, action: Action, device: Device, devices: Mapping[str, Device]) -> Callable[[], object]:
    match action.kind:
        case ActionKind.ATTACH:
            found = {key: devices[name].implementation for key, name in attachments(robot, action).items()}
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
            raise NotSupportedError(f"{device.name} ({type(device).__name__}) has no custom actions")
    return _nothing


def _handed(action: Action) -> Property:
    return action.parameters.copy()


def _calibrator(device: Device) -> Calibrator:
    if not isinstance(device, Calibrator):
        raise NotSupportedError(f"{device.name} ({type(device).__name__}) is not a calibrator")
    return device


def _calibrate(calibrator: Calibrator, moved: Device) -> None:
    if isinstance(moved, TakesCalibrator):
        moved.set_calibrator(calibrator)
    calibrator.calibrate(moved)


def _nothing() -> None:
    """Do nothing: robot files use abort and configure on devices without them."""
