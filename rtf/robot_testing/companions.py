"""Which joints of a part may move far at the same time, and which wait for each other: so that nothing collides.

A part is worked through in queues, all at once; a queue has rounds, one after the other; the joints of a round move
together. Arms, legs, neck and torso have one queue in which a single joint moves at a time, and wrists and ankles at
its end. What moves within the outline of the part, or cannot reach anything, has queues of its own: the fingers of an
open hand, and the eyes. It goes by the names of the iCub's axes; joints with other names share the queue of single
moves.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

#: The rounds of each queue beside the first one, by what the names of their joints contain.
_QUEUES: tuple[tuple[re.Pattern[str], ...], ...] = (
    (re.compile(r"thumb"), re.compile(r"finger|index|middle|ring|pinky|little")),
    (re.compile(r"eye"),),
)
#: Joints that move together in the first queue, where they come last.
_SMALL = (re.compile(r"wrist"), re.compile(r"ankle"))


def queues(names: Sequence[str], joints: Iterable[int]) -> list[list[list[int]]]:
    """The queues of these joints, each a list of rounds; ``names`` are those of all axes of the part."""
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
