"""A discrete PID controller for tests that close a control loop themselves."""

from __future__ import annotations


class DiscretePid:
    """A discrete PID controller of one value; its output is limited to ``-limit .. limit``.

    It uses the time at which a value was measured, not the time of its arrival: late, repeated and overtaken
    measurements do no harm. The integral is trapezoidal, with back-calculation as anti-windup (tracking time 1 s). The
    derivative is that of the measured value and of the share ``kick`` of the setpoint; a smaller share makes steps
    gentler and delays less harmful. It has a first-order filter with a tenth of the derivative time ``kd / kp``.
    Without ``ki`` there is no integral, without ``kp`` no derivative.
    """

    def __init__(self, kp: float, ki: float, kd: float, *, limit: float, kick: float = 1.0) -> None:
        self._kp, self._ki, self._kd = kp, ki, kd
        self._limit = limit
        self._kick = kick
        self._filter = abs(kd / kp) / _FILTER if kp else 0.0  # s
        self.start(0.0)

    def start(self, output: float) -> None:
        """Reset, with the output that holds the controlled value (bumpless transfer)."""
        self._constant = output
        self._integral = 0.0
        self._derivative = 0.0
        self._last: tuple[float, float, float] | None = None  # setpoint, value and time of the newest measurement
        self._change = 0.0  # rate of the integral, per s
        self._cut = 0.0  # excess of the output over the limit

    def output(self, setpoint: float, value: float, time: float) -> float:
        """Return the output for a value measured at ``time`` (s). A value older than the last one is ignored."""
        before, newest, since = self._last or (setpoint, value, time)
        passed = time - since
        if passed < 0:
            value, passed = newest, 0.0
        if passed and self._kp:
            self._differentiate(self._kick * (setpoint - before) - (value - newest), passed)
        if passed or self._last is None:
            self._last = setpoint, value, time
        error = setpoint - value
        change = self._ki * error + self._cut / _TRACKING
        if self._ki:
            self._integral += passed / 2 * (self._change + change)
        unlimited = self._constant + self._kp * error + self._integral + self._derivative
        limited = max(-self._limit, min(self._limit, unlimited))
        self._change, self._cut = change, limited - unlimited
        return limited

    def _differentiate(self, change: float, passed: float) -> None:
        """Bilinear transform of the filtered derivative: ``kd (2 - 2/z) / ((T + 2 tau) + (T - 2 tau)/z)``."""
        tau = self._filter
        self._derivative = (2 * self._kd * change - (passed - 2 * tau) * self._derivative) / (passed + 2 * tau)


#: Ratio of the derivative time to that of its filter, and the tracking time of the anti-windup (s).
_FILTER, _TRACKING = 10.0, 1.0
