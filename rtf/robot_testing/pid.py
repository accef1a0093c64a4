"""A sampled PID controller, as tests close loops with themselves."""

from __future__ import annotations


class DiscretePid:
    """A PID controller of one value; its output is within ``limit`` to both sides.

    It goes by the time at which a value was true, not by the time at which anybody heard of it: what comes late, twice
    or behind a later one does it no harm. The integral is that of the trapezoids, with what the limit cuts off taken
    back (tracking time 1 s). The derivative is of the value and of the share ``kick`` of the reference, less of which
    makes a step gentler and delays less harmful; it goes through a filter of the first order ten times as fast as the
    derivative's own time. A controller without ``ki`` has no integral, one without ``kp`` no derivative.
    """

    def __init__(self, kp: float, ki: float, kd: float, *, limit: float, kick: float = 1.0) -> None:
        self._kp, self._ki, self._kd = kp, ki, kd
        self._limit = limit
        self._kick = kick
        self._filter = abs(kd / kp) / _FILTER if kp else 0.0  # s
        self.start(0.0)

    def start(self, output: float) -> None:
        """Begin anew, with an output that holds what is controlled."""
        self._constant = output
        self._integral = 0.0
        self._derivative = 0.0
        self._last: tuple[float, float, float] | None = None  # reference and value of the newest, and when that was
        self._change = 0.0  # of the integral a second
        self._cut = 0.0  # what the limit has taken from the output

    def output(self, reference: float, value: float, time: float) -> float:
        """The output for a value that was true at ``time`` (s); one that is older than the last changes nothing."""
        setpoint, newest, since = self._last or (reference, value, time)
        passed = time - since
        if passed < 0:
            value, passed = newest, 0.0
        if passed and self._kp:
            self._differentiate(self._kick * (reference - setpoint) - (value - newest), passed)
        if passed or self._last is None:
            self._last = reference, value, time
        error = reference - value
        change = self._ki * error + self._cut / _TRACKING
        if self._ki:
            self._integral += passed / 2 * (self._change + change)
        wanted = self._constant + self._kp * error + self._integral + self._derivative
        given = max(-self._limit, min(self._limit, wanted))
        self._change, self._cut = change, given - wanted
        return given

    def _differentiate(self, change: float, passed: float) -> None:
        """Bilinear: ``(2 - 2/z) / ((T + 2 tau) + (T - 2 tau)/z)`` of the derivative gain times what it is of."""
        tau = self._filter
        self._derivative = (2 * self._kd * change - (passed - 2 * tau) * self._derivative) / (passed + 2 * tau)


#: How much faster than the derivative its filter is, and how soon the integral learns of the limit (s).
_FILTER, _TRACKING = 10.0, 1.0
