"""All kinds of faults by name: those of the simulator, and plug-ins."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults import (
    amplifiers,
    boards,
    camera_pictures,
    can_bus,
    controllers,
    depth,
    encoder_errors,
    encoders,
    gears,
    mechanics,
    network,
    sensor_scale,
    sensors,
    skin,
    sticky,
    wiring,
)
from rtf.simulator.faults.base import Fault
from rtf.testing import plugins

if TYPE_CHECKING:
    from collections.abc import Mapping

KINDS: Mapping[str, type[Fault]] = {
    kind.kind: kind
    for layer in (
        mechanics,
        gears,
        amplifiers,
        sticky,
        encoders,
        encoder_errors,
        wiring,
        boards,
        can_bus,
        sensors,
        sensor_scale,
        camera_pictures,
        skin,
        depth,
        controllers,
        network,
    )
    for kind in layer.KINDS
}
#: Names can come from the network: one with a slash would name any file.
_NAME = re.compile(r"[\w-]+")


def find_kind(name: str) -> type[Fault]:
    """Return the kind of this name: one of the simulator, or a plug-in. Raises RefusedError for an unknown name."""
    if name in KINDS:
        return KINDS[name]
    try:
        if _NAME.fullmatch(name):
            return plugins.load_class(plugins.find("fault", name), Fault)  # type: ignore[type-abstract]
    except plugins.PluginNotFoundError:
        pass
    except plugins.PluginError as error:
        raise RefusedError(f"the fault {name!r}: {error}") from error
    raise RefusedError(f"there is no fault {name!r}; there are {', '.join(KINDS)}")
