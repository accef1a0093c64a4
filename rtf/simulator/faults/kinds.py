"""All kinds of faults by name: those that come with the simulator, and plug-ins."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults import boards, encoders, mechanics, network, sensing
from rtf.simulator.faults.base import Fault
from rtf.testing import plugins

if TYPE_CHECKING:
    from collections.abc import Mapping

KINDS: Mapping[str, type[Fault]] = {
    kind.kind: kind for layer in (mechanics, encoders, boards, sensing, network) for kind in layer.KINDS
}
#: Names come from the network, too: one with a slash would be a file anywhere.
_NAME = re.compile(r"[\w-]+")


def find_kind(name: str) -> type[Fault]:
    """The kind of a name: the simulator's own, or a plug-in. Raises RefusedError where there is none."""
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
