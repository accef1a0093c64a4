"""The port of a robot interface: its answers in each phase, and those that were recorded."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest

from replaying import VERSIONS, receive, recordings, segments
from rtf.bottle import Bottle
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire import framing
from rtf.robot.interface.model import Phase, Robot
from rtf.robot.interface.program import make_service, open_service
from rtf.robot.interface.robot_interface import RobotInterface
from scripted_devices import action_xml as action
from scripted_devices import device_xml as device
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Bench, Running

    from rtf.middleware.ports.network import Network

#: The beginning of the recorded port's answers: its number, 10002.
_PORT = framing.yarp_number(10002)
CONVERSATIONS = [
    (version, number)
    for version in VERSIONS
    for number, talk in enumerate(recordings(version, "robot.json")["questions"])
    if bytes.fromhex(talk[1][1]) == _PORT
]


def test_something_was_recorded():
    """There are recorded conversations of every function in both releases, but for those that end the program."""
    assert len(CONVERSATIONS) >= 11


@pytest.mark.parametrize(("version", "number"), CONVERSATIONS, ids=str)
def test_answers_are_those_recorded(
    network: Network, started: Callable[[RobotInterface], Running], version: str, number: int
):
    """The service answers the recorded requests with the recorded bytes, but for its port number."""
    network.dialect = VERSIONS[version]
    running = started(RobotInterface(Robot("icubSim", "icubSim"), network=network))
    eventually(lambda: running.interface.ready, "it does not become ready")
    talk = segments(recordings(version, "robot.json")["questions"][number])
    with (
        open_service(running.interface, network) as port,
        socket.create_connection((port.contact.host, port.contact.port), timeout=10) as connection,
    ):
        for way, data in talk:
            if way == ">":
                connection.sendall(data)
            else:
                wanted = framing.yarp_number(port.contact.port) if data == _PORT else data
                assert receive(connection, len(wanted)) == wanted
    running.interface.quit()
    assert running.end().good


@pytest.mark.parametrize("word", ["quit", "bye", "exit"])
def test_it_can_be_asked_to_end(bench: Bench, started: Callable[[RobotInterface], Running], word: str):
    """Each word for the end is answered with bye; then is_ready fails, and the devices are closed."""
    running = started(bench.make(device("d")))
    eventually(lambda: running.interface.ready, "it does not become ready")
    with (
        open_service(running.interface, bench.network) as port,
        RpcClient("/asks", port.name, network=bench.network) as client,
    ):
        assert client.call(Bottle([word]), timeout=5) == Bottle(["bye"])
        assert client.call(Bottle.parse("is_ready"), timeout=5) == Bottle.parse("[fail]")
        running.end()
        assert client.call(Bottle.parse("get_phase"), timeout=5) == Bottle(["unknown"])
    assert bench.calls == ["d open", "d close"]


def test_phase_and_level_while_it_starts(bench: Bench, started: Callable[[RobotInterface], Running]):
    """During the startup the service answers with phase and level, and is_ready is false."""
    calibrator = device("cal", "scriptedCalibrator", action("calibrate", level=7, target="d"), calibrate="wait")
    interface = bench.make(device("d") + calibrator)
    service = make_service(interface)
    assert service.answer(Bottle(["get_phase"])).fields == ("unknown",)
    running = started(interface)
    eventually(lambda: "cal calibrate d" in bench.calls, "it does not begin")
    answers = {word: service.answer(Bottle.parse(word)).fields for word in ("get_phase", "get_level", "is_ready")}
    assert answers == {"get_phase": ("startup",), "get_level": (7,), "is_ready": (False,)}
    running.interface.quit()
    running.end()


@pytest.mark.parametrize("question", ["", "dance", "get_phase 1", "help dance", "1 2", "(is_ready)", "[is_ready]"])
def test_unknown_requests_fail(question: str):
    """An unknown or malformed request is answered with [fail]."""
    service = make_service(RobotInterface(Robot("r", "/r")))
    assert service.answer(Bottle.parse(question)) == Bottle.parse("[fail]")


def test_help_of_each_function():
    """``help`` lists every function, and has a text for each one but itself."""
    service = make_service(RobotInterface(Robot("r", "/r")))
    _, listed = service.answer(Bottle(["help"])).fields
    assert listed.fields[1:] == ("get_phase", "get_level", "get_robot", "is_ready", "quit", "bye", "exit", "help")
    for name in listed.fields[1:-1]:
        _, lines = service.answer(Bottle(["help", name])).fields
        assert f"yarprobotinterfaceRpc::{name}()" in lines.fields[0]
        assert len(lines.fields) == 2


def test_it_is_not_ready_once_the_end_was_asked_for():
    """After a request to end, is_ready is false, even before the phase changes."""
    interface = RobotInterface(Robot("r", "/r"))
    interface.phase = Phase.RUN
    assert interface.ready
    interface.quit()
    assert not interface.ready
