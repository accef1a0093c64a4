"""The RPC port of a robot interface: its phase and level, whether it is ready, and the request to quit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types.service import Function, Service

if TYPE_CHECKING:
    from rtf.middleware.ports.network import Network
    from rtf.robot.interface.robot_interface import RobotInterface

_CLASS = "yarprobotinterfaceRpc"
#: The wording of YARP's program.
_READY = "Returns true if yarprobotinterface is ready (all startup actions\nperformed and no interrupt called)."


def make_service(interface: RobotInterface) -> Service:
    """Return the functions of the port, in the order in which ``help`` lists them."""

    def end() -> str:
        interface.quit()
        return "bye"

    return Service(
        {
            "get_phase": Function(lambda: str(interface.phase), f"std::string {_CLASS}::get_phase()", (_PHASE,)),
            "get_level": Function(lambda: interface.level, f"std::int32_t {_CLASS}::get_level()", (_LEVEL,)),
            "get_robot": Function(lambda: interface.robot.name, f"std::string {_CLASS}::get_robot()", (_ROBOT,)),
            "is_ready": Function(lambda: interface.ready, f"bool {_CLASS}::is_ready()", (_READY,)),
            **{name: Function(end, f"std::string {_CLASS}::{name}()", (_ENDS,)) for name in _ENDINGS},
        }
    )


def open_service(interface: RobotInterface, network: Network) -> RpcServer:
    """Open the port ``<portprefix>/yarprobotinterface``. Raises MiddlewareError."""
    return RpcServer(interface.robot.port_name, make_service(interface).answer, network=network)


_ENDINGS = ("quit", "bye", "exit")
_PHASE = "The phase it is in: startup, run, interrupt1, interrupt2, interrupt3, shutdown or unknown."
_LEVEL = "The level of the phase whose actions are done."
_ROBOT = "The name of the robot."
_ENDS = "Ends it, as the first signal does; the answer is bye."
