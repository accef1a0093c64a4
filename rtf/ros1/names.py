"""Names of nodes, topics and services of ROS 1, and those that YARP gives to its ports for them.

A port of YARP (until 3.9) whose name is ``TOPIC[CATEGORY]@NODE`` is a topic or a service of the node:
``/chatter+@/talker`` publishes, ``-`` subscribes, ``-1`` is a service, and ``+1`` calls one. The same are
``NODE=[CATEGORY]/TOPIC`` and ``NODE[CATEGORY]#TOPIC``; ``~TYPE`` at the end is the type.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from rtf.ros1.errors import Ros1Error

_BASE = re.compile(r"[A-Za-z]\w*", re.ASCII)
_NAME = re.compile(r"(/[A-Za-z]\w*)+", re.ASCII)
_CATEGORIES = ("+1", "-1", "+", "-")


def full_name(name: str, namespace: str, node: str) -> str:
    """Return a name that begins with ``/``: others are in the namespace, or with ``~`` below the node's name.

    Raises Ros1Error for what is no name.
    """
    found = name
    if name.startswith("~"):
        found = f"{node}/{name[1:].removeprefix('/')}"
    elif not name.startswith("/"):
        found = f"{namespace.rstrip('/')}/{name}"
    if not _NAME.fullmatch(found):
        raise Ros1Error(f"{name[:80]!r} is no name: letters, digits and '_', and '/' between them")
    return found


def node_name(name: str, namespace: str) -> str:
    """Return the full name of a node. Raises Ros1Error."""
    if not _BASE.fullmatch(name):
        raise Ros1Error(f"{name[:80]!r} is no name of a node: letters, digits and '_'")
    if namespace != "/" and not _NAME.fullmatch(namespace):
        raise Ros1Error(f"{namespace[:80]!r} is no namespace; write it as in /robot")
    return f"{namespace.rstrip('/')}/{name}"


@dataclass(frozen=True, slots=True)
class NestedName:
    """The name of a port of YARP that is a topic or service. ``category`` is ``+``, ``-``, ``+1``, ``-1`` or empty."""

    topic: str
    category: str
    node: str
    kind: str = ""

    @classmethod
    def of(cls, name: str) -> NestedName:
        """Return the parts of a name, such as ``/chatter+@/talker``. Raises Ros1Error for one without a topic."""
        plain, _, kind = name.partition("~")
        if "@" in plain:
            head, _, node = plain.partition("@")
            topic, category = _with_category(head)
        elif "=" in plain:
            node, _, rest = plain.partition("=")
            category = next((one for one in _CATEGORIES if rest.startswith(one)), "")
            topic = rest[len(category) :]
        else:
            head, _, topic = plain.partition("#")
            node, category = _with_category(head)
        topic = f"/{topic.removeprefix('/')}"
        if not _NAME.fullmatch(topic) or (node and not _NAME.fullmatch(f"/{node.removeprefix('/')}")):
            raise Ros1Error(f"{name[:80]!r} is no name of a topic; write it as in /chatter+@/talker")
        return cls(topic, category, node, kind)


def _with_category(text: str) -> tuple[str, str]:
    """Return a name, and the category at its end."""
    category = next((one for one in _CATEGORIES if text.endswith(one)), "")
    return text[: len(text) - len(category)], category
