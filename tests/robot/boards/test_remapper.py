"""Remappers: boards that are made of axes of other boards."""

from __future__ import annotations

import copy
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.bottle import Bottle, Dialect, Property
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.robot.boards.remapper import RemoteControlBoardRemapper
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import Device
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.devices.remapper import ControlBoardRemapper
from rtf.robot.errors import ConfigurationError, DeviceError, NoAnswerError, NotSupportedError, RefusedError
from rtf.robot.forwarded_board import ForwardedBoard
from rtf.robot.interfaces import (
    CalibrationParameters,
    IAxisInfo,
    IControlCalibration,
    IRemoteCalibrator,
    JointType,
    Pid,
    PidType,
)
from rtf.robot.network.outlets import PipelinedOutlets

from ..contract import ControlBoardContract
from ..sensor_bench import ManualClock

if TYPE_CHECKING:
    from collections.abc import Iterator

ARM, TORSO = ("shoulder", "elbow", "wrist"), ("yaw", "pitch")
#: In another order than on the boards, and not all of them.
MIXED = ("pitch", "elbow", "yaw", "shoulder")


def described(name: str, axes: tuple[str, ...]) -> Property:
    """The configuration of a board with these axes."""
    return Property.parse(f"(GENERAL (Joints {len(axes)}) (AxisName ({' '.join(axes)}))) (VARIABLES (of {name}))")


def board(name: str, axes: tuple[str, ...]) -> FakeBoard:
    """A board with these axes."""
    made = FakeBoard(name)
    made.open(described(name, axes))
    return made


def boards() -> dict[str, Device]:
    """A board of an arm and one of a torso."""
    return {"arm": board("arm", ARM), "torso": board("torso", TORSO)}


def remapped(
    devices: dict[str, Device], configuration: str = f"(axesNames ({' '.join(MIXED)}))"
) -> ControlBoardRemapper:
    """A remapper of boards."""
    remapper = ControlBoardRemapper("mixed")
    remapper.open(Property.parse(configuration))
    remapper.attach(devices)
    return remapper


class TestRemappedBoard(ControlBoardContract):
    """A remapper of axes of two boards, in another order, keeps the contract."""

    @pytest.fixture
    def board(self, stepped: ManualClock) -> ControlBoardRemapper:
        """The remapper of an arm and a torso."""
        self.time = stepped
        return remapped(boards())

    def advance(self, seconds: float) -> None:
        """See ControlBoardContract."""
        self.time.sleep(seconds)


class Link(NamedTuple):
    """A remapper, the boards that are served to it, and their time."""

    time: ManualClock
    devices: dict[str, Device]
    servers: list[Any]  # of either style
    remapper: RemoteControlBoardRemapper


@pytest.fixture(scope="class", params=Dialect, ids=lambda dialect: dialect.name)
def link(request: pytest.FixtureRequest, shared_time: ManualClock, shared_network: Network) -> Iterator[Link]:
    """The link of a served arm and torso; one for all tests."""
    network = copy.copy(shared_network)
    network.dialect = request.param
    with ExitStack() as stack:
        devices, outlets = boards(), PipelinedOutlets()
        servers = [
            stack.enter_context(closing(ControlBoardServer(device, f"/r/{name}", network=network, outlets=outlets)))
            for name, device in devices.items()
        ]
        remapper = stack.enter_context(closing(RemoteControlBoardRemapper("remote", network=network)))
        remapper.open(Property.parse(REMOTE))
        yield Link(shared_time, devices, servers, remapper)


class TestRemoteRemappedBoard(ControlBoardContract):
    """A remapper of remote boards keeps the contract, by both protocols."""

    @pytest.fixture
    def board(self, link: Link) -> Device:
        """The remapper of boards in their initial state, of which no fresh state has arrived yet."""
        self.link = link
        for name, axes in (("arm", ARM), ("torso", TORSO)):
            link.devices[name].open(described(name, axes))
        link.time.sleep(1.0)
        return link.remapper

    def advance(self, seconds: float) -> None:
        """See ControlBoardContract."""
        self.link.time.sleep(seconds)
        for server in self.link.servers:
            server.publish(self.link.time.now())
            server.settle()


REMOTE = (
    f"(axesNames ({' '.join(MIXED)})) (remoteControlBoards (/r/arm /r/torso)) (localPortPrefix /test)"
    " (REMOTE_CONTROLBOARD_OPTIONS (carrier tcp))"
)


# Which axes are which -------------------------------------------------------------------------------------------------


def test_axes_are_those_that_are_named():
    """The axes are in the given order, and a value that is set reaches the right axis."""
    devices = boards()
    remapper = remapped(devices)
    assert remapper.axis_names() == MIXED
    remapper.set_reference_speeds([1.0, 2.0, 3.0, 4.0])
    assert devices["arm"].reference_speeds() == pytest.approx([4.0, 2.0, 10.0])
    assert devices["torso"].reference_speeds() == pytest.approx([3.0, 1.0])
    assert remapper.reference_speeds([3, 0]) == pytest.approx([4.0, 1.0])
    remapper.set_control_modes(ControlMode.VELOCITY, 1)
    assert devices["arm"].control_modes() == (ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.POSITION)


def test_ranges_of_boards():
    """``networks`` and ``joints`` put ranges of boards one behind the other."""
    devices = boards()
    remapper = remapped(devices, "(networks (torso arm)) (joints 4) (torso (0 1 0 1)) (arm (2 3 1 2))")
    assert remapper.axis_names() == ("yaw", "pitch", "elbow", "wrist")
    flat = remapped(devices, "(networks (torso arm)) (joints 3) (arm 0 1 0 1) (torso 2 2 1 1)")
    assert flat.axis_names() == ("shoulder", "elbow", "pitch")


class Counting(ForwardedBoard, Device):
    """A board that records the calls of its methods."""

    def __init__(self, name: str, axes: tuple[str, ...]) -> None:
        super().__init__(name)
        self.names = axes
        self.calls: list[tuple[Any, ...]] = []
        self.short = False

    def open(self, configuration: Property) -> None:
        """See Device."""

    def close(self) -> None:
        """See Device."""

    def axes(self) -> int:
        """See IAxisInfo."""
        return len(self.names)

    def axis_name(self, joint: int) -> str:
        """See IAxisInfo."""
        return self.names[joint]

    def forward_reading(self, method: Any, axes: Any, *of: object) -> list[float]:
        """See ForwardedBoard."""
        self.calls.append((method.__name__, *of, axes))
        return [100.0 * len(self.names) + axis for axis in axes][self.short :]

    def forward_setting(self, method: Any, values: Any, axes: Any, *of: object) -> None:
        """See ForwardedBoard."""
        self.calls.append((method.__name__, *of, [*values], axes))

    def forward_action(self, method: Any, axes: Any) -> list[Any]:
        """See ForwardedBoard."""
        self.calls.append((method.__name__, axes))
        return [len(self.calls) % 2 == 1]

    def forward_single(self, method: Any, axis: int, *arguments: object, of: tuple[object, ...] = ()) -> Any:
        """See ForwardedBoard."""
        self.calls.append((method.__name__, *of, axis, *arguments))

    def forward_whole(self, method: Any) -> Any:
        """See ForwardedBoard."""
        self.calls.append((method.__name__,))
        return len(self.names) == 3


def counting() -> dict[str, Counting]:
    """An arm and a torso that record calls."""
    return {"arm": Counting("arm", ARM), "torso": Counting("torso", TORSO)}


def test_each_board_is_called_once():
    """A call for any number of axes is one call of each board, because each is a round trip through the network."""
    devices = counting()
    remapper = remapped({**devices})
    assert remapper.encoders().tolist() == [201.0, 301.0, 200.0, 300.0]
    remapper.set_pid_references(PidType.TORQUE, [5.0, 6.0, 7.0], [3, 0, 1])
    remapper.set_limits(2, -1.0, 1.0)
    remapper.set_pid(PidType.TORQUE, 0, Pid(1.0))
    remapper.stop([0, 2])
    assert devices["arm"].calls == [
        ("encoders", [1, 0]),
        ("set_pid_references", PidType.TORQUE, [5.0, 7.0], [0, 1]),
    ]
    assert devices["torso"].calls == [
        ("encoders", [1, 0]),
        ("set_pid_references", PidType.TORQUE, [6.0], [1]),
        ("set_limits", 0, -1.0, 1.0),
        ("set_pid", PidType.TORQUE, 1, Pid(1.0)),
        ("stop", [1, 0]),
    ]


def test_motion_is_done_when_all_boards_are_done():
    """The motion of a remapper is not done while one of its boards moves."""
    devices = counting()
    remapper = remapped({**devices})
    assert remapper.motion_done()
    devices["arm"].stop()
    assert not remapper.motion_done()


def test_axes_that_do_not_belong_keep_still():
    """Calibrating, homing and parking the part leave its boards' other axes alone."""
    devices = counting()
    remapper = remapped({**devices})
    remapper.park_part()
    assert devices["arm"].calls == [("park_joint", 1), ("park_joint", 0)]
    assert devices["torso"].calls == [("park_part",)]
    remapper.quit_park()
    assert devices["arm"].calls[-1] == devices["torso"].calls[-1] == ("quit_park",)
    assert not remapper.has_calibrator()  # the torso has none


def test_variables_are_those_of_the_boards():
    """A name in several boards gives the values of all; to set it the board must be named."""
    remapper = remapped(boards())
    assert remapper.variables() == ("of",)
    assert remapper.variable("of") == Bottle(["torso", "arm"])
    with pytest.raises(RefusedError, match=r"torso, arm"):
        remapper.variable("nothing")
    with pytest.raises(NotSupportedError, match="set it at the board"):
        remapper.set_variable("of", Bottle())
    with pytest.raises(NotSupportedError):
        remapped({**counting()}).variables()


@settings(deadline=None)
@given(st.permutations([*ARM, *TORSO]), st.data())
def test_any_choice_in_any_order(order: list[str], data: st.DataObject):
    """Values that are set for any axes in any order can be read from the remapper, and from the boards."""
    size = data.draw(st.integers(1, len(order)))
    names = order[:size]
    devices = boards()
    remapper = remapped(devices, f"(axesNames ({' '.join(names)}))")
    chosen = data.draw(st.lists(st.integers(0, size - 1), min_size=1, unique=True))
    values = [float(data.draw(st.integers(1, 99))) for _ in chosen]
    remapper.set_reference_accelerations(values, chosen)
    assert remapper.reference_accelerations(chosen).tolist() == values
    for axis, value in zip(chosen, values, strict=True):
        owner = devices["arm" if names[axis] in ARM else "torso"]
        assert owner.reference_accelerations(owner.axis_names().index(names[axis])) == [value]


# What does not fit ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "configuration",
    [
        "",
        "(axesNames ())",
        "(axesNames (yaw yaw))",
        "(networks (arm)) (arm (0 1 0 1))",
        "(networks (arm)) (joints 2)",
        "(networks (arm)) (joints 2) (arm (0 1 0))",
        "(networks (arm)) (joints 2) (arm (0 1 0 2))",
        "(networks (arm)) (joints 3) (arm (0 1 0 1))",
        "(networks (arm torso)) (joints 2) (arm (0 1 0 1)) (torso (1 1 0 0))",
        "(networks (arm)) (joints 2) (arm (0 1 -1 0))",
        "(networks (arm)) (joints 1) (arm (0 99999999999 0 99999999999))",
    ],
)
def test_configurations_that_cannot_be(configuration: str):
    """Ranges that overlap, have gaps or differ in length, and duplicate or unknown names are refused."""
    with pytest.raises(ConfigurationError):
        ControlBoardRemapper("mixed").open(Property.parse(configuration))


WORDS = st.one_of(
    st.integers(-2, 5), st.floats(), st.sampled_from(["arm", "torso", "yaw", ""]), st.integers(-(2**63), 2**63 - 1)
)
GROUPS = st.one_of(WORDS, st.lists(st.one_of(WORDS, st.lists(WORDS, max_size=2)), max_size=5))


@pytest.mark.fuzz
@given(st.dictionaries(st.sampled_from(["axesNames", "networks", "joints", "arm", "torso"]), GROUPS))
def test_any_configuration(groups: dict[str, Any]):
    """A configuration is accepted or refused, and an accepted one fits the boards or is an error."""
    remapper = ControlBoardRemapper("mixed")
    try:
        remapper.open(Property(groups))
        remapper.attach(boards())
    except (ConfigurationError, DeviceError):
        return
    assert len(remapper.encoders()) == len(remapper.axis_names())


def test_an_axis_that_is_missing_is_named():
    """The error names the boards, and their axes."""
    with pytest.raises(DeviceError, match=r"'knee'.*arm \(shoulder, elbow, wrist\); torso \(yaw, pitch\)"):
        remapped(boards(), "(axesNames (yaw knee))")
    with pytest.raises(DeviceError, match=r"several boards have an axis 'yaw'"):
        remapped({"one": board("one", TORSO), "other": board("other", TORSO)}, "(axesNames (yaw))")
    with pytest.raises(DeviceError, match=r"'leg'.*arm, torso"):
        remapped(boards(), "(networks (leg)) (joints 1) (leg (0 0 0 0))")
    with pytest.raises(DeviceError, match="arm has no axis 3"):
        remapped(boards(), "(networks (arm)) (joints 4) (arm (0 3 0 3))")


class Lesser(Device, IAxisInfo):
    """A torso that has axes, and nothing else."""

    def open(self, configuration: Property) -> None:
        """See Device."""

    def close(self) -> None:
        """See Device."""

    def axes(self) -> int:
        """See IAxisInfo."""
        return len(TORSO)

    def axis_name(self, joint: int) -> str:
        """See IAxisInfo."""
        return TORSO[joint]

    def joint_type(self, joint: int) -> JointType:
        """See IAxisInfo."""
        return JointType.REVOLUTE


def test_a_board_that_lacks_an_interface_is_named():
    """A missing interface of a board is an error when one of its methods is called."""
    remapper = remapped({"arm": board("arm", ARM), "torso": Lesser("torso")})
    with pytest.raises(NotSupportedError, match=r"torso.*has no IRemoteCalibrator\.calibrate_joint"):
        remapper.view(IRemoteCalibrator).calibrate_joint(0)
    remapper.view(IControlCalibration).set_calibration_parameters(1, CalibrationParameters())


def test_a_board_that_answers_too_little():
    """A wrong number of values is an error."""
    devices = counting()
    remapper = remapped({**devices})
    devices["arm"].short = True
    with pytest.raises(NoAnswerError, match="arm gave 1 values of encoders for 2 axes"):
        remapper.encoders()


def test_it_must_be_open_and_attached():
    """Before opening, before attaching and after closing, the remapper's methods raise DeviceError."""
    remapper = ControlBoardRemapper("mixed")
    with pytest.raises(DeviceError, match="not open"):
        remapper.attach(boards())
    remapper.open(Property({"axesNames": Bottle(["yaw"])}))
    with pytest.raises(DeviceError, match="no board"):
        remapper.encoders()
    remapper.attach(boards())
    assert np.isfinite(remapper.encoders()).all()
    remapper.close()
    with pytest.raises(DeviceError, match="no board"):
        remapper.has_calibrator()


# Through the network --------------------------------------------------------------------------------------------------


def test_a_remote_board_that_is_missing_leaves_nothing(network: Network):
    """When a board is missing, the clients that were opened before are closed again."""
    with closing(ControlBoardServer(board("arm", ARM), "/r/arm", network=network)):
        remapper = RemoteControlBoardRemapper("remote", network=network)
        with pytest.raises(DeviceError, match="/r/torso"):
            remapper.open(Property.parse(REMOTE))
        assert network.names.query("/test/r/arm/rpc:o") is None
        with pytest.raises(DeviceError, match=r"'pitch'.*/r/arm \(shoulder, elbow, wrist\)"):
            remapper.open(Property.parse(REMOTE.replace(" /r/torso", "")))
        assert network.names.query("/test/r/arm/rpc:o") is None


@pytest.mark.parametrize("missing", ["axesNames", "remoteControlBoards", "localPortPrefix"])
def test_parameters_of_the_remote_remapper(missing: str):
    """The error names a missing parameter."""
    configuration = Property.parse(REMOTE)
    configuration.remove(missing)
    with pytest.raises(ConfigurationError, match=missing):
        RemoteControlBoardRemapper("remote", network=Network(LocalNames())).open(configuration)
