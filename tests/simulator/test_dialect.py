"""A simulated robot has the ports and messages of its network's dialect, that of YARP 4 included."""

from __future__ import annotations

from contextlib import closing
from importlib.util import find_spec

import pytest

from icub import ICUB
from rtf import clock
from rtf.bottle import Dialect, Property
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.yarp4.client import ControlBoardServiceClient
from rtf.simulator.robot import SimulatedRobot

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


def test_a_client_of_yarp_4_drives_the_arm():
    """It moves the elbow, reads where it is, and sees it arrive, all in the simulator's time."""
    network = Network(LocalNames(), dialect=Dialect.YARP4, report=lambda _sentence: None)
    with (
        SimulatedRobot(ICUB, network=network, parts=("left_arm",), lockstep=True) as robot,
        clock.use(LockstepClock("/clock", "test", network=network)) as time,
        closing(ControlBoardServiceClient("client", network=network)) as arm,
    ):
        arm.open(Property({"remote": "/icubSim/left_arm", "local": "/client", "carrier": "tcp"}))
        assert arm.axes() == 16
        assert arm.axis_name(3) == "l_elbow"
        arm.set_reference_speeds(60.0, 3)
        arm.position_move(75.0, 3)
        assert not arm.motion_done(3)
        time.sleep(2.0)
        assert arm.motion_done(3)
        assert arm.encoders(3)[0] == pytest.approx(75.0, abs=0.5)
        assert robot.parts["left_arm"].encoders(3)[0] == pytest.approx(75.0, abs=0.5)
        assert arm.encoder_times(3)[0] == pytest.approx(time.now(), abs=0.011)


def test_ports_of_yarp_3_are_not_there():
    """With dialect 4 there is one RPC port, that of the service."""
    network = Network(LocalNames(), dialect=Dialect.YARP4, report=lambda _sentence: None)
    with SimulatedRobot(ICUB, network=network, parts=("torso",), lockstep=True):
        names = {contact.name for contact in network.names.list("/icubSim/torso")}
    assert names == {f"/icubSim/torso/{port}" for port in ("nws/rpc:i", "command:i", "state:o", "stateExt:o")}
