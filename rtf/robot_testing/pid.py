"""A sampled PID controller, as tests close loops with themselves."""

from __future__ import annotations


class DiscretePid:
    """A PID controller of one value, every ``period`` seconds; its output is within ``limit`` to both sides.

    The integral is that of the trapezoids, with what the limit cuts off taken back (tracking time 1 s); the derivative
    is of the error, through a filter of the first order ten times as fast as the derivative's own time. A controller
    without ``ki`` has no integral, one without ``kp`` no derivative.
    """

    def __init__(self, kp: float, ki: float, kd: float, *, period: float, limit: float) -> None:
        self._kp, self._ki, self._kd = kp, ki, kd
        self._period = period
        self._limit = limit
        self._filter = abs(kd / kp) / _FILTER if kp else 0.0  # s
        self.start(0.0)

    def start(self, output: float) -> None:
        """Begin anew, with an output that holds what is controlled."""
        self._constant = output
        self._integral = 0.0
        self._derivative = 0.0
        self._error: float | None = None
        self._change = 0.0  # of the integral a second
        self._cut = 0.0  # what the limit has taken from the output

    def output(self, reference: float, value: float) -> float:
        """The output of this period; to be called once in each."""
        error = reference - value
        before = error if self._error is None else self._error
        self._error = error
        derivative = self._differentiate(error, before) if self._kp else 0.0
        change = self._ki * error + self._cut / _TRACKING
        integral = self._integral + self._period / 2 * (self._change + change) if self._ki else 0.0
        wanted = self._constant + self._kp * error + integral + derivative
        given = max(-self._limit, min(self._limit, wanted))
        self._change, self._integral, self._cut = change, integral, given - wanted
        return given

    def _differentiate(self, error: float, before: float) -> float:
        """Bilinear: ``(2 - 2/z) / ((T + 2 tau) + (T - 2 tau)/z)`` of the derivative gain times the error."""
        period, tau = self._period, self._filter
        self._derivative = (2 * self._kd * (error - before) - (period - 2 * tau) * self._derivative) / (
            period + 2 * tau
        )
        return self._derivative


#: How much faster than the derivative its filter is, and how soon the integral learns of the limit (s).
_FILTER, _TRACKING = 10.0, 1.0
