"""What a node answers to its master and to other nodes (http://wiki.ros.org/ROS/Slave_API)."""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.ros1.contents import Contents

_FAILED, _SUCCESS = 0, 1
#: Each publisher of a topic has a thread.
_MOST_PUBLISHERS = 1000


class Slave:
    """The functions of a node; each has the name of the caller as its first parameter."""

    def __init__(self, contents: Contents, shut_down: Callable[[], None]) -> None:
        self._contents, self._shut_down = contents, shut_down
        self._functions: dict[str, Callable[..., Any]] = {
            "getBusInfo": list,
            "getBusStats": lambda: [[], [], []],
            "getMasterUri": lambda: contents.master.uri,
            "getPid": os.getpid,
            "getPublications": contents.published,
            "getSubscriptions": contents.subscribed,
            "paramUpdate": lambda _name, _value: 0,
            "publisherUpdate": self._publisher_update,
            "requestTopic": self._request_topic,
            "shutdown": self._shutdown,
        }

    def answer(self, function: str, parameters: Sequence[Any]) -> list[Any]:
        """Return a code, a sentence and a value. Raises LookupError, and TypeError for wrong parameters."""
        if function not in self._functions:
            raise LookupError(f"{self._contents.path} has no function {function[:80]}")
        try:
            return [_SUCCESS, "", self._functions[function](*parameters[1:])]
        except _Refusal as refusal:
            return [_FAILED, str(refusal), 0]

    def _publisher_update(self, topic: str, publishers: list[str]) -> int:
        if not isinstance(publishers, list) or not all(isinstance(one, str) for one in publishers):
            raise TypeError("publisherUpdate has a topic and a list of addresses")
        if len(publishers) > _MOST_PUBLISHERS:
            raise TypeError(f"{len(publishers)} publishers of {topic}; at most {_MOST_PUBLISHERS} are connected")
        subscription = self._contents.subscription(topic)
        if subscription is not None:
            subscription.update(publishers)
        return 0

    def _request_topic(self, topic: str, protocols: list[list[str]]) -> list[Any]:
        if topic not in self._contents.publishers:
            raise _Refusal(f"{self._contents.path} does not publish {topic}")
        if not any(isinstance(one, list) and one[:1] == ["TCPROS"] for one in protocols):
            raise _Refusal(f"{self._contents.path} publishes {topic} by TCPROS only")
        return ["TCPROS", *self._contents.tcpros]

    def _shutdown(self, why: str = "") -> int:
        """The master says so when another node of the same name registers."""
        self._contents.report(f"{self._contents.path} ends, as its master says: {why}")
        threading.Thread(target=self._shut_down, name="rtf-ros1-shutdown", daemon=True).start()
        return 0


class _Refusal(Exception):
    """A call that cannot be answered."""
