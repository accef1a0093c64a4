"""``gaze-control-icubSim.xml`` of icub-tests: its fixture starts a simulator and, for ``iKinGazeCtrl``, our program."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.testing.verdict import Verdict
from upstream_runs import run_upstream

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

TABLE = """
[iCub_SIM]
command = "rtf simulator --robot icubSim --parts head,torso,left_arm,right_arm --collision none --lockstep"
ready = "/icubSim/simulator/rpc:i"
provides = { YARP_ROBOT_NAME = "icubSim", RTF_ROBOT_MODEL = "icub", RTF_CLOCK = "lockstep:/clock" }
[yarprobotinterface]
missing = "Cartesian control is not tested here"
optional = true
[iKinCartesianSolver]
missing = "Cartesian control is not tested here"
optional = true
[iKinGazeCtrl]
command = "rtf gaze --clock lockstep:/clock"
parameters = true
ready = "/iKinGazeCtrl/rpc"
"""


def test_the_suite_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured):
    """The eyes come to both points and back, by the controller's word and by the encoders."""
    outcome = run_upstream(tmp_path, monkeypatch, "gaze-control-icubSim.xml", TABLE)
    assert outcome.verdict("GazeControlSimpleLookTest") is Verdict.PASSED, outcome.stderr + outcome.stdout
    angles = [one.value for one in measured(outcome, "GazeControlSimpleLookTest", "eyes from the point")]
    assert len(angles) == 3
    assert max(angles) <= 0.3
