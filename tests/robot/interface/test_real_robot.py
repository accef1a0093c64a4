"""The recorded robot with its real devices: boards, a camera and an inertial sensor answer requests on their ports."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.middleware.ports.remote import exists
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.robot.interface.robot_interface import RobotInterface
from rtf.robot.interface.robot_reader import read_robot
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Running

    from rtf.middleware.ports.network import Network

RECORDED = Path(__file__).parents[2] / "data" / "yarp_config" / "fakerobot.xml"


def test_the_recorded_robot_runs(network: Network, started: Callable[[RobotInterface], Running]):
    """The robot registers the ports of the real program, answers on them, and unregisters them at its end."""
    logged: list[tuple[str, str]] = []
    robot = read_robot(RECORDED).robot
    running = started(RobotInterface(robot, network=network, log=lambda *words: logged.append(words)))
    eventually(lambda: running.interface.ready or running.outcome, f"it does not become ready: {logged}")
    assert running.outcome is None, logged
    for part, axes in (("head", 6), ("left_arm", 16)):
        with RpcClient(f"/asks/{part}", f"/icubSim/{part}/rpc:i", network=network) as client:
            answer = client.call(Bottle.parse("[get] [axes]"), timeout=10)
            assert answer[:3] == Bottle.parse(f"[is] [axes] {axes}")
    ports = [contact.name for contact in network.names.list("/icubSim")]
    assert {"/icubSim/head/stateExt:o", "/icubSim/cam/left", "/icubSim/inertial/measures:o"} <= {*ports}
    assert all(exists(network, Contact(name)) for name in ports)
    running.interface.quit()
    outcome = running.end()
    assert outcome.good, outcome.failures
    assert [contact.name for contact in network.names.list("/icubSim")] == []
