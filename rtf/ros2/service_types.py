"""The types of services that are used here, as rmw_cyclonedds sends them: each message begins with whose call it is.

That is a number of the client and one of the call, ahead of the fields of ROS. A message without fields has one byte.
"""

# Types of fields are read at run time, so annotations are not postponed.

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

from rtf.ros2.cdr import Message

if TYPE_CHECKING:  # what the types of DDS are in Python
    float64 = float
    int64 = int
    uint8 = int
    uint64 = int
    sequence = list
else:
    from cyclonedds.idl.types import float64, int64, sequence, uint8, uint64


def _dds(name: str, ending: str) -> str:
    package, _, short = name.partition("/")
    return f"{package}.srv.dds_.{short.removeprefix('srv/')}_{ending}_"


@dataclass
class Call(Message):
    """The beginning of a request, and of its response."""

    client: uint64 = 0
    sequence: int64 = 0


Q = TypeVar("Q", bound=Call)
A = TypeVar("A", bound=Call)


class Service(NamedTuple, Generic[Q, A]):
    """A type of service: the classes of its requests and responses."""

    request: type[Q]
    response: type[A]

    @property
    def name(self) -> str:
        """The name in ROS, such as ``std_srvs/srv/Trigger``."""
        package, _, name = self.request.__idl_typename__.partition(".srv.dds_.")
        return f"{package}/srv/{name.removesuffix('_Request_')}"


@dataclass
class TriggerRequest(Call, typename=_dds("std_srvs/Trigger", "Request")):
    """A request to do something."""

    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class TriggerResponse(Call, typename=_dds("std_srvs/Trigger", "Response")):
    """Whether it was done, and a sentence."""

    success: bool = False
    message: str = ""


TRIGGER = Service(TriggerRequest, TriggerResponse)


@dataclass
class ParameterValue(Message, typename="rcl_interfaces.msg.dds_.ParameterValue_"):
    """The value of a parameter: ``type`` says which field has it."""

    type: uint8 = 0
    bool_value: bool = False
    integer_value: int64 = 0
    double_value: float64 = 0.0
    string_value: str = ""
    byte_array_value: sequence[uint8] = field(default_factory=list)
    bool_array_value: sequence[bool] = field(default_factory=list)
    integer_array_value: sequence[int64] = field(default_factory=list)
    double_array_value: sequence[float64] = field(default_factory=list)
    string_array_value: sequence[str] = field(default_factory=list)

    @classmethod
    def of(cls, value: str | list[str]) -> "ParameterValue":
        """Return the parameter of a text, or of a list of texts."""
        return cls(4, string_value=value) if isinstance(value, str) else cls(9, string_array_value=value)

    @property
    def value(self) -> object:
        """The value; None of a parameter that does not exist."""
        values = (
            None, self.bool_value, self.integer_value, self.double_value, self.string_value, self.byte_array_value,
            self.bool_array_value, self.integer_array_value, self.double_array_value, self.string_array_value,
        )  # fmt: skip
        return values[self.type] if self.type < len(values) else None


@dataclass
class GetParametersRequest(Call, typename=_dds("rcl_interfaces/GetParameters", "Request")):
    """The names of parameters of a node."""

    names: sequence[str] = field(default_factory=list)


@dataclass
class GetParametersResponse(Call, typename=_dds("rcl_interfaces/GetParameters", "Response")):
    """Their values, in the same order."""

    values: sequence[ParameterValue] = field(default_factory=list)


GET_PARAMETERS = Service(GetParametersRequest, GetParametersResponse)


@dataclass
class ChainConnection(Message, typename="controller_manager_msgs.msg.dds_.ChainConnection_"):
    """The interfaces of a controller that another one commands."""

    name: str = ""
    reference_interfaces: sequence[str] = field(default_factory=list)


@dataclass
class ControllerState(Message, typename="controller_manager_msgs.msg.dds_.ControllerState_"):
    """A controller of ros2_control, as in Jazzy; its ``state`` is ``active`` if it takes commands."""

    name: str = ""
    state: str = ""
    type: str = ""
    claimed_interfaces: sequence[str] = field(default_factory=list)
    required_command_interfaces: sequence[str] = field(default_factory=list)
    required_state_interfaces: sequence[str] = field(default_factory=list)
    is_chainable: bool = False
    is_chained: bool = False
    exported_state_interfaces: sequence[str] = field(default_factory=list)
    reference_interfaces: sequence[str] = field(default_factory=list)
    chain_connections: sequence[ChainConnection] = field(default_factory=list)


@dataclass
class ListControllersRequest(Call, typename=_dds("controller_manager_msgs/ListControllers", "Request")):
    """A request for all controllers."""

    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class ListControllersResponse(Call, typename=_dds("controller_manager_msgs/ListControllers", "Response")):
    """The controllers of a robot."""

    controller: sequence[ControllerState] = field(default_factory=list)


LIST_CONTROLLERS = Service(ListControllersRequest, ListControllersResponse)
