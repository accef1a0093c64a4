"""The controller as a device on two boards, moved by its client through the network."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import pytest

from gaze_bench import EYES, ICUB
from rtf.bottle import Property
from rtf.robot.control_modes import ControlMode
from rtf.robot.device import Device, make_device
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import ConfigurationError, DeviceError, RefusedError, StaleStateError
from rtf.robot.interfaces import FixationPoint, IGazeControl
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.middleware.ports.network import Network

LIMITS = {axis.name: (axis.minimum, axis.maximum) for axis in ICUB.axes}
CAMERAS = " ".join(
    f"(CAMERA_CALIBRATION_{eye} (w 320) (h 240) (fx 310) (fy 310) (cx 160) (cy 120))" for eye in ("LEFT", "RIGHT")
)
SETTINGS = (
    f"(name /gaze) (head_version v2.5) (trajectory_time (neck 0.5) (eyes 0.1)) (saccades off) {CAMERAS}"
    " (ALIGN_KIN_LEFT (HN (1 0 0 0 0 1 0 0 0 0 1 0.02 0 0 0 1)))"
)


def board(name: str, joints: tuple[str, ...]) -> FakeBoard:
    """A board with these joints."""
    opened = FakeBoard(name)
    low, high = (" ".join(str(LIMITS[joint][side]) for joint in joints) for side in (0, 1))
    opened.open(Property.parse(f"(GENERAL (Joints {len(joints)}) (AxisName {' '.join(joints)}))"
                               f" (LIMITS (Min {low}) (Max {high}))"))  # fmt: skip
    return opened


@pytest.fixture
def boards() -> dict[str, Device]:
    """The torso in the order of its board, which is not that of the chain, and the head."""
    head = (*EYES.head.joints[3:], "eyes_tilt", "eyes_version", "eyes_vergence")
    return {"torso": board("torso", EYES.head.joints[2::-1]), "head": board("head", head)}


@pytest.fixture
def client(network: Network, boards: dict[str, Device]) -> Iterator[IGazeControl]:
    """The client of the device."""
    with ExitStack() as opened:
        device = make_device("gazecontrollerserver", Property.parse(SETTINGS), network=network)
        opened.callback(device.close)
        device.attach(boards)
        where = Property.parse("(remote /gaze) (carrier tcp)")
        found = opened.enter_context(closing(make_device("gazecontrollerclient", where, network=network)))
        yield found.view(IGazeControl)


def test_the_head_is_moved_through_the_network(client: IGazeControl, boards: dict[str, Device]):
    """A motion ends at its point, with its events; a stop ends one in its middle; a joint in fault is not moved."""
    events: list[str] = []
    client.observe_events(lambda event: events.append(event.name))
    point = EYES.point_of((10.0, 5.0, 6.0))
    client.look_at(FixationPoint(point))
    eventually(client.motion_done, "the motion does not end")
    eventually(lambda: len(events) >= 2, "events are missing")
    assert (events[0], events[-1]) == ("motion-onset", "motion-done")
    wanted = pytest.approx(client.angles_of(point), abs=0.5)

    def shown() -> bool:
        try:
            angles, torso = client.angles_of(client.fixation_point().values), client.joints().values[:3]
        except StaleStateError:  # on a busy machine
            return False
        return bool(angles == wanted and torso == pytest.approx([0.0] * 3))

    eventually(shown, "the streams do not show the point, and a torso that stands")
    client.stream_target(FixationPoint(EYES.point_of((-30.0, 0.0, 6.0))))
    eventually(lambda: not client.motion_done(), "the streamed target does not arrive")
    client.stop()
    assert client.motion_done()
    boards["head"].set_control_modes(ControlMode.IDLE, 0)
    with pytest.raises(RefusedError):
        client.look_at(FixationPoint(point))


def test_info_and_settings(client: IGazeControl):
    """Versions, settings and cameras are those of the configuration."""
    info = {one[0]: one[1] for one in client.info()}
    assert (info["server_version"], info["head_version"]) == ("2.0", "2.5")
    assert info["camera_extrinsics_left"][11] == 0.02
    assert (client.neck_trajectory_time(), client.eyes_trajectory_time(), client.saccades()) == (0.5, 0.1, False)
    assert (client.vor_gain(), client.ocr_gain()) == (0.0, 1.0)  # there is no inertial sensor
    with pytest.raises(RefusedError):
        client.set_stabilization(True)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("v2.5", "two", "head_version: 'two' is no version"),
        ("(neck 0.5)", "(neck -1)", "neck: -1 is not a number above 0"),
        ("(saccades off)", "(saccades maybe)", "saccades: maybe is neither yes nor no"),
        ("(fx 310)", "(fx 0)", "fx: 0 is not a number above 0"),
        ("0.02 0 0 0 1", "0.02 0 0 1", "HN: 16 numbers of a pose are needed"),
        ("(saccades off)", "(eye_tilt (min 5) (max -5))", "min: the eyes tilt from 5 to -5 deg"),
    ],
)
def test_wrong_configurations_are_reported(network: Network, old: str, new: str, message: str):
    """By the parameter, and what is there instead."""
    assert old in SETTINGS
    with pytest.raises(ConfigurationError, match=message):
        make_device("gazecontrollerserver", Property.parse(SETTINGS.replace(old, new)), network=network)


def test_without_a_torso(network: Network, boards: dict[str, Device]):
    """Only the head is needed, and the torso counts as 0."""
    device = make_device("gazecontrollerserver", Property.parse(f"{SETTINGS} (torso off)"), network=network)
    with closing(device):
        device.attach({"head": boards["head"]})
        where = Property.parse("(remote /gaze) (carrier tcp)")
        with closing(make_device("gazecontrollerclient", where, network=network)) as client:
            eventually(lambda: client._streams["q"].latest is not None, "no positions arrive")
            assert client.joints().values.tolist() == [0.0] * 9


def test_boards_without_its_joints_are_refused(network: Network, boards: dict[str, Device]):
    """By the joint that is missing."""
    device = make_device("gazecontrollerserver", Property.parse(SETTINGS), network=network)
    with closing(device), pytest.raises(DeviceError, match="no board has an axis 'torso_pitch'"):
        device.attach({"head": boards["head"]})
