"""The data model of a robot's files: devices with their configurations, and the actions of each phase."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.errors import Location

if TYPE_CHECKING:
    from collections.abc import Iterator


class Phase(StrEnum):
    """The phase of a robot interface. The values are the names at its port and in the attribute ``phase``."""

    UNKNOWN = "unknown"
    STARTUP = "startup"
    RUN = "run"
    INTERRUPT1 = "interrupt1"
    INTERRUPT2 = "interrupt2"
    INTERRUPT3 = "interrupt3"
    SHUTDOWN = "shutdown"


#: The phases of the first, second and third stop request.
INTERRUPTS = (Phase.INTERRUPT1, Phase.INTERRUPT2, Phase.INTERRUPT3)
#: The phases with actions, in their order.
ACTING = (Phase.STARTUP, *INTERRUPTS, Phase.SHUTDOWN)


class ActionKind(StrEnum):
    """A kind of action on a device. The values are those of the attribute ``type``."""

    ATTACH = "attach"
    DETACH = "detach"
    CALIBRATE = "calibrate"
    PARK = "park"
    ABORT = "abort"
    CONFIGURE = "configure"
    CUSTOM = "custom"

    @property
    def moves(self) -> bool:
        """Whether it moves the robot. Such actions of a level run in parallel, each in a thread of its own."""
        return self in (ActionKind.CALIBRATE, ActionKind.PARK)


@dataclass(frozen=True, slots=True)
class Action:
    """An action on a device. ``timeout`` is in seconds; None: the default of its kind."""

    device: str
    phase: Phase
    level: int
    kind: ActionKind
    parameters: Property = field(default_factory=Property)
    timeout: float | None = None
    location: Location = field(default_factory=Location)

    def __str__(self) -> str:
        """Return a text such as ``attach of head_nws (startup, level 5)``."""
        return f"{self.kind} of {self.device} ({self.phase}, level {self.level})"


@dataclass(frozen=True, slots=True)
class DeviceEntry:
    """A device: its name, its type, its configuration, and its actions."""

    name: str
    kind: str
    configuration: Property = field(default_factory=Property)
    actions: tuple[Action, ...] = ()
    location: Location = field(default_factory=Location)


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot. ``devices`` are in the order of the document, in which they are opened."""

    name: str
    portprefix: str
    build: int = 0
    reverse_shutdown: bool = False
    parameters: Property = field(default_factory=Property)
    devices: tuple[DeviceEntry, ...] = ()
    location: Location = field(default_factory=Location)
    _by_name: dict[str, DeviceEntry] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_name", {device.name: device for device in self.devices})

    @property
    def port_name(self) -> str:
        """The name of the robot interface's RPC port; a prefix without a slash gets one."""
        return (
            f"/{self.portprefix.strip('/')}/yarprobotinterface" if self.portprefix.strip("/") else "/yarprobotinterface"
        )

    def device(self, name: str) -> DeviceEntry | None:
        """Return a device by name, or None."""
        return self._by_name.get(name)

    def actions(self, phase: Phase) -> Iterator[Action]:
        """Return the actions of a phase in the order of the document."""
        return (action for device in self.devices for action in device.actions if action.phase is phase)

    def levels(self, phase: Phase) -> list[tuple[int, list[Action]]]:
        """Return the actions of a phase by level, in the order of execution."""
        found: dict[int, list[Action]] = {}
        for action in self.actions(phase):
            found.setdefault(action.level, []).append(action)
        return sorted(found.items(), reverse=self.reverse_shutdown and phase is not Phase.STARTUP)
