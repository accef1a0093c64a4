"""Questions to boards: answers that are late, of others, damaged, or do not come."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can import sensor_messages as sensor
from rtf.robot.devices.can.bus import CanBus
from rtf.robot.devices.can.bus_settings import BusSettings
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.devices.can.exchange import Exchange, Version
from rtf.robot.devices.can.messages import Frame
from rtf.robot.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

PATIENCE = 10.0


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A virtual channel of this test alone."""
    return request.node.name


@pytest.fixture
def answering(channel: str) -> Iterator[Callable[[Callable[[Frame, int], list[Frame]]], None]]:
    """A function that has a board send these frames after each question; the number counts the questions."""
    with closing(CanBus(BusSettings("virtual", channel))) as bus:
        questions: list[Frame] = []

        def answer_by(make: Callable[[Frame, int], list[Frame]]) -> None:
            def receive(frame: Frame, stamp: float) -> None:
                del stamp
                questions.append(frame)
                bus.send(*make(frame, len(questions)))

            bus.subscribe(receive)

        yield answer_by


@pytest.fixture
def exchange(channel: str) -> Iterator[Exchange]:
    """The host, with a patience that a busy machine does not exhaust."""
    with closing(CanBus(BusSettings("virtual", channel))) as bus, closing(Exchange(bus, PATIENCE)) as made:
        yield made


def test_only_the_answer_is_taken(exchange: Exchange, answering: Callable[..., None]):
    """Frames of other boards, other axes and other commands, and damaged ones, are not taken for it."""
    wanted = motor.MIN_POSITION.value.frame(3, 42, axis=1)
    others = [
        motor.MIN_POSITION.value.frame(4, 1, axis=1),
        motor.MIN_POSITION.value.frame(3, 2, axis=0),
        motor.MAX_POSITION.value.frame(3, 3, axis=1),
        Frame(wanted.identifier, wanted.data[:3]),
        Frame(wanted.identifier, b""),
    ]
    answering(lambda _question, _number: [*others, wanted])
    assert exchange.ask(motor.MIN_POSITION, 3, axis=1) == (42,)


def test_an_answer_about_something_else_is_not_taken(exchange: Exchange, answering: Callable[..., None]):
    """A late answer about another channel is told from the right one by the channel that it repeats."""
    answering(
        lambda _question, _number: [
            sensor.FULL_SCALE.value.frame(13, 0, 100),
            sensor.FULL_SCALE.value.frame(13, 1, 200),
        ]
    )
    assert exchange.ask(sensor.FULL_SCALE, 13, 1) == (1, 200)


def test_questions_are_repeated(channel: str, answering: Callable[..., None]):
    """A board that answers the third time is heard; one that never does is named, with the number of attempts."""
    answering(lambda _question, number: [motor.PWM_LIMIT.value.frame(3, 7)] if number == 3 else [])
    with closing(CanBus(BusSettings("virtual", channel))) as bus:
        assert Exchange(bus, 1.0, retries=2).ask(motor.PWM_LIMIT, 3) == (7,)
        with pytest.raises(
            DeviceError, match=r"board 3 on virtual .* does not answer get_pwm_limit within 1 ms, asked 3"
        ):
            Exchange(bus, 1e-3, retries=2).ask(motor.PWM_LIMIT, 3)


def test_a_search_finds_all(exchange: Exchange, answering: Callable[..., None]):
    """Boards are in the order of their addresses; types without a name are numbers."""
    answering(
        lambda _question, _number: [
            sensor.DISCOVER.value.frame(9, 77, 1, 0, 0),
            sensor.DISCOVER.value.frame(2, BoardType.FOC_2, 3, 2, 1),
        ]
    )
    found = exchange.discover(0.5)
    assert found == [Version(2, 8, (3, 2, 1)), Version(9, 77, (1, 0, 0))]
    assert [(one.type_name, one.firmware_text) for one in found] == [("FOC_2", "3.2.1"), ("type 77", "1.0.0")]


def test_two_boards_with_one_address_clash(exchange: Exchange, answering: Callable[..., None]):
    """A question that has two answers was heard by two boards."""
    answer = motor.VERSION.value.frame(3, BoardType.BLL, 1, 0, 0, 1, 6, 1)
    answering(lambda _question, _number: [answer, answer])
    exchange.version(3)
    exchange.version(3)
    assert exchange.clashes() == [3]
