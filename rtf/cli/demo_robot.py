"""A simulated robot that moves, for the demonstration: the robot in a process of its own, who commands it here."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError

if TYPE_CHECKING:
    from rtf.middleware.network import Network

_ROBOT = "icubSim"
_JOINT, _TARGET, _SPEED = "l_elbow", 90.0, 40.0  # deg, deg/s
_PATIENCE = 60.0


class DemonstrationError(RtfError, RuntimeError):
    """Something that is shown did not happen."""


def move(runs: Path) -> list[str]:
    """Start a robot, move its arm through the network, keep what its left eye sees; says what happened, a line each.

    Raises RtfError, or OSError, when something does not work.
    """
    from rtf.middleware.naming.client import RemoteNames
    from rtf.middleware.naming.configuration import write_place
    from rtf.middleware.naming.server import NameServer
    from rtf.middleware.network import Network

    with tempfile.TemporaryDirectory() as folder, NameServer() as server:
        environment = {**os.environ, "YARP_CONFIG_HOME": folder}
        write_place(server.contact, environment=environment)
        ready = Path(folder) / "ready"
        words = ["--robot", _ROBOT, "--parts", "head,left_arm", "--lockstep", "--cameras", "auto"]
        command = [sys.executable, "-m", "rtf.cli.tools", "simulator", *words, "--ready-file", str(ready)]
        began = clock.monotonic()
        names = RemoteNames(server.contact)
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as simulator:
            try:
                _wait_for(ready, simulator)
                line = f"A simulated iCub is ready after {clock.monotonic() - began:.2f} s, in process {simulator.pid}"
                return [line, *_command(Network(names), runs)]
            finally:
                simulator.terminate()
                names.close()


def _wait_for(ready: Path, simulator: subprocess.Popen[bytes]) -> None:
    deadline = clock.Deadline.after(_PATIENCE)
    while not ready.exists():
        if simulator.poll() is not None:
            raise DemonstrationError(
                f"the simulator ended with {simulator.returncode}; see rtf simulator --robot {_ROBOT}"
            )
        if deadline.expired:
            raise DemonstrationError(f"the simulator was not ready within {_PATIENCE:g} s")
        clock.sleep(0.02)


def _command(network: Network, runs: Path) -> list[str]:
    from rtf.middleware.time import LockstepClock
    from rtf.robot.client.control_board import connect

    began = clock.monotonic()
    with clock.use(LockstepClock("/clock", "demonstration", network=network)) as time:
        with connect(f"/{_ROBOT}/left_arm", carrier="tcp", network=network) as arm:
            joint = arm.axis_names().index(_JOINT)
            time.sleep(0.1)
            start, left = arm.encoder(joint), time.now()
            arm.set_reference_speeds(_SPEED, joint)
            arm.position_move(_TARGET, joint)
            while not arm.motion_done(joint):
                time.sleep(0.05)
            time.sleep(0.2)
            reached, seconds = arm.encoder(joint), time.now() - left
        if abs(reached - _TARGET) > 1.0:
            raise DemonstrationError(f"{_JOINT} was to move to {_TARGET:g} deg and is at {reached:.2f}")
        factor = seconds / (clock.monotonic() - began)
        moved = f"  {_JOINT} moved from {start:.1f} to {reached:.1f} deg in {seconds:.2f} s of its time"
        return [f"{moved}, {factor:.0f} times as fast as a robot", _look(network, runs)]


def _look(network: Network, runs: Path) -> str:
    """Keep a picture of the left eye, where the machine can make one."""
    from rtf.middleware import remote
    from rtf.middleware.names import Contact

    if not remote.exists(network, Contact(f"/{_ROBOT}/cam/left/rpc")):
        return "  no picture: this machine cannot make any; see rtf simulator --cameras yes"
    from rtf.bottle import Property
    from rtf.robot.client.frame_grabber import FrameGrabberClient
    from rtf.robot_testing.pictures import png

    eye = FrameGrabberClient("eye", network=network)
    eye.open(Property({"local": "/demo/eye", "remote": f"/{_ROBOT}/cam/left", "no_stream": 1}))
    try:
        image, _ = eye.image()
    finally:
        eye.close()
    runs.mkdir(parents=True, exist_ok=True)
    picture = runs / "demo-left-eye.png"
    picture.write_bytes(png(image.pixels))
    return f"  what its left eye sees: {picture.resolve()}"
