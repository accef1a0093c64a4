"""The checks of ``rtf yarp-check`` with devices: our clients against a board and a camera that ``yarpdev`` serves."""

from __future__ import annotations

import re
import shutil
from contextlib import closing
from typing import TYPE_CHECKING, TypeVar

from rtf import clock
from rtf.bottle import Property
from rtf.cli.network.yarp_bench import LOOK_AGAIN, PATIENCE, Bench, CheckError, NotApplicableError, await_that
from rtf.robot.boards import client as boards
from rtf.robot.errors import RobotError, StaleStateError
from rtf.robot.sensors.camera import FrameGrabberClient

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator

    from rtf.middleware.types import Image

T = TypeVar("T")
_BOARD, _AXES = "/yarp/arm", 3
_CAMERA, _SIZE = "/yarp/cam", (32, 24)
#: Where the joint is moved to, and how near counts as there, in deg. A fake board reaches its target exactly.
_TARGET, _NEAR = 4.5, 0.01


def device_checks() -> Iterator[tuple[str, Callable[[Bench], str]]]:
    """Return the checks with their names."""
    yield "devices: yarpdev serves a board, we move it", _moves_a_board
    yield "devices: yarpdev serves a camera, we read it", _reads_a_camera


def _moves_a_board(bench: Bench) -> str:
    """Our client reads the number of axes, moves a joint and sees it arrive."""
    program = _serve(bench, "fakeMotionControl", "controlBoard_nws_yarp", _BOARD, f"--GENERAL::Joints {_AXES}")
    with _opened(program, lambda: boards.connect(_BOARD, network=bench.network, timeout=PATIENCE)) as board:
        if board.axes() != _AXES:
            raise CheckError(f"the board has {board.axes()} axes instead of {_AXES}")
        board.position_move([_TARGET], 0)
        await_that(lambda: abs(board.encoders(0)[0] - _TARGET) < _NEAR, f"joint 0 is not at {_TARGET} deg")
    return f"{_AXES} axes; joint 0 moved to {_TARGET} deg"


def _reads_a_camera(bench: Bench) -> str:
    """Our client reads a picture from the stream, and asks for the width."""
    width, height = _SIZE
    size = f"--width {width} --height {height}"
    program = _serve(bench, "fakeFrameGrabber", "frameGrabber_nws_yarp", _CAMERA, size)

    def opened() -> FrameGrabberClient:
        client = FrameGrabberClient(_CAMERA, network=bench.network)
        client.open(Property({"remote": _CAMERA}))
        return client

    with closing(_opened(program, opened)) as camera:
        await_that(lambda: _image_of(camera), "no picture has come")
        image, _ = camera.image()
        if (image.width, image.height) != _SIZE or camera.width() != width:
            raise CheckError(f"{image} came, and the width is {camera.width()}, instead of {width} x {height}")
    return f"{image.code} {width} x {height}"


def _image_of(camera: FrameGrabberClient) -> Image | None:
    try:
        return camera.image()[0]
    except StaleStateError:  # none has arrived yet
        return None


def _serve(bench: Bench, device: str, wrapper: str, name: str, options: str) -> subprocess.Popen[str]:
    """Start ``yarpdev`` with a device behind a server. Raises NotApplicableError if the devices are not built."""
    _require(bench, device, wrapper, "deviceBundler")
    words = f"--device deviceBundler --wrapper_device {wrapper} --attached_device {device} --name {name} {options}"
    return bench.start(*words.split(), tool="yarpdev")


def _opened(program: subprocess.Popen[str], opening: Callable[[], T]) -> T:
    """Open a client as soon as its server is ready: YARP's servers have ports before they have a device."""
    deadline = clock.Deadline.after(PATIENCE)
    while True:
        try:
            return opening()
        except RobotError as error:
            if program.poll() is not None:
                raise CheckError(f"'{' '.join(map(str, program.args))}' has ended with {program.returncode}") from None  # type: ignore[arg-type]
            if deadline.expired:
                raise CheckError(f"{error}, {PATIENCE:g} s later") from error
        clock.sleep(LOOK_AGAIN)


def _require(bench: Bench, *devices: str) -> None:
    """Raise NotApplicableError if the installed YARP lacks one of the devices."""
    if shutil.which("yarpdev") is None:
        raise NotApplicableError("there is no 'yarpdev' on PATH")
    done = bench.complete("yarpdev", "--list")
    listed = set(re.findall(r'Device "(\w+)"', done.stdout + done.stderr))
    missing = [device for device in devices if device not in listed]
    if missing:
        raise NotApplicableError(f"this YARP is built without {', '.join(missing)}")
