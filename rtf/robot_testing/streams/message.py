"""A recorded message of a stream."""

from __future__ import annotations

import math
from typing import NamedTuple

from rtf.bottle import Dialect


class Message(NamedTuple):
    """A recorded message: number and time of its stamp (-1 and NaN without one), arrival time, and size in bytes.

    Times are of the robot's clock, in s. ``digest`` is equal for equal contents. ``content`` is the result of the
    recorder's ``look``, or the bytes if they are kept, or None. ``dialect`` is that of the connection, for bytes that
    are kept.
    """

    number: int
    time: float
    arrival: float
    size: int
    digest: int
    content: object
    dialect: Dialect = Dialect.YARP3

    @property
    def data(self) -> bytes:
        """The bytes; empty if they were not kept."""
        return self.content if isinstance(self.content, bytes) else b""

    @property
    def moment(self) -> float:
        """The time of the stamp; the arrival time without a stamp."""
        return self.arrival if math.isnan(self.time) else self.time
