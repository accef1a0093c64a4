"""Record a run of the simulated robot as two digests: of all that it publishes, and of its final state.

Also a program.
"""

from __future__ import annotations

import hashlib
import sys
from contextlib import ExitStack, closing
from typing import Any

import numpy as np

from rtf import clock
from rtf.bottle import Property
from rtf.middleware.clocks.network_clock import LockstepClock
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.remote import connect
from rtf.middleware.wire.contact import Contact
from rtf.robot.control_modes import ControlMode, InteractionMode
from rtf.robot.model import load_robot
from rtf.robot.yarp3.client import RemoteControlBoard
from rtf.simulator.robot import SimulatedRobot


class _Raw:
    """The bytes of a received message."""

    def decode(self, data: Any, _dialect: Any) -> bytes:
        """See Codec."""
        return bytes(data)

    adopt = decode


class _Ear(Port):
    """A port that digests each message of a source with its envelope.

    Others may come: the number of the port may have been that of a name server, for which somebody still looks.
    """

    def __init__(self, source: str, network: Network) -> None:
        self._source = source
        self.heard = 0
        self.digest = hashlib.sha256()
        super().__init__(f"/ear{source}", self._hear, network=network, outputs=False)
        connect(network, Contact.parse(source), Contact.parse(self.name))

    def _hear(self, delivery: Any) -> None:
        if delivery.sender != self._source:
            return
        self.heard += 1
        self.digest.update(str(delivery.envelope).encode() + b"\n" + delivery.read(_Raw()) + b"\n")


def record(seed: int) -> tuple[dict[str, str], str, int]:
    """Run for two seconds; return the digests of the messages of each port and of the final state, and a count."""
    network = Network(LocalNames(), report=lambda sentence: print(sentence, file=sys.stderr))
    with ExitStack() as opened:
        robot = opened.enter_context(SimulatedRobot(load_robot("icub"), network=network, lockstep=True, seed=seed))
        ears = {name: opened.enter_context(closing(_Ear(name, network))) for name in robot.outlets.by_name}
        time = opened.enter_context(clock.use(LockstepClock("/clock", "run", network=network)))
        _move(opened, network, time)
        digests = {name: ear.digest.hexdigest() for name, ear in ears.items()}
        state = hashlib.sha256()
        data, boards = robot.simulation.data, robot.simulation.boards
        for array in (
            data.qpos,
            data.qvel,
            data.ctrl,
            data.sensordata,
            boards.temperature,
            boards.controllers.integral,
        ):
            state.update(np.ascontiguousarray(array).tobytes())
        return digests, state.hexdigest(), sum(ear.heard for ear in ears.values())


def _move(opened: ExitStack, network: Network, time: clock.Clock) -> None:
    """Send commands of each kind that clients send."""
    clients = {}
    for part in ("left_arm", "head", "torso"):
        client = clients[part] = RemoteControlBoard(part, network=network)
        client.open(Property({"remote": f"/icubSim/{part}", "local": f"/run/{part}", "carrier": "tcp"}))
        opened.callback(client.close)
    time.sleep(0.013)
    arm, head, torso = clients["left_arm"], clients["head"], clients["torso"]
    arm.position_move([-20.0, 60.0, 70.0], [0, 1, 3])
    arm.set_interaction_modes(InteractionMode.COMPLIANT, 2)
    head.set_control_modes(ControlMode.VELOCITY, 2)
    torso.set_control_modes(ControlMode.PWM, 0)
    head.set_control_modes(ControlMode.POSITION_DIRECT, 0)
    for step in range(100):
        head.velocity_move(20.0 if step % 40 < 20 else -20.0, 2)
        head.set_positions(step / 20, 0)
        torso.set_reference_duty_cycles(5.0, 0)
        time.sleep(0.0199)


if __name__ == "__main__":
    digests, state, count = record(int(sys.argv[1]))
    for name, digest in sorted(digests.items()):
        print(name, digest)
    print("state", state, count)
