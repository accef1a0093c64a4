"""Services of interface files: calls over an RPC port, and the server that answers them."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass, field
from functools import cache, partial
from typing import TYPE_CHECKING, Any, ClassVar

from rtf.bottle import Bottle, BottleError, Dialect, Vocab
from rtf.bottle.binary import LIST, decode_from
from rtf.bottle.tags import int32
from rtf.idl.errors import CallError
from rtf.idl.types import Field, NativeType, WireType
from rtf.middleware.errors import ProtocolError
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types.codecs import BOTTLE, Codec, TextCodec, codec_of
from rtf.middleware.types.record import FAILED, Record
from rtf.middleware.types.record import call as request_of
from rtf.middleware.types.service import Function
from rtf.middleware.types.service import Service as Functions
from rtf.middleware.types.version import ProtocolVersion

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import TracebackType
    from typing import Self

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Buffer

#: What servers answer to ``getRemoteProtocolVersion``: protocol 0, of the release whose services these are.
VERSION = ProtocolVersion(0, 4, 0, 0)
_DONE = Record(Vocab("done"))
_SHOWN = 120


@dataclass(frozen=True, slots=True)
class RemoteFunction:
    """A function of a service. Of its arguments the last ``optional`` have defaults, and need not be sent.

    ``returns`` is None for a function that returns nothing; one that is ``oneway`` is not waited for.
    """

    name: str
    arguments: tuple[Field, ...] = ()
    returns: WireType | None = None
    optional: int = 0
    oneway: bool = False
    doc: str = ""
    attribute: str = ""
    _puts: tuple[Callable[[Any], object], ...] = field(init=False, repr=False, compare=False)
    _takes: tuple[Callable[[Sequence[Value], int], Any], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Prepare writing of arguments, and reading of those of one element each, as most calls have them."""
        object.__setattr__(self, "_puts", tuple(one.type.put for one in self.arguments))
        simple = all(one.type.width == 1 for one in self.arguments)
        object.__setattr__(self, "_takes", tuple(one.type.take for one in self.arguments) if simple else ())

    @property
    def prototype(self) -> str:
        """Its declaration in C++, as the help text of a server says it."""
        returns = "void" if self.returns is None else self.returns.yarp
        return f"{returns} {self.name}({', '.join(f'{one.type.yarp} {one.name}' for one in self.arguments)})"

    def called(self, values: Sequence[object]) -> str:
        """Return a call as text for messages."""
        return f"{self.name}({', '.join(map(str, values))})"[:_SHOWN]

    def request(self, values: Sequence[object]) -> Record:
        """Return the message of a call. Raises BottleError for a value of another type."""
        put = [put(value) for put, value in zip(self._puts, values, strict=False)]
        return Record(*_words(self.name), *put)

    def run(self, method: Callable[..., Any], *elements: Value) -> object:
        """Call a method with the elements of a request, and return the answer. Raises BottleError for wrong ones."""
        found = method(*self.values(elements))
        if self.returns is None:
            return _DONE if self.oneway else None
        answer = self.returns.put(found)
        return _Native(answer) if isinstance(self.returns, NativeType) else answer

    def values(self, elements: Sequence[Value]) -> list[Any]:
        """Return the arguments in the elements of a request; optional ones may be missing. Raises BottleError."""
        if len(elements) == len(self._takes):
            return [take(elements, at) for at, take in enumerate(self._takes)]
        values: list[Any] = []
        at = 0
        for place, argument in enumerate(self.arguments):
            if at == len(elements) and place >= len(self.arguments) - self.optional:
                break
            if at + argument.type.width > len(elements):
                raise BottleError(f"{self.name} needs more arguments")
            values.append(argument.type.take(elements, at))
            at += argument.type.width
        if at < len(elements):
            raise BottleError(f"{self.name} takes fewer arguments")
        return values

    def result(self, reply: Bottle) -> Any:
        """Return the result in a reply. Raises BottleError."""
        if self.returns is None:
            return None
        elements = reply.elements()
        if len(elements) != self.returns.width:
            raise BottleError(f"{len(elements)} elements instead of {self.returns.width}")
        return self.returns.take(elements, 0)


@cache
def _words(function: str) -> tuple[object, ...]:
    """Return the words of a call of a function, as they are in its message."""
    return request_of(function).fields


class _NativeCodec(TextCodec["_Native"]):
    """Codec of answers that are classes of YARP, and no list with one."""

    def encode(self, value: _Native, dialect: Dialect) -> Sequence[Buffer]:
        """As the codec of the class does."""
        return codec_of(value.answer).encode(value.answer, dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[_Native, int]:
        """As a bottle."""
        bottle, end = decode_from(data, 0, dialect)
        return _Native(bottle), end


@dataclass(frozen=True, slots=True)
class _Native:
    answer: object
    codec: ClassVar[_NativeCodec] = _NativeCodec()


class Service(ABC):  # noqa: B024 - the functions of subclasses are abstract
    """Base class of services. A subclass implements the functions; :func:`serve` makes them known to a network."""

    FUNCTIONS: ClassVar[Mapping[str, RemoteFunction]] = {}


def answering(service: Service) -> Functions:
    """Return the functions of a service for a server of requests: their calls, ``help`` and the protocol's version."""
    functions = {
        name: Function(
            partial(one.run, getattr(service, one.attribute or name)), one.prototype, tuple(one.doc.split("\n"))
        )
        for name, one in service.FUNCTIONS.items()
    }
    return Functions({**functions, "getRemoteProtocolVersion": Function(lambda: VERSION)})


def serve(name: str, service: Service, *, network: Network | None = None) -> RpcServer:
    """Open a port that answers the calls of a service, until it is closed. Raises MiddlewareError.

    Each client is served in a thread of its own, so functions may run at the same time. A call that is not understood
    is answered with ``[fail]``; an error of a function ends the connection of its caller.
    """
    return RpcServer(name, answering(service).answer, network=network)


class Connection:
    """The connection of a client to a server. It is made anew by the next call after it was lost."""

    def __init__(self, local: str, remote: str, *, network: Network | None = None, timeout: float = 5.0) -> None:
        self.remote = remote
        self.timeout = timeout
        self._port = RpcClient(local, remote, network=network)

    def call(self, function: RemoteFunction, *values: object) -> Any:
        """Call a function and return its result.

        Raises CallError if the server refuses, ProtocolError for an answer of another type, BottleError for an argument
        of another type, and other MiddlewareErrors of ports: no server, no answer within ``timeout`` (s).
        """
        request = function.request(values)
        if not self._port.outputs:
            self._port.add_output(self.remote)
        if function.oneway:
            self._port.write(request)
            return None
        native = function.returns if isinstance(function.returns, NativeType) else None
        codec: Codec[Any] = REPLY if native is None else native.codec or BOTTLE
        try:
            reply = self._port.call(request, answer=codec, timeout=self.timeout)
            if reply is None:
                raise ProtocolError(f"{self.remote} gave no answer to {function.called(values)}")
            if reply is _REFUSED:
                refused = f"does not know {function.prototype}, or does not accept {function.called(values)}"
                raise CallError(f"{self.remote} {refused}")
            return reply if native is not None else function.result(reply)
        except BottleError as error:
            called = function.called(values)
            raise ProtocolError(f"{self.remote} answered {called} with something else: {error}") from None

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class Client:
    """Base class of clients, whose functions call those of a server. The block of ``with`` closes its connection."""

    def __init__(self, local: str, remote: str, *, network: Network | None = None, timeout: float = 5.0) -> None:
        self.connection = Connection(local, remote, network=network, timeout=timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.connection.close()


class ReplyCodec(TextCodec[Bottle]):
    """Codec of replies. A refusal and the truth value false differ in their bytes only, not as bottles."""

    def encode(self, value: Bottle, dialect: Dialect) -> Sequence[Buffer]:
        """As a bottle."""
        return BOTTLE.encode(value, dialect)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[Bottle, int]:
        reply, end = decode_from(data, 0, dialect)
        refused = end == _REFUSAL and reply[0] == FAILED and int32.unpack_from(data)[0] != LIST
        return _REFUSED if refused else reply, end


#: The bytes of a refusal: code, length and one element.
_REFUSAL = 12
REPLY = ReplyCodec()
_REFUSED = Bottle([FAILED])
