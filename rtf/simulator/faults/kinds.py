"""All kinds of faults by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.errors import RefusedError
from rtf.simulator.faults import boards, encoders, mechanics, network, sensing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.simulator.faults.base import Fault

KINDS: Mapping[str, type[Fault]] = {
    kind.kind: kind for layer in (mechanics, encoders, boards, sensing, network) for kind in layer.KINDS
}


def find_kind(name: str) -> type[Fault]:
    """The kind of a name. Raises RefusedError, naming those that there are."""
    if name not in KINDS:
        raise RefusedError(f"there is no fault {name!r}; there are {', '.join(KINDS)}")
    return KINDS[name]
