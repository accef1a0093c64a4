"""Whether what would move is simulated. It is asked: a name may lead to where a simulator was, or to another robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.simulator.control import BOARD_ENDS, SimulatorControl, control_port

if TYPE_CHECKING:
    from rtf.middleware.network import Network

#: Seconds that a simulator may take to answer; a busy machine is no reason to take it for a robot.
PATIENCE = 5.0


def is_simulated(network: Network, robot: str, part: str = "") -> bool:
    """Whether a simulator answers for a robot and, with ``part``, is what that part's names lead to.

    The simulator says where its ports listen. These have to be the addresses that the name server gives, all at one
    host. Whatever leaves a doubt, such as no answer, makes it a real robot.
    """
    names = [control_port(robot), *(f"/{robot}/{part}/{end}" for end in BOARD_ENDS if part)]
    try:
        with SimulatorControl(robot, network=network, patience=PATIENCE) as control:
            own = {(contact.name, contact.host, contact.port) for contact in control.serves(part)}
        found = [network.names.query(name) for name in names]
    except RtfError:
        return False
    there = {(contact.name, contact.host, contact.port) for contact in found if contact is not None}
    return len(there) == len(names) and there <= own and len({host for _, host, _ in there}) == 1
