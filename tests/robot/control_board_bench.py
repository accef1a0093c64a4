"""Boards to be served, and arbitrary requests to them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

import numpy as np
from hypothesis import strategies as st

from rtf.bottle import Bottle, Dialect, Float32, Int64, Property, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.remote import connect
from rtf.middleware.types import VECTOR
from rtf.middleware.wire.contact import Contact
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IAxisInfo, IRemoteCalibrator, JointType
from rtf.robot.network.outlets import PipelinedOutlets
from rtf.robot.publishing import Outlets
from rtf.robot.yarp3.table import COMMANDS, TOPICS


class CalibratedBoard(FakeBoard, IRemoteCalibrator):
    """A board of two joints with variables, and a calibrator that records its calls."""

    def __init__(self) -> None:
        super().__init__("calibrated")
        self.asked: list[str] = []
        self.open(Property.parse("(GENERAL (Joints 2)) (VARIABLES (one 1.5) (two a (b c)))"))

    def has_calibrator(self) -> bool:
        """See IRemoteCalibrator."""
        return True

    def calibrate_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self.limits(joint)
        self.asked.append(f"calibrate {joint}")

    def calibrate_part(self) -> None:
        """See IRemoteCalibrator."""
        self.asked.append("calibrate")

    def home_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self.asked.append(f"home {joint}")

    def home_part(self) -> None:
        """See IRemoteCalibrator."""
        self.asked.append("home")

    def park_joint(self, joint: int) -> None:
        """See IRemoteCalibrator."""
        self.asked.append(f"park {joint}")

    def park_part(self) -> None:
        """See IRemoteCalibrator."""
        self.asked.append("park")

    def quit_calibrate(self) -> None:
        """See IRemoteCalibrator."""
        self.asked.append("quit calibrate")

    def quit_park(self) -> None:
        """See IRemoteCalibrator."""
        self.asked.append("quit park")


class Axes(IAxisInfo):
    """Two axes, and nothing else."""

    def axes(self) -> int:
        """See IAxisInfo."""
        return 2

    def axis_name(self, joint: int) -> str:
        """See IAxisInfo: it is broken."""
        raise ZeroDivisionError(f"joint {joint}")

    def joint_type(self, joint: int) -> JointType:
        """See IAxisInfo."""
        raise RefusedError("no")


VALUES = st.recursive(
    st.one_of(
        st.integers(-(2**63), 2**63 - 1),
        st.integers(-3, 5),
        st.floats(),
        st.text(max_size=6).filter(lambda text: text.isprintable()),
        st.binary(max_size=6),
        st.sampled_from([word for words in TOPICS for word in words]).map(Vocab),
        st.sampled_from(["get", "set", "pos", "posd", "stif", "trq", *COMMANDS]).map(Vocab),
        st.floats(width=32).map(Float32),
        st.integers(0, 3).map(Int64),
    ),
    lambda inner: st.lists(inner, max_size=4).map(Bottle),
    max_leaves=12,
)
QUESTIONS = st.one_of(
    st.lists(VALUES, max_size=8).map(Bottle),
    st.builds(
        lambda verb, words, rest: Bottle([Vocab(verb), *map(Vocab, words), *rest]),
        st.sampled_from(["get", "set"]),
        st.sampled_from([*TOPICS]),
        st.lists(VALUES, max_size=5),
    ),
)


def command(head: str, *values: float) -> bytes:
    """The bytes of a streamed command."""
    body = VECTOR.encode(np.array(values, dtype=float), Dialect.YARP3)
    return bytes.fromhex("0001000002000000") + encode(Bottle.parse(head)) + b"".join(body)


@contextmanager
def reading(network: Network, name: str, codec, carrier: str = "tcp") -> Iterator[BufferedPort]:
    """Open a reader of a port of the board."""
    with BufferedPort(f"/reader{name}", codec, strict=True, network=network) as port:
        connect(network, Contact(f"/robot/arm{name}"), Contact(port.name), carrier)
        yield port


@contextmanager
def serving(device: object, network: Network, *, outlets: Outlets | None = None) -> Iterator[ControlBoardServer]:
    """A device whose messages have arrived when they are settled."""
    outlets = outlets or PipelinedOutlets()
    with closing(ControlBoardServer(device, "/robot/arm", network=network, outlets=outlets)) as server:
        yield server
