"""Queues of joints: which joints of a part may make large moves at the same time without a collision.

The queues of a part are worked through in parallel. A queue is a sequence of groups, and the joints of a group move
together. The robot's model has the groups (``together`` of a part): joints that stay within the outline of the part, or
reach nothing, such as the fingers of an open hand. A joint that is in none is a single joint of the first queue.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence


def queues(
    names: Sequence[str], joints: Iterable[int], together: Sequence[Sequence[Sequence[str]]] = ()
) -> list[list[list[int]]]:
    """Return the queues of ``joints``, each a list of groups; ``names`` are those of all axes of the part.

    The groups of the first queue of ``together`` come after all single joints.
    """
    left = list(joints)

    def taken(group: Sequence[str]) -> list[int]:
        found = [joint for joint in left if names[joint] in group]
        for joint in found:
            left.remove(joint)
        return found

    grouped = [[taken(group) for group in queue] for queue in together] or [[]]
    first = [[joint] for joint in left] + grouped[0]
    ordered = [[members for members in queue if members] for queue in (first, *grouped[1:])]
    return [queue for queue in ordered if queue]


def one_motor_at_a_time(
    queues: Sequence[Sequence[Sequence[int]]], sharing: Callable[[int], Collection[int]]
) -> list[list[list[int]]]:
    """Return the queues with the groups split, so that no two joints of a group move the same motor.

    ``sharing`` returns the joints that share the motors of a joint.
    """
    return [[apart for group in queue for apart in _apart(group, sharing)] for queue in queues]


def _apart(group: Sequence[int], sharing: Callable[[int], Collection[int]]) -> list[list[int]]:
    found: list[list[int]] = []
    for joint in group:
        free = next((members for members in found if not {*sharing(joint)} & {*members}), None)
        if free is None:
            found.append([joint])
        else:
            free.append(joint)
    return found
