"""Ports frequency: streams come at their rate, and all of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtf.bottle import Bottle, as_float
from rtf.robot_testing.stream_test import RateTest
from rtf.testing import Parameter

if TYPE_CHECKING:
    from rtf.bottle import Value

#: What the robot's own streams end with.
_ENDINGS = ("/state:o", "/stateExt:o", "/analog:o", "/measures:o", "/inertial")
_OPTIONAL = "optional"


class _Expected(NamedTuple):
    name: str
    rate: float
    tolerance: float
    optional: bool


class PortsFrequency(RateTest):
    """Listens to many ports at the same time; rate, jitter, gaps, losses and duplicates of each are judged.

    Without any named it is all of the robot's states and sensors that the name server knows. Rates are by the stamps of
    the sender, so a simulated robot may be as fast or as slow as it likes.
    """

    aliases = ("PortFrequencyTest", "portsFrequency", "ports-frequency", "PortFrequency")
    tags = ("streams",)

    port = Parameter(str, "one port; none: those of ports", default="", aliases=("portname",))
    ports = Parameter(
        Bottle, "the ports: (name rate tolerance) in Hz, and optional for one that need not be there", default=Bottle(),
        key="PORTS", aliases=("ports",),
    )  # fmt: skip
    time = Parameter(float, "how long each is judged", unit="s", default=2.0, low=0.1)
    frequency = Parameter(float, "the rate of ports of which nothing else is said", unit="Hz", default=100.0, low=0.01)
    # As in the parameter files of the iCub.
    tolerance = Parameter(float, "how far off a rate may be, likewise", unit="Hz", default=5.0, low=0.0)

    def parameter_problems(self) -> list[str]:
        """See the base; a section [PORTS] names ports, each on a line that can be understood."""
        problems = [problem for line in self.lines(self.ports) for problem in _wrong_line(line)]
        source = self.parameter_source("PORTS")
        if not len(self.ports) and source != "default":
            problems.append("[PORTS] names no port; leave it out, and all streams of the robot are judged")
        return [*(f"{problem} ({source})" for problem in problems), *super().parameter_problems()]

    def setup(self) -> None:
        """Find out which ports, and connect to all of them."""
        super().setup()
        self.expected = self._expected()
        self.assert_error_if_false(
            self.expected,
            f"the name server knows no stream of /{self.robot_name}; name them in [PORTS], or is its robot not there?",
        )

    def _expected(self) -> list[_Expected]:
        if self.port:
            return [_Expected(self.port, self.frequency, self.tolerance, optional=False)]
        if len(self.ports):
            return [
                _Expected(str(name), as_float(rate), as_float(tolerance), optional=bool(words))
                for name, rate, tolerance, *words in self.lines(self.ports)
            ]
        return [_Expected(name, self.frequency, self.tolerance, optional=False) for name in self.known_ports(*_ENDINGS)]

    def run(self) -> None:
        """Listen to all, and judge each."""
        there = [one for one in self.expected if self.open_stream(one.name, optional=one.optional)]
        if there:
            self.listen(self.time)
        for place, one in enumerate(there):
            self.progress(place / len(there), one.name)
            with self.subresult(one.name):
                found = self.judged(self.listener.recorders[one.name].messages, self.time, one.name)
                self.judge(found, one.rate, one.tolerance)


def _wrong_line(parts: list[Value]) -> list[str]:
    """What is wrong with a line of [PORTS]."""
    numbers = [float(part) for part in parts[1:3] if isinstance(part, int | float)]
    if not parts or not isinstance(parts[0], str) or len(numbers) != 2 or parts[3:] not in ([], [_OPTIONAL]):  # noqa: PLR2004
        hint = f"a line is a port, its rate and the tolerance in Hz, and perhaps {_OPTIONAL}, such as: "
        return [f"[PORTS] {Bottle(parts).to_text()}: {hint}/icub/head/state:o 100 5"]
    rate, tolerance = numbers
    if not rate > 0 or not tolerance >= 0:
        return [f"[PORTS] {parts[0]}: {rate:g} Hz with a tolerance of {tolerance:g} Hz is no rate"]
    return []
