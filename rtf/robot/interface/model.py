"""What the files of a robot say: devices with their configurations, and what is done with them in which phase."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from rtf.bottle import Property
from rtf.errors import Location

if TYPE_CHECKING:
    from collections.abc import Iterator


class Phase(StrEnum):
    """What a robot interface is at; the names are those of its port and of the attribute ``phase``."""

    UNKNOWN = "unknown"
    STARTUP = "startup"
    RUN = "run"
    INTERRUPT1 = "interrupt1"
    INTERRUPT2 = "interrupt2"
    INTERRUPT3 = "interrupt3"
    SHUTDOWN = "shutdown"


#: What is done on the first, second and third request for the end.
INTERRUPTS = (Phase.INTERRUPT1, Phase.INTERRUPT2, Phase.INTERRUPT3)
#: The phases that have actions, in the order in which they come.
ACTING = (Phase.STARTUP, *INTERRUPTS, Phase.SHUTDOWN)


class ActionKind(StrEnum):
    """What is done with a device; the names are those of the attribute ``type``."""

    ATTACH = "attach"
    DETACH = "detach"
    CALIBRATE = "calibrate"
    PARK = "park"
    ABORT = "abort"
    CONFIGURE = "configure"
    CUSTOM = "custom"

    @property
    def moves(self) -> bool:
        """Whether it moves the robot: such actions of a level go on at the same time, each in a thread of its own."""
        return self in (ActionKind.CALIBRATE, ActionKind.PARK)


@dataclass(frozen=True, slots=True)
class Action:
    """One thing to be done. ``timeout`` is in seconds, None for what is usual for its kind."""

    device: str
    phase: Phase
    level: int
    kind: ActionKind
    parameters: Property = field(default_factory=Property)
    timeout: float | None = None
    location: Location = field(default_factory=Location)

    def __str__(self) -> str:
        """Say it, such as ``attach of head_nws (startup, level 5)``."""
        return f"{self.kind} of {self.device} ({self.phase}, level {self.level})"


@dataclass(frozen=True, slots=True)
class DeviceEntry:
    """A device: its name, its type, what it is opened with, and what is done with it."""

    name: str
    kind: str
    configuration: Property = field(default_factory=Property)
    actions: tuple[Action, ...] = ()
    location: Location = field(default_factory=Location)


@dataclass(frozen=True, slots=True)
class Robot:
    """A whole robot. ``devices`` are in the order of the document, in which they are opened."""

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
        """The name of the port that answers questions about it; a prefix without a slash gets one."""
        return (
            f"/{self.portprefix.strip('/')}/yarprobotinterface" if self.portprefix.strip("/") else "/yarprobotinterface"
        )

    def device(self, name: str) -> DeviceEntry | None:
        """The device of a name."""
        return self._by_name.get(name)

    def actions(self, phase: Phase) -> Iterator[Action]:
        """The actions of a phase in the order of the document."""
        return (action for device in self.devices for action in device.actions if action.phase is phase)

    def levels(self, phase: Phase) -> list[tuple[int, list[Action]]]:
        """The actions of a phase by level, in the order in which the levels come."""
        found: dict[int, list[Action]] = {}
        for action in self.actions(phase):
            found.setdefault(action.level, []).append(action)
        return sorted(found.items(), reverse=self.reverse_shutdown and phase is not Phase.STARTUP)
