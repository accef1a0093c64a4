"""A control board on the network: its state, its ports, and the devices that serve it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from rtf.bottle import Bottle, Dialect, Property
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.remote import connect
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import VECTOR, Stamp
from rtf.middleware.wire.contact import Contact
from rtf.middleware.wire.incoming_message import IncomingMessage
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import find_device, make_device
from rtf.robot.errors import ConfigurationError, DeviceError, NotSupportedError
from rtf.robot.extended_state import EXTENDED_STATE, Field
from rtf.robot.interfaces import IEncoders, IPositionControl
from rtf.robot.network.outlets import BackgroundOutlets
from waiting import eventually

from ..control_board_bench import Axes, CalibratedBoard, reading, serving
from ..sensor_bench import ManualClock


@pytest.fixture
def board(stepped: ManualClock) -> CalibratedBoard:
    """A board whose time stands still."""
    return CalibratedBoard()


@pytest.fixture
def server(board: CalibratedBoard, network: Network) -> Iterator[ControlBoardServer]:
    """The server of the board."""
    with closing(ControlBoardServer(board, "/robot/arm", network=network)) as opened:
        yield opened


@pytest.mark.parametrize("carrier", ["tcp", "local"])
def test_state_is_published_with_stamps(network: Network, board, stepped: ManualClock, carrier: str):
    """Positions and whole state have one count and the encoders' time, and are not changed by later messages."""
    with (
        serving(board, network) as server,
        reading(network, "/state:o", VECTOR, carrier) as positions,
        reading(network, "/stateExt:o", EXTENDED_STATE, carrier) as states,
    ):
        board.position_move(20.0, 0)
        expected = []
        for number in range(3):
            stepped.sleep(0.5)
            server.publish(0.0)
            server.settle()
            expected.append((f"{number} {stepped.now():.15g}", board.encoders().tolist()))
        simple, full = [positions.receive(5) for _ in range(3)], [states.receive(5) for _ in range(3)]
    assert [(one.envelope, one.value.tolist()) for one in simple] == expected
    assert [(one.envelope, one.value.joint_positions.tolist()) for one in full] == expected
    assert expected[0][1] != expected[1][1]
    assert full[0].value.valid[: Field.TEMPERATURES].all()
    assert full[0].value.control_modes.tolist() == [ControlMode.POSITION] * 2


def test_state_in_the_background(network: Network, board, stepped: ManualClock):
    """Publishing does not wait for readers: a slow reader misses messages."""
    go_on = threading.Event()
    delivered = []

    def dawdle(delivery: IncomingMessage) -> None:
        delivered.append(delivery.envelope)
        assert go_on.wait(30)

    with (
        serving(board, network, outlets=BackgroundOutlets()) as server,
        BufferedPort("/slow", EXTENDED_STATE, network=network, outputs=False) as slow,
    ):
        slow.deliver = dawdle  # type: ignore[method-assign]
        connect(network, Contact("/robot/arm/stateExt:o"), Contact("/slow"), "tcp")
        for _ in range(100):
            server.publish(0.0)
        eventually(lambda: delivered, "nothing came")
        assert delivered == [delivered[0]]
        go_on.set()


def test_nothing_is_published_of_different_moments(network: Network, board, stepped: ManualClock, said: list[str]):
    """If the joints were measured more than a second apart, nothing is published, and it is reported once."""
    device = Apart()
    with serving(device, network) as server, reading(network, "/state:o", VECTOR) as positions:
        for times in ([10.0, 10.5], [10.0, 11.5], [10.0, 12.0], [12.0, 12.0]):
            device.times = np.array(times)
            server.publish(0.0)
            server.settle()
        assert [positions.receive(5).envelope for _ in range(positions.pending)] == ["0 10.25", "1 12"]
    assert len(said) == 1
    assert "the encoders of joints 0 and 1 were read 1.5 s apart" in said[0]


class Apart(Axes, IEncoders):
    """A board of two joints with times of measurement that the test sets."""

    times = np.zeros(2)

    def encoders(self, joints=None):
        """See IEncoders."""
        return np.zeros(2)

    encoder_speeds = encoder_accelerations = encoders

    def encoder_times(self, joints=None):
        """See IEncoders."""
        return self.times

    def set_encoders(self, values, joints=None) -> None:
        """See IEncoders."""

    def reset_encoders(self, joints=None) -> None:
        """See IEncoders."""


def test_a_device_without_encoders_is_stamped_by_the_publisher(network: Network, stepped: ManualClock):
    """Without encoders no positions are published, and the state marks every field as invalid."""
    with (
        serving(Axes(), network) as server,
        reading(network, "/state:o", VECTOR) as positions,
        reading(network, "/stateExt:o", EXTENDED_STATE) as states,
    ):
        server.publish(12.5)
        server.settle()
        received = states.receive(5)
        assert received.envelope == "0 12.5"
        assert not received.value.valid.any()
        assert positions.pending == 0


# Opening and closing ---------------------------------------------------------------------------------------------


def test_ports_have_their_names(network: Network, server: ControlBoardServer):
    """The server has four ports with YARP's names, and closing unregisters them."""
    names = {contact.name for contact in network.names.list("/robot/arm")}
    assert names == {f"/robot/arm/{port}" for port in ("rpc:i", "command:i", "state:o", "stateExt:o")}
    server.close()
    server.close()
    assert not network.names.list("/robot/arm")


def test_a_name_that_cannot_be_leaves_nothing(network: Network, board: CalibratedBoard):
    """When a port cannot be opened, those that were opened are closed."""
    with pytest.raises(MiddlewareError):
        ControlBoardServer(board, "robot/arm", network=network)
    assert not network.names.list("/robot")


def test_only_boards_are_served(network: Network):
    """A device without IAxisInfo is refused."""
    with pytest.raises(NotSupportedError, match="IAxisInfo"):
        ControlBoardServer(object(), "/robot/arm", network=network)


@pytest.mark.parametrize(("kind", "period"), [("controlBoard_nws_yarp", 0.01), ("controlboardwrapper2", 10)], ids=str)
def test_device_serves_what_it_is_attached_to(network: Network, kind: str, period: float):
    """The period has the unit of the device type; after detaching it may be attached again."""
    board = make_device("fakeMotionControl", Property.parse("(GENERAL (Joints 3))"), name="fake", network=network)
    wrapper = make_device(kind, Property({"name": "/robot/arm", "period": period}), network=network)
    for _ in range(2):
        wrapper.attach({"board": board})
        with reading(network, "/state:o", VECTOR) as positions:
            times = [Stamp.parse(positions.receive(5).envelope) for _ in range(5)]
        assert all(stamp is not None for stamp in times)
        assert 0.005 < (times[-1].time - times[0].time) / 4 < 0.5
        with pytest.raises(DeviceError, match="attached already"):
            wrapper.attach({"board": board})
        wrapper.detach()
        assert not network.names.list("/robot/arm")
    wrapper.close()


def test_wrapper_makes_its_own_device(network: Network):
    """``subdevice`` names the type of a device that is opened with the same configuration."""
    configuration = Property.parse("(name /robot/arm) (subdevice fakeMotionControl) (GENERAL (Joints 3))")
    wrapper = make_device("controlboardwrapper2", configuration, network=network)
    with closing(wrapper), RpcClient("/client", "/robot/arm/rpc:i", network=network) as asking:
        assert str(asking.call(Bottle.parse("[get] [axes]"))).startswith("[is] [axes] 3")
    assert not network.names.list("/robot/arm")


def test_wrapper_makes_one_board_of_several(network: Network):
    """``networks`` has the names of the boards, ``joints`` the number of axes, and each network their ranges."""
    configuration = Property.parse(
        "(name /robot/arm) (networks (upper lower)) (joints 3) (upper (0 1 0 1)) (lower (2 2 1 1))"
    )
    boards = {
        name: make_device("fakeMotionControl", Property.parse(f"(GENERAL (Joints 2) (AxisName ({name}_a {name}_b)))"))
        for name in ("upper", "lower")
    }
    wrapper = make_device("controlboardwrapper2", configuration, network=network)
    with closing(wrapper):
        wrapper.attach(boards)
        with RpcClient("/client", "/robot/arm/rpc:i", network=network) as asking:
            names = [str(asking.call(Bottle.parse(f"[get] [name] {joint}"))).split()[2] for joint in range(3)]
            assert names == ["upper_a", "upper_b", "lower_b"]
            assert str(asking.call(Bottle.parse("[set] [pos] 2 5.0"))) == "[ok]"
        assert boards["lower"].view(IPositionControl).target_positions().tolist() == [0.0, 5.0]
        wrapper.detach()
        wrapper.attach(boards)
    assert not network.names.list("/robot/arm")


@pytest.mark.parametrize("kind", ["controlBoard_nws_yarp", "controlboardwrapper2"])
@pytest.mark.parametrize("text", ["", "(name arm)", "(name /arm) (period 0)", "(name /arm) (period fast)"])
def test_configurations_that_cannot_be(network: Network, kind: str, text: str):
    """The error names the parameter."""
    with pytest.raises(ConfigurationError, match=r"name|period"):
        find_device(kind)("wrapper", network=network).open(Property.parse(text))


def test_one_device_is_served(network: Network):
    """Two devices are refused: they need a remapper."""
    wrapper = make_device("controlBoard_nws_yarp", Property({"name": "/robot/arm"}), network=network)
    boards = {name: make_device("fakeMotionControl", name=name, network=network) for name in ("one", "two")}
    with pytest.raises(DeviceError, match="one device, not 2"):
        wrapper.attach(boards)


@pytest.mark.parametrize(
    ("dialect", "parameters", "port"),
    [
        (Dialect.YARP3, "", "/robot/arm/rpc:i"),
        (Dialect.YARP4, "", "/robot/arm/nws/rpc:i"),
        (Dialect.YARP3, "(service yes)", "/robot/arm/nws/rpc:i"),
        (Dialect.YARP4, "(service no)", "/robot/arm/rpc:i"),
    ],
)
def test_the_style_of_the_ports(network: Network, stepped: ManualClock, dialect: Dialect, parameters: str, port: str):
    """The protocol is that of the network's dialect, unless the parameter ``service`` says otherwise."""
    network.dialect = dialect
    configuration = Property.parse(f"(name /robot/arm) {parameters}")
    with closing(make_device("controlBoard_nws_yarp", configuration, network=network)) as device:
        device.attach({"arm": CalibratedBoard()})
        names = {contact.name for contact in network.names.list("/robot/arm")}
        assert {name for name in names if "rpc" in name} == {port}
        device.detach()
