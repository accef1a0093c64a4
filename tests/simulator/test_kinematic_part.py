"""The face is a control board whose joints follow its trajectories in simulated time."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)
JAW, HOME, BENT = 1, 0.0, -20.0


def test_it_moves_in_the_time_of_the_simulation_and_is_reset_with_it():
    """A move is done when the simulated time says so, and a reset brings the joints back to zero."""
    from icub import ICUB
    from rtf.simulator.kinematic_part import KinematicPart

    from .rig import Rig

    rig = Rig()
    face = KinematicPart(ICUB.part("face"), rig.simulation)
    face.set_reference_speeds(20.0, JAW)
    face.position_move(BENT, JAW)
    rig.run(0.9)
    assert not face.motion_done(JAW)
    rig.run(0.2)
    assert face.motion_done(JAW)
    assert face.encoders(JAW)[0] == pytest.approx(BENT)
    rig.simulation.reset()
    assert face.encoders(JAW)[0] == HOME
    face.position_move(HOME, JAW)
    assert not face.motion_done()
    rig.run(0.1)
    assert face.motion_done()


@pytest.mark.parametrize("joints", [(10.0, -13.0, -20.0, -12.0, -25.0, 12.0), (15.0, 0.0, 0.0, 0.0, 0.0, 10.0)])
def test_it_reaches_what_the_test_files_of_the_robot_ask_for(joints: tuple[float, ...]):
    """Six joints, with limits beyond the targets of those files."""
    from icub import ICUB
    from rtf.simulator.kinematic_part import KinematicPart

    from .rig import Rig

    face = KinematicPart(ICUB.part("face"), Rig().simulation)
    face.position_move(joints)
    assert face.target_positions().tolist() == [*joints]
