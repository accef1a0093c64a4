"""Tests of ``rtf can-boards``: the boards in a process of their own, and a host in this one."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from free_ports import free_port
from rtf.robot.devices.can import motor_messages as m
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import MULTICAST_GROUP, BusSettings
from rtf.robot.devices.can.codes import BoardMode, BoardType
from rtf.robot.devices.can.exchange import Exchange, Version
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator


def command(*words: str) -> list[str]:
    """Return the command line of the program."""
    return [sys.executable, "-m", "rtf", "can-boards", *words]


@contextmanager
def boards(port: int) -> Iterator[subprocess.Popen[str]]:
    """Run the boards of the bench, from READY on."""
    words = command("--model", "bench", "--port", str(port))
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            said = ""
            while "READY" not in said:
                line = process.stderr.readline()
                assert line, said
                said += line
            assert re.search(r"arm0: udp_multicast .*: boards 1 BLL, 14 MTB4\n", said)
            yield process
        finally:
            process.kill()


def test_a_host_finds_asks_and_hears_the_boards():
    """They answer a search and questions, broadcast what they are asked for, and end with SIGINT."""
    port = free_port(socket.SOCK_DGRAM)
    with boards(port) as process:
        bus = CanBus(BusSettings("udp_multicast", MULTICAST_GROUP, options=(("port", port),)))
        try:
            exchange = Exchange(bus, timeout=10.0)
            versions: list[Version] = []

            def both() -> bool:
                versions[:] = exchange.discover(1.0)
                return len(versions) == 2

            eventually(both, "a board does not answer")
            found, imu = versions
            assert (found.board, found.board_type) == (1, BoardType.BLL)
            assert (imu.board, imu.board_type) == (14, BoardType.MTB4)
            assert exchange.ask(m.CONTROL_MODE, 1) == (BoardMode.IDLE,)
            bus.send(m.BROADCASTS.frame(1, 0b1))
            position = m.BROADCAST_POSITION.identifier(1)
            eventually(lambda: position in bus.traffic and bus.traffic[position].frames > 50, "no positions")
        finally:
            bus.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--model", "bench", "--parts", "tail"), "there is no part 'tail'; there are arm"),
        (("--interface", "socketcan", "--channel", "can0"), "write {} where the number of the bus belongs"),
    ],
)
def test_wrong_words_are_usage_errors(words: tuple[str, ...], message: str):
    """Before anything starts, with what there is."""
    ended = subprocess.run(command(*words), capture_output=True, text=True, timeout=60.0, check=False)
    assert ended.returncode == 4
    assert message in ended.stderr


def test_an_interface_that_cannot_be_opened_is_reported():
    """With the name of the bus and the reason, and the exit code 1."""
    words = command("--model", "bench", "--interface", "socketcan", "--channel", "nocan{}")
    ended = subprocess.run(words, capture_output=True, text=True, timeout=60.0, check=False)
    assert ended.returncode == 1
    assert "FAILED: the boards of bench could not be started: the CAN bus socketcan nocan0" in ended.stderr
