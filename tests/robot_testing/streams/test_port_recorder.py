"""Recorders of real ports."""

import copy
import math

import pytest

from icub import ICUB
from rtf.bottle import Bottle, Dialect
from rtf.clock import Clock, SystemClock
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.types import VECTOR
from rtf.robot.errors import RefusedError
from rtf.robot_testing.judging.ft_sensor_loads import WeightModel, parts_above
from rtf.robot_testing.streams.port_recorder import Listener, PortRecorder
from waiting import eventually


@pytest.fixture
def network():
    """A network with a name server of its own."""
    with NameServer() as server:
        network = Network(RemoteNames(server.contact))
        yield network


def test_every_message_is_kept_with_its_stamp(network):
    """No message is skipped; stamp, size, arrival and content are kept."""
    with Port("/source", network=network, inputs=False) as source:
        recorder = PortRecorder("/source", network=network, now=lambda: 7.5, keep=True)
        recorder.connect("tcp")
        for number in range(200):
            source.write(Bottle([number]), envelope=f"{number} {number / 100}")
        recorder.close()
    assert [message.number for message in recorder.messages] == [*range(200)]
    assert [message.time for message in recorder.messages] == pytest.approx([number / 100 for number in range(200)])
    assert len({message.digest for message in recorder.messages}) == 200
    first = recorder.messages[0]
    assert (first.arrival, first.size, first.moment) == (7.5, len(first.content), 0.0)


def test_messages_without_stamps_are_kept_too(network):
    """They have the number -1, and their time is that of their arrival."""
    with Port("/source", network=network, inputs=False) as source:
        recorder = PortRecorder("/source", network=network, now=lambda: 7.5)
        recorder.connect("tcp")
        source.write(Bottle([1]))
        recorder.close()
    (message,) = recorder.messages
    assert (message.number, message.moment, message.content) == (-1, 7.5, None)
    assert math.isnan(message.time)


def test_messages_that_cannot_be_decoded_are_kept_and_reported(network):
    """They count as messages, with their problem."""

    def look(data):
        raise ValueError(f"{len(data)} bytes of nonsense")

    with Port("/source", network=network, inputs=False) as source:
        recorder = PortRecorder("/source", network=network, now=lambda: 0.0, look=look)
        recorder.connect("tcp")
        source.write(Bottle(["x"]))
        source.write(Bottle(["x"]))
        recorder.close()
    assert len(recorder.messages) == 2
    assert len(recorder.problems) == 2


def test_a_missing_port_is_an_error(network):
    """The recorder leaves no port behind."""
    with Listener(network, SystemClock()) as listener:
        before = len(network.names.list())
        with pytest.raises(MiddlewareError, match="/absent"):
            listener.add("/absent")
        assert len(network.names.list()) == before
        assert listener.recorders == {}


def test_many_ports_at_once(network):
    """Each port has its own record, and the recording lasts for the given time of the robot's clock."""

    class Quick(Clock):
        time = 100.0

        def now(self):
            return self.time

        def sleep(self, seconds):
            self.time += 2 * seconds  # wakes late, as a loaded machine does

    with Port("/a", network=network, inputs=False) as a, Port("/b", network=network, inputs=False) as b:
        quick = Quick()
        with Listener(network, quick) as listener:
            listener.add("/a", keep=True)
            listener.add("/b")
            a.write([1.0, 2.0], VECTOR, envelope="0 100")
            b.write([1.0], VECTOR, envelope="0 100")
            eventually(lambda: all(one.messages for one in listener.recorders.values()), "nothing came")
            listener.listen(0.1)
            assert quick.time == pytest.approx(100.1, abs=0.011)
            assert listener.late == pytest.approx([0.005] * len(listener.late))
    assert VECTOR.decode(listener.recorders["/a"].messages[0].content, network.dialect).tolist() == [1.0, 2.0]


def test_messages_are_decoded_by_their_connection(network):
    """A sensor of YARP 3 and one of YARP 4 are read at once, in a network that knows neither's dialect."""
    from rtf.robot_testing.streams.sensor_streams import readings_of

    with Listener(network, SystemClock()) as listener:
        for dialect in Dialect:
            own = copy.copy(network)
            own.dialect = dialect
            with Port(f"/sensor{dialect.value}", network=own, inputs=False) as sensor:
                recorder = listener.add(sensor.name, keep=True)
                sensor.write([1.0, 2.5], VECTOR)
                eventually(lambda: recorder.messages, "nothing came")  # noqa: B023 - asked in this turn
            assert [message.dialect for message in recorder.messages] == [dialect]
            assert readings_of(sensor.name, recorder.messages).tolist() == [[1.0, 2.5]]


def test_loads_hang_downwards():
    """At home a leg pulls its sensor down by its weight; other links have no sensor."""
    model = WeightModel(ICUB)
    left, right = model.load("left_leg"), model.load("right_leg")
    assert math.hypot(*left[:3]) == pytest.approx(math.hypot(*right[:3]), rel=0.02)
    assert 20 < math.hypot(*left[:3]) < 100
    assert parts_above(ICUB, "left_arm") == ("torso", "left_arm")
    assert parts_above(ICUB, "left_hand") == ()
    with pytest.raises(RefusedError, match="left_hand"):
        model.load("left_hand")
