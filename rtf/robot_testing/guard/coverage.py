"""The table of what a guard watches, for the report of a run: per joint, with the reasons for what is not watched."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray


#: More neighbours than this are written as a span.
_FEW = 2


def coverage_table(
    place: str, names: Sequence[str], watched: Mapping[str, NDArray[np.bool_]], missing: Mapping[str, str]
) -> str:
    """Return the table of a part: a row for all joints that are watched alike, and one for what is not watched.

    ``watched`` has for each watch the joints that it covers, ``missing`` the reasons why others do not work at all.
    """
    rows: dict[tuple[str, ...], list[str]] = {}
    for joint, name in enumerate(names):
        kinds = tuple(watch for watch, covered in watched.items() if covered[joint] and watch not in missing)
        rows.setdefault(kinds, []).append(name)
    lines = [f"{place} is watched:"]
    for kinds, joints in rows.items():
        lines.append(f"  {_span(joints, names)}: {', '.join(kinds) or 'nothing'}")
    if missing:
        lines.append(f"  not watched: {'; '.join(f'{watch} ({why})' for watch, why in missing.items())}")
    return "\n".join(lines)


def _span(joints: Sequence[str], names: Sequence[str]) -> str:
    """Return joints as text; neighbours as a span."""
    if len(joints) == len(names):
        return "all joints"
    first = names.index(joints[0])
    together = tuple(joints) == tuple(names[first : first + len(joints)])
    return f"{joints[0]} to {joints[-1]}" if together and len(joints) > _FEW else ", ".join(joints)
