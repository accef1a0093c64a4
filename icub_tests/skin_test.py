"""Skin: each patch publishes at its rate, and each of its taxels is alive and not pressed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.middleware.types import VECTOR
from rtf.robot_testing import likely_causes
from rtf.robot_testing.robot_name import robot_model
from rtf.robot_testing.stream_test import RateTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.robot.interfaces import FloatArray

_TRIANGLE = 12  # taxels of a triangle
_LARGEST = 255.0
#: The fewest messages by which a constant reading is judged: less than a second of the skin's 50 Hz may well have none.
_FEWEST = 50
#: The ports of skinManager, which publishes the readings minus their rest.
_COMPENSATED = "_comp"
_NAMED = 10  # taxels that a text names


class SkinTest(RateTest):
    """Checks every taxel of the skin at rest: its range, whether it is pressed, and how its reading changes.

    Nothing may touch the skin meanwhile. Readings are whole numbers from 0 to 255, about 240 at rest, and fall with
    the pressure; their noise changes them by a count now and then. A patch with triangles that are not mounted needs
    ``max_dead`` and ``max_pressed``: their taxels are constant.
    """

    aliases = ("skinTest", "skin")
    tags = ("sensors", "skin")
    judged_sensors = ("skin",)

    port = Parameter(str, "the port of a patch; none: all of the robot", default="", aliases=("portname",))
    time = Parameter(float, "how long it is read", unit="s", default=2.0, low=0.1)
    frequency = Parameter(float, "messages a second", unit="Hz", default=50.0, low=0.01)
    tolerance = Parameter(float, "tolerance of the rate", unit="Hz", default=2.5, low=0.0)
    triangles = Parameter(int, "triangles of a patch; 0: as in robot.toml, or any number", default=0, low=0)
    # An eighth of the range below the rest of the iCub's skin, 240.
    least_rest = Parameter(
        float, "least median of the readings of a taxel that nothing touches", default=210.0, low=0.0, high=_LARGEST
    )
    max_dead = Parameter(int, "taxels of a patch whose reading may stay the same", unit="count", default=0, low=0)
    max_pressed = Parameter(int, "taxels of a patch that may be below least_rest", unit="count", default=0, low=0)

    # The reading of a healthy taxel changes by a count or two.
    noise = Parameter(
        float, "greatest standard deviation of the reading of a taxel that nothing touches", unit="count", default=5.0,
        low=0.0,
    )  # fmt: skip

    def setup(self) -> None:
        """Find the patches."""
        super().setup()
        skin = robot_model(self).sensors.skin
        self.described = {f"/{self.robot_name}/{patch.port}": patch.triangles for patch in skin.values()}
        begin = f"/{self.robot_name}/skin/"
        found = [name for name in self.known_ports("") if name.startswith(begin) and _is_patch(name, begin)]
        self.ports = [self.port] if self.port else sorted({*found, *self.described})
        self.assert_error_if_false(
            self.ports, f"no skin below {begin} is registered at the name server; give its port as portname"
        )

    def run(self) -> None:
        """Read all patches for some time, and judge each."""
        there = [name for name in self.ports if self.open_stream(name, keep=True)]
        if there:
            self.listen(self.time)
        for name in there:
            with self.subresult(name):
                self._judge(name)

    def _judge(self, name: str) -> None:
        found = self.judged(self.listener.recorders[name].messages, self.time, name)
        self.judge(found, self.frequency, self.tolerance)
        rows = [VECTOR.decode(one.data, one.dialect) for one in found]
        sizes = sorted({row.size for row in rows})
        self.assert_fail_if_true(len(sizes) > 1, f"the number of taxels of {name} differs between messages: {sizes}")
        self._judge_size(name, sizes[0])
        readings = np.array(rows)
        self._judge_range(name, readings)
        self._judge_rest(name, np.median(readings, axis=0))
        self._judge_changes(name, readings)

    def _judge_size(self, name: str, size: int) -> None:
        triangles = self.triangles or self.described.get(name, 0)
        wanted = _TRIANGLE * triangles or None
        hint = f"{name} has {size} taxels; {likely_causes('skin size')}"
        self.measure("taxels", size, "count", low=wanted, high=wanted, hint=hint)
        self.check_fail_if_true(
            size == 0 or size % _TRIANGLE, f"{name} has {size} taxels, which are no triangles of {_TRIANGLE}"
        )

    def _judge_range(self, name: str, readings: FloatArray) -> None:
        with np.errstate(invalid="ignore"):  # NaN is no reading, either
            wrong = ~((readings >= 0.0) & (readings <= _LARGEST) & (readings == np.round(readings)))
        self.assert_fail_if_true(
            wrong.any(), f"{_texts(wrong.any(axis=0))} of {name}: readings that are no whole numbers from 0 to 255"
        )

    def _judge_rest(self, name: str, rest: FloatArray) -> None:
        pressed = rest < self.least_rest
        self.record(f"rest of {name}", taxel=(np.arange(rest.size), ""), reading=(rest, "count"))
        lowest = int(np.argmin(rest))
        self.measure("lowest rest", float(rest[lowest]), "count")
        hint = (
            f"{_texts(pressed)} of {name}: pressed, or without its rest; taxel {lowest} reads {rest[lowest]:g}; "
            f"{likely_causes('taxel pressed')}"
        )
        self.measure("pressed taxels", int(pressed.sum()), "count", high=self.max_pressed, hint=hint)

    def _judge_changes(self, name: str, readings: FloatArray) -> None:
        constant = np.ptp(readings, axis=0) == 0.0
        if len(readings) < _FEWEST and not constant.all():
            self.inconclusive(
                f"{len(readings)} messages of {name} are too few to find dead taxels, {_FEWEST} are needed; longer time"
            )
        hint = f"{_texts(constant)} of {name}: the reading does not change; {likely_causes('taxel')}"
        self.measure("dead taxels", int(constant.sum()), "count", high=self.max_dead, hint=hint)
        if len(readings) < _FEWEST:
            return
        noise = readings.std(axis=0)
        hint = f"{_texts(noise > self.noise)} of {name}: the reading is noisy; {likely_causes('taxel noise')}"
        self.measure("greatest noise", float(noise.max()), "count", high=self.noise, hint=hint)
        for first, second in _equal_triangles(readings):
            self.check_fail_if_true(
                True,
                f"{name}: triangles {first} and {second} have shown the same {len(readings)} times; "
                f"{likely_causes('triangles alike')}",
            )


def _is_patch(name: str, begin: str) -> bool:
    """Return whether a port streams raw readings; the ports below it answer requests."""
    rest = name.removeprefix(begin)
    return "/" not in rest and not rest.endswith(_COMPENSATED)


def _equal_triangles(readings: FloatArray) -> list[tuple[int, int]]:
    """Return the triangles whose readings change and are always those of an earlier one, each after that one."""
    seen: dict[bytes, int] = {}
    found: list[tuple[int, int]] = []
    for number in range(readings.shape[1] // _TRIANGLE):
        own = readings[:, number * _TRIANGLE : (number + 1) * _TRIANGLE]
        if np.ptp(own, axis=0).any():
            first = seen.setdefault(own.tobytes(), number)
            found += [(first, number)] if first != number else []
    return found


def _texts(which: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> str:
    """Return the numbers of taxels as a text, each with its triangle."""
    numbers = np.flatnonzero(which).tolist()
    named = ", ".join(f"taxel {number} (triangle {number // _TRIANGLE})" for number in numbers[:_NAMED])
    return f"{named} and {len(numbers) - _NAMED} more" if len(numbers) > _NAMED else named
