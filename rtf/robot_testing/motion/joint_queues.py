"""Queues of joints: which joints of a part may make large moves at the same time without a collision.

The queues of a part are worked through in parallel. A queue is a sequence of groups, and the joints of a group move
together. Arms, legs, neck and torso have one queue: first single joints, and at its end wrists and ankles together.
Joints that stay within the outline of the part, or reach nothing, have queues of their own: the fingers of an open
hand, and the eyes. The joints are told apart by the names of the iCub's axes; an unknown name is a single joint of the
first queue.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

#: The groups of each further queue: patterns of the names of their joints.
_QUEUES: tuple[tuple[re.Pattern[str], ...], ...] = (
    (re.compile(r"thumb"), re.compile(r"finger|index|middle|ring|pinky|little")),
    (re.compile(r"eye"),),
)
#: The last groups of the first queue.
_SMALL = (re.compile(r"wrist"), re.compile(r"ankle"))


def queues(names: Sequence[str], joints: Iterable[int]) -> list[list[list[int]]]:
    """Return the queues of ``joints``, each a list of groups; ``names`` are those of all axes of the part."""
    left = list(joints)

    def taken(pattern: re.Pattern[str]) -> list[int]:
        found = [joint for joint in left if pattern.search(names[joint])]
        for joint in found:
            left.remove(joint)
        return found

    others = [[taken(pattern) for pattern in patterns] for patterns in _QUEUES]
    small = [taken(pattern) for pattern in _SMALL]
    first = [[joint] for joint in left] + small
    ordered = [[members for members in queue if members] for queue in (first, *others)]
    return [queue for queue in ordered if queue]
