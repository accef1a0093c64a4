"""Looking: the eyes go to points in front of the robot, and back."""

from __future__ import annotations

from rtf.robot.interfaces import FixationPoint
from rtf.robot_testing.gaze_test import GazeTest
from rtf.testing import Parameter

_SIZE = 3


class GazeControlSimpleLook(GazeTest):
    """Leads the eyes by their gaze controller to points in front of the robot, and back to where they looked.

    The way back is stopped, and goes on. Each motion is judged by the controller's word, and by the encoders with the
    kinematics of the robot: the angle between eyes and point, the duration, joints that do not follow, encoders that
    disagree. The ranges of the neck have to be the limits of its board.
    """

    aliases = ("GazeControlSimpleLookTest", "gaze-control-simple-look")
    tags = ("motion", "gaze")

    targets = Parameter(
        list[float],
        "points to look at, three numbers each, in the frame of the root",
        unit="m",
        default=[-0.4, 0.15, 0.45, -0.4, -0.15, 0.25],
    )

    # Between the eyes, which are there in 0.15 s, and the neck, which takes a second.
    stopped = Parameter(float, "when the motion back is stopped, before it goes on", unit="s", default=0.2, low=0.0)

    def parameter_problems(self) -> list[str]:
        problems = super().parameter_problems()
        given = self.parameter_values()["targets"]
        if not given or len(given) % _SIZE:
            problems.append(f"targets: {len(given)} numbers are no points ({self.parameter_source('targets')})")
        return problems

    def run(self) -> None:
        """Look at each point, then at that of the start."""
        self.judge_ranges()
        points = [self.targets[place : place + _SIZE] for place in range(0, len(self.targets), _SIZE)]
        for number, point in enumerate(points, 1):
            self.progress(number / (len(points) + 2), f"to point {number}")
            self.look(f"to point {number}", point)
        self.judge_controller_stop(
            lambda: self.control.look_at(FixationPoint(self.starting_point)), self.control.desired, self.stopped
        )
        self.progress(0.9, "back")
        self.look("back", self.starting_point)
