"""A native test: joints follow a sinusoid; each is judged by its own tracking error."""

import math

from rtf.testing import Parameter, TestCase


class SineTracking(TestCase):
    """Joints follow a sinusoidal reference within a tolerance."""

    tags = ("demo", "motion")

    joints = Parameter(int, "number of joints", default=3, low=1, high=16)
    amplitude = Parameter(float, "amplitude of the reference", unit="deg", default=10.0, low=0.1, high=30.0)
    tolerance = Parameter(float, "largest root-mean-square error allowed", unit="deg", default=0.5, low=0.0)
    swapped = Parameter(int, "the joint whose encoder has the wrong sign; -1 for none", default=-1)

    def run(self):
        """Drive each joint through one period."""
        for joint in range(self.joints):
            self.progress(joint / self.joints, f"joint {joint}")
            with self.subresult(f"joint {joint}"):
                self.follow(joint)

    def follow(self, joint):
        """Let one joint follow the reference with a lag of 10 ms, and judge its error."""
        times = [step * 0.01 for step in range(101)]
        sign = -1.0 if joint == self.swapped else 1.0
        reference = [self.amplitude * math.sin(2 * math.pi * t) for t in times]
        measured = [sign * self.amplitude * math.sin(2 * math.pi * (t - 0.002)) for t in times]
        error = math.sqrt(sum((a - b) ** 2 for a, b in zip(reference, measured, strict=True)) / len(times))
        self.record("tracking", time=(times, "s"), reference=(reference, "deg"), measured=(measured, "deg"))
        self.measure("rms error", error, "deg", high=self.tolerance, marginal=0.1)
