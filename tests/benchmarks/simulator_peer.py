"""The simulator's end of its benchmarks: a process of its own with a name server, a simulated robot, and a stopwatch.

It says where the name server is in one line of JSON, and ends when its standard input does. Its port ``/peer`` answers:

=============== =====================================================================================================
``record``      from now on remember what the boards drive the motors with
``raw``         do the steps since then again, with the engine alone; microseconds a step, and of the processor
``processor``   seconds of the processor that this process had
``pictures N``  make so many pictures with each camera; the seconds that it took
``echo …``      the same again
=============== =====================================================================================================
"""

from __future__ import annotations

import copy
import json
import os
import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from middleware_peer import cpu

from rtf import clock
from rtf.bottle import Bottle, as_int
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.wire.contact import Contact
from rtf.robot.model import load_robot
from rtf.robot.model.engine import mujoco
from rtf.simulator.robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rtf.simulator.simulation import Simulation

#: Steps that are remembered at most.
_MOST = 10_000


class Replay:
    """The motion that a simulation makes, done again without boards, ports and Python, with the engine's own friction.

    Without any it would be another motion.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._model, self._data = copy.copy(simulation.plant.model), simulation.data
        self._model.dof_frictionloss[:] = simulation.plant.friction
        self._boards = simulation.boards
        self._whole = int(mujoco().mjtState.mjSTATE_INTEGRATION)
        self._begin = np.empty(mujoco().mj_stateSize(self._model, self._whole))
        self._torques: list[Any] = []
        self._shadow = mujoco().MjData(self._model)

    def record(self) -> None:
        """Remember the steps from now on."""
        mujoco().mj_getState(self._model, self._data, self._begin, self._whole)
        self._torques.clear()
        self._boards.each_step[:] = [self._remember]

    def _remember(self, _now: float) -> None:
        if len(self._torques) < _MOST:
            self._torques.append(self._data.ctrl.copy())

    def run(self) -> tuple[float, float]:
        """Do them again; microseconds a step, and of the processor, without what it takes to put the torques in."""
        self._boards.each_step.clear()
        mujoco().mj_setState(self._model, self._shadow, self._begin, self._whole)
        step, model, shadow, ctrl = mujoco().mj_step, self._model, self._shadow, self._shadow.ctrl
        began = _times()
        for torques in self._torques:
            ctrl[:] = torques
            step(model, shadow)
        between = _times()
        for torques in self._torques:
            ctrl[:] = torques
        wall, worked = (2 * between - began - _times()) / len(self._torques) * 1e6
        return float(wall), float(worked)


def _times() -> NDArray[np.float64]:
    """Seconds of the machine's clock, and of the processor."""
    return np.array([clock.monotonic(), cpu()])


def answer(robot: SimulatedRobot, replay: Replay, question: Bottle) -> Bottle:
    """See above."""
    word = question.get(0)
    if word == "record":
        replay.record()
    elif word == "raw":
        return Bottle(replay.run())
    elif word == "processor":
        return Bottle([cpu()])
    elif word == "pictures":
        began = clock.monotonic()
        for _ in range(as_int(question.get(1))):
            for camera in robot.cameras.values():
                camera.image()
        return Bottle([clock.monotonic() - began])
    return question


def serve(*, lockstep: bool, cameras: bool) -> None:
    """Open everything, and wait for the end."""
    with NameServer() as names:
        net = Network(names.names)
        with SimulatedRobot(load_robot("icub"), network=net, lockstep=lockstep, cameras=cameras) as robot:
            replay = Replay(robot.simulation)
            with RpcServer("/peer", partial(answer, robot, replay), network=net):
                print(json.dumps({"names": names.contact.port}), flush=True)
                sys.stdin.read()


def serve_alone() -> None:
    """A robot that nobody listens to: for each line of input let so many seconds pass, and say what that took.

    It is printed in JSON: seconds of the machine's clock, and of the processor.
    """
    with SimulatedRobot(load_robot("icub"), network=Network(LocalNames()), lockstep=True) as robot:
        print(json.dumps({}), flush=True)
        for line in sys.stdin:
            began = _times()
            robot.simulation.advance(robot.simulation.now + float(line))
            print(json.dumps((_times() - began).tolist()), flush=True)


def start(*words: str) -> subprocess.Popen[str]:
    """Run this beside us, with our modules."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, __file__, *words]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)


def hear(process: subprocess.Popen[str]) -> Any:
    """The next line that it says."""
    assert process.stdout is not None
    return json.loads(process.stdout.readline())


@contextmanager
def running(*words: str) -> Iterator[Network]:
    """A robot with ``lockstep`` and ``cameras``, or neither. Gives the network that it is in."""
    with start(*words) as process:
        assert process.stdin is not None
        try:
            place = hear(process)
            yield Network(RemoteNames(Contact("/root", "127.0.0.1", place["names"], "tcp")))
        finally:
            process.stdin.close()


if __name__ == "__main__":
    if "alone" in sys.argv:
        serve_alone()
    else:
        serve(lockstep="lockstep" in sys.argv, cameras="cameras" in sys.argv)
