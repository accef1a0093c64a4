"""The interface files of YARP 4's devices say what the devices of RTF answer and ask."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rtf import idl
from rtf.bottle import Bottle, Dialect, Property, Vocab
from rtf.idl.documentation import document
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import Record
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.interface.program import make_service
from rtf.robot.sensors import battery
from rtf.robot.yarp4 import camera, rgbd, table
from rtf.robot.yarp4.server import BoardService

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.idl.types import WireType
    from rtf.middleware.ports.network import Network
    from rtf.robot.yarp4.functions import Message

PAGES = Path(__file__).parents[3] / "docs" / "interfaces"
NAMES = sorted(path.stem for path in idl.SERVICES.glob("*.thrift"))

TABLES: tuple[tuple[str, str, Sequence[Message]], ...] = (
    ("control_board", "ControlBoardMsgs", table.MESSAGES),
    ("camera", "FrameGrabberMsgs", camera.MESSAGES),
    ("depth_camera", "RGBDSensorMsgs", rgbd.MESSAGES),
    ("battery", "IBatteryMsgs", (battery.FUNCTION,)),
)


@pytest.mark.parametrize(("file", "service", "messages"), TABLES, ids=[name for name, *_ in TABLES])
def test_a_file_and_the_table_of_its_devices_agree(file: str, service: str, messages: Sequence[Message]):
    """Each has all functions of the other, with the same types of arguments and results."""
    module = idl.load(file)
    functions = getattr(module, service).FUNCTIONS
    assert {message.name for message in messages} == set(functions)
    for message in messages:
        function = functions[message.name]
        assert [kind.cpp for kind in message.takes] == [one.type.yarp for one in function.arguments], message.name
        assert [kind.cpp for kind in message.gives] == _results(module, function.returns), message.name


def _results(module: Any, returns: WireType) -> list[str]:
    """Return the types of a function's results, without the return value before them."""
    struct = getattr(module, returns.yarp, None)
    first, *others = [one.type.yarp for one in struct.FIELDS] if struct else [returns.yarp]
    assert first == "yarp::dev::ReturnValue"
    return others


def test_the_functions_of_a_robot_interface():
    """The port of ``rtf robotinterface`` has those of the file."""
    functions = idl.load("robot_interface").yarprobotinterfaceRpc.FUNCTIONS
    listed = make_service(None).answer(Bottle(["help"]))  # type: ignore[arg-type]  # none is called
    assert isinstance(listed, Record)
    _, names = listed.fields
    assert isinstance(names, Record)
    assert [*functions, "help"] == [*names.fields[1:]]


@pytest.mark.parametrize("name", NAMES)
def test_the_pages_are_up_to_date(name: str):
    """``docs/interfaces`` has what ``rtf idl md NAME`` prints."""
    assert (PAGES / f"{name}.md").read_text(encoding="utf-8") == document(idl.read(name), "md")


def test_a_board_is_asked_by_its_file(network: Network):
    """A client made from the file calls a board, and has its results."""
    messages = idl.load("control_board")
    spoken = network.in_dialect(Dialect.YARP4)
    board = FakeBoard("fake")
    board.open(Property.parse("(GENERAL (Joints 2))"))
    done = Bottle([Vocab("ok")])
    with (
        RpcServer("/board", BoardService(board, "/board", network=network).answer, network=spoken),
        messages.ControlBoardMsgsClient("", "/board", network=spoken) as client,
    ):
        assert client.getAxesRPC() == messages.return_getAxes(done, 2)
        assert client.setControlModeOneRPC(0, int(Vocab("posd"))) == done
        assert client.getAxisNameRPC(1) == messages.return_getAxisName(done, board.axis_name(1))
        assert client.getEncoderAllRPC().val == [0.0, 0.0]
