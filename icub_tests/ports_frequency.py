"""Ports frequency: streams arrive at their rates, without losses."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, as_float
from rtf.robot_testing.stream_test import RateTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.bottle import Value

#: Endings of the robot's own streams.
_ENDINGS = ("/state:o", "/stateExt:o", "/analog:o", "/measures:o", "/inertial")
_OPTIONAL = "optional"


class _Expected(NamedTuple):
    name: str
    rate: float
    tolerance: float
    optional: bool
    topic: bool = False


class PortsFrequency(RateTest):
    """Records many ports at the same time, and judges rate, jitter, gaps, losses and duplicates of each.

    By default these are all states and sensors of the robot that are registered at the name server. Rates are by the
    stamps of the sender, so the real-time factor of a simulation does not matter. Messages on topics of ROS 2 have no
    numbers: what is lost shows as a gap.
    """

    aliases = ("PortFrequencyTest", "portsFrequency", "ports-frequency", "PortFrequency")
    tags = ("streams",)

    port = Parameter(str, "one port; none: those of ports", default="", aliases=("portname",))
    ports = Parameter(
        Bottle, "the ports: (name rate tolerance) in Hz, with the word optional if it may be missing", default=Bottle(),
        key="PORTS", aliases=("ports",),
    )  # fmt: skip
    topics = Parameter(
        Bottle, "topics of ROS 2 in the domain of ROS_DOMAIN_ID, in the same form; without ports these alone",
        default=Bottle(), key="TOPICS", aliases=("topics",),
    )  # fmt: skip
    time = Parameter(float, "how long each is judged", unit="s", default=2.0, low=0.1)
    frequency = Parameter(float, "the default rate of a port", unit="Hz", default=100.0, low=0.01)
    # As in the parameter files of the iCub.
    tolerance = Parameter(float, "the default tolerance of a rate", unit="Hz", default=5.0, low=0.0)

    def parameter_problems(self) -> list[str]:
        """Add the errors of a section [PORTS] that is empty, or has a wrong line."""
        problems = []
        for section, group in (("PORTS", self.ports), ("TOPICS", self.topics)):
            source = self.parameter_source(section)
            found = [problem for line in self.lines(group) for problem in _wrong_line(line, section)]
            if not len(group) and source != "default":
                found.append(f"[{section}] names nothing; leave it out, and all streams of the robot are judged")
            problems += [f"{problem} ({source})" for problem in found]
        return [*problems, *super().parameter_problems()]

    def setup(self) -> None:
        """Choose the ports."""
        super().setup()
        self.expected = self._expected()
        self.assert_error_if_false(
            self.expected,
            f"no stream of /{self.robot_name} is registered at the name server; start the robot, or name the ports in "
            "[PORTS]",
        )

    def _expected(self) -> list[_Expected]:
        if self.port:
            return [_Expected(self.port, self.frequency, self.tolerance, optional=False)]
        if len(self.ports) or len(self.topics):
            return [
                _Expected(str(name), as_float(rate), as_float(tolerance), optional=bool(words), topic=topic)
                for group, topic in ((self.ports, False), (self.topics, True))
                for name, rate, tolerance, *words in self.lines(group)
            ]
        return [_Expected(name, self.frequency, self.tolerance, optional=False) for name in self.known_ports(*_ENDINGS)]

    def run(self) -> None:
        """Record all ports, and judge each."""
        there = [one for one in self.expected if self.open_stream(one.name, optional=one.optional, topic=one.topic)]
        if there:
            self.listen(self.time)
        for place, one in enumerate(there):
            self.progress(place / len(there), one.name)
            with self.subresult(one.name):
                found = self.judged(self.listener.recorders[one.name].messages, self.time, one.name)
                self.judge(found, one.rate, one.tolerance)


def _wrong_line(parts: list[Value], section: str) -> list[str]:
    """Return the errors of a line of [PORTS] or [TOPICS]."""
    numbers = [float(part) for part in parts[1:3] if isinstance(part, int | float)]
    if not parts or not isinstance(parts[0], str) or len(numbers) != 2 or parts[3:] not in ([], [_OPTIONAL]):  # noqa: PLR2004
        hint = f"a line has a port, its rate and tolerance in Hz, and optionally the word {_OPTIONAL}, such as: "
        return [f"[{section}] {Bottle(parts).to_text()}: {hint}/icub/head/state:o 100 5"]
    rate, tolerance = numbers
    if not rate > 0 or not tolerance >= 0:
        return [f"[{section}] {parts[0]}: {rate:g} Hz with a tolerance of {tolerance:g} Hz is not a valid rate"]
    return []
