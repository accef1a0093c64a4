"""Check whether a robot or one of its parts is simulated. Names alone prove nothing, so the simulator is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.errors import RtfError
from rtf.middleware.errors import NameServerError
from rtf.simulator.control_client import BOARD_ENDS, SimulatorControl, control_port

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network

#: Time-out of the simulator's answer, s: long enough that a busy machine does not make it look like a real robot.
PATIENCE = 5.0


def is_simulated(network: Network, robot: str, part: str = "") -> bool:
    """Return whether a simulator answers for a robot and, with ``part``, serves that part.

    The simulator reports the addresses of its ports. They have to be those of the name server, all on one host. In any
    doubt, such as no answer, the robot counts as real. Raises NameServerError without the name server: then it is
    unknown, and a simulated robot must not be taken for a real one.
    """
    names = [control_port(robot), *(f"/{robot}/{part}/{end}" for end in BOARD_ENDS if part)]
    needed = {control_port(robot), *([f"/{robot}/{part}/command:i"] if part else [])}
    try:
        with SimulatorControl(robot, network=network, patience=PATIENCE) as control:
            own = {(contact.name, contact.host, contact.port) for contact in control.serves(part)}
        found = [network.names.query(name) for name in names]
    except NameServerError:
        raise
    except RtfError:
        return False
    there = {(contact.name, contact.host, contact.port) for contact in found if contact is not None}
    known = {name for name, _, _ in there}
    asked = known - needed  # a board of YARP 3, of YARP 4, or both, has a port for requests
    return needed <= known and (bool(asked) or not part) and there <= own and len({host for _, host, _ in there}) == 1
