"""Observers of a board's state: they get every state in order, and an error in one does not affect the others."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf.bottle import Property
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.remote import connect
from rtf.middleware.wire.contact import Contact
from rtf.robot.extended_state import EXTENDED_STATE, ExtendedState
from rtf.robot.yarp3.client import RemoteControlBoard
from waiting import eventually

from ..served_board import fake_board, publish

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network
    from rtf.robot.boards.server import ControlBoardServer

    from ..sensor_bench import ManualClock


@pytest.fixture
def server(network: Network, stepped: ManualClock) -> Iterator[ControlBoardServer]:
    """The server of a board of three joints."""
    with fake_board(network) as (_, server):
        yield server


@pytest.fixture
def client(network: Network, server: ControlBoardServer) -> Iterator[RemoteControlBoard]:
    """A client of the served board."""
    with closing(RemoteControlBoard("client", network=network)) as board:
        board.open(Property({"remote": "/fake", "local": "/client", "carrier": "tcp"}))
        yield board


def test_every_state_comes(client: RemoteControlBoard, server: ControlBoardServer, stepped: ManualClock):
    """An observer gets each state with its time, from ``observe`` until ``unobserve``."""
    times: list[float] = []

    def observer(time: float, state: ExtendedState) -> None:
        assert state.axes == 3
        times.append(time)

    client.observe(observer)
    for _ in range(3):
        stepped.sleep(1)
        publish(server, stepped)
    client.unobserve(observer)
    stepped.sleep(1)
    publish(server, stepped)
    assert times == [101, 102, 103]


def test_one_that_raises_is_given_no_more(
    client: RemoteControlBoard, server: ControlBoardServer, stepped: ManualClock, said: list[str]
):
    """An observer that raises an error is reported and removed; others and readings go on."""
    times: list[float] = []

    def broken(_time: float, _state: ExtendedState) -> None:
        raise ZeroDivisionError("no")

    client.observe(broken)
    client.observe(lambda time, _state: times.append(time))
    for _ in range(3):
        stepped.sleep(1)
        publish(server, stepped)
    assert times == [101, 102, 103]
    [sentence] = said
    assert sentence.endswith("an observer was removed, because it raised ZeroDivisionError: no")
    assert client.encoders().tolist() == [0, 0, 0]


def test_states_of_another_board_are_not_shown(client: RemoteControlBoard, network: Network, stepped: ManualClock):
    """Observers do not get a state with another number of joints."""
    counts: list[int] = []
    client.observe(lambda _time, state: counts.append(state.axes))
    with BufferedPort("/other", EXTENDED_STATE, network=network, inputs=False) as port:
        [name] = [contact.name for contact in network.names.list("/client") if "stateExt" in contact.name]
        connect(network, Contact("/other"), Contact(name), "tcp")
        eventually(lambda: port.outputs, "no connection")
        for axes in (2, 3):
            state = ExtendedState(axes)
            state.joint_positions[:] = np.arange(axes)
            port.write(state, envelope=f"0 {stepped.now()}", strict=True)
            assert port.wait(10)
        assert counts == [3]
