"""Services of ROS 2 as rmw_cyclonedds has them: a topic for requests, ``rq/NAMERequest``, and one for ``rr/NAMEReply``.

Both ends have an identifier in their user data, by which a server knows that a client can hear the response already.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from cyclonedds.core import DDSException

from rtf import clock
from rtf.ros2.errors import NoServiceError, Ros2Error
from rtf.ros2.readers import taken
from rtf.ros2.service_types import A, Q

if TYPE_CHECKING:
    from collections.abc import Callable

    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader

T = TypeVar("T")
#: Seconds that a server waits until a client's reader is known, as rmw_cyclonedds does.
_MATCHING = 0.1


class Ends:
    """The writer and the reader of one end of a service; ``changed`` is set when something has happened to them."""

    def __init__(self, writer: DataWriter[Any], reader: DataReader[Any], changed: threading.Event) -> None:
        self.writer, self.reader, self.changed = writer, reader, changed
        self.closed = False

    def close(self) -> None:
        """Have all who wait return."""
        self.closed = True
        self.changed.set()


class ServiceServer(Generic[Q, A]):
    """Answers requests in a thread of its own, one after the other, until the node is closed."""

    def __init__(self, name: str, ends: Ends, answer: Callable[[Q], A], report: Callable[[str], None]) -> None:
        self._name, self._ends, self._answer, self._report = name, ends, answer, report
        self._thread = threading.Thread(target=self._run, name=f"rtf-service {name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ends.close()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        ends = self._ends
        while True:
            ends.changed.clear()
            if ends.closed:
                return
            for request in taken(ends.reader, self._report):
                self._serve(request)
            ends.changed.wait()

    def _serve(self, request: Q) -> None:
        try:
            response = self._answer(request)
            response.client, response.sequence = request.client, request.sequence
            self._await_reader(request)
            self._ends.writer.write(response)
        except Exception as error:  # noqa: BLE001 - whatever it is, the server goes on
            self._report(f"the service {self._name} could not answer: {type(error).__name__}: {error}")

    def _await_reader(self, request: Q) -> None:
        """Wait until the client of a request is known to read responses, or its time is over."""
        ends, handle = self._ends, request.sample_info.publication_handle  # type: ignore[attr-defined]
        source = ends.reader.get_matched_publication_data(handle)
        deadline = clock.Deadline.after(_MATCHING)
        while source is not None and not (ends.closed or deadline.expired):
            ends.changed.clear()
            if source.participant_key in _participants(ends.writer):
                break
            ends.changed.wait(deadline.remaining())
        ends.changed.set()  # what else has happened meanwhile is looked at


class ServiceClient(Generic[Q, A]):
    """Calls a service. It may be used by any thread; calls are made one after the other."""

    def __init__(self, name: str, ends: Ends, report: Callable[[str], None]) -> None:
        self.name, self._ends, self._report = name, ends, report
        self._client = int.from_bytes(ends.writer.guid.bytes[8:], "little")
        self._calling = threading.Lock()
        self._sequence = 0

    def call(self, request: Q, timeout: float = 5.0) -> A:
        """Return the response. Raises NoServiceError if there is no server, or no response within ``timeout`` s."""
        ends, deadline = self._ends, clock.Deadline.after(timeout)
        with self._calling:
            self._await(self._is_there, deadline, f"there is no service {self.name}; is its node running?")
            self._sequence += 1
            request.client, request.sequence = self._client, self._sequence
            try:
                ends.writer.write(request)
            except DDSException as error:
                raise Ros2Error(f"the service {self.name} cannot be called: {error}") from None
            return self._await(self._response, deadline, f"the service {self.name} did not answer in {timeout:g} s")

    def close(self) -> None:
        """Have a call that waits fail, and wait until it has."""
        self._ends.close()
        with self._calling:
            pass

    def _is_there(self) -> bool:
        return bool(self._ends.writer.get_matched_subscriptions() and self._ends.reader.get_matched_publications())

    def _response(self) -> A | None:
        """Return the response to the present call, if it has arrived. Those to other clients come as well."""
        for response in taken(self._ends.reader, self._report):
            if (response.client, response.sequence) == (self._client, self._sequence):
                found: A = response
                return found
        return None

    def _await(self, look: Callable[[], T | None], deadline: clock.Deadline, why: str) -> T:
        ends = self._ends
        while True:
            ends.changed.clear()
            if ends.closed:
                raise Ros2Error(f"the node of the client of {self.name} was closed")
            if found := look():
                return found
            if deadline.expired:
                raise NoServiceError(why)
            ends.changed.wait(deadline.remaining())


def _participants(writer: DataWriter[Any]) -> set[object]:
    """Return the participants that read what a writer sends."""
    found = (writer.get_matched_subscription_data(handle) for handle in writer.get_matched_subscriptions())
    return {one.participant_key for one in found if one is not None}
