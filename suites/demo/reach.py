"""A native test that takes its time: an arm reaches a position, and the page draws it while it does."""

import random

from rtf import clock
from rtf.testing import Parameter, TestCase


class Reach(TestCase):
    """A joint follows a minimum-jerk reference; the remaining distance at the end is measured."""

    tags = ("demo", "motion")

    distance = Parameter(float, "way to go", unit="deg", default=40.0, low=1.0, high=90.0)
    duration = Parameter(float, "time to get there", unit="s", default=1.2, low=0.1, high=10.0)
    tolerance = Parameter(float, "largest distance from the target at the end", unit="deg", default=1.0, low=0.0)

    def run(self):
        """Move two joints, one after the other; the second is slower than it should be, but not too slow."""
        noise = random.Random(7)  # noqa: S311 - the same noise each time
        for joint, lag in (("shoulder", 0.06), ("elbow", 0.12)):
            with self.subresult(joint):
                self.move(joint, lag, noise)

    def move(self, joint, lag, noise):
        """Follow the reference with a first-order lag, fifty times a second."""
        position, period = 0.0, 0.02
        steps = round(1.25 * self.duration / period)
        largest = 0.0
        with self.series("reach", time="s", reference="deg", position="deg", velocity="deg/s") as series:
            for step in range(steps):
                share = min(1.0, step * period / self.duration)
                reference = self.distance * share**3 * (10 - 15 * share + 6 * share**2)
                before, position = position, position + (reference - position) * period / lag
                series.append(step * period, reference, position + noise.gauss(0, 0.05), (position - before) / period)
                largest = max(largest, abs(reference - position))
                self.progress(step / steps, joint)
                clock.sleep(period)
        self.measure("distance left", self.distance - position, "deg", low=-1.0, high=self.tolerance, marginal=0.5)
        self.measure("largest lag", largest, "deg", high=12.0, marginal=2.0)
