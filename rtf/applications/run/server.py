"""The node: a port that starts, lists, signals and ends programs of this machine for those who ask.

It answers as ``yarprun`` 3.12.3 does, with these differences: a program that cannot be started is always reported; a
message that asks for nothing ends the connection instead of leaving the client waiting; signals reach all processes of
a program; ``sysinfo`` has the machine's figures only; and ``ended`` says how a program has ended.
"""

from __future__ import annotations

import os
import shutil
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rtf import clock
from rtf.applications.run import sysinfo
from rtf.applications.run.access import RunAccess
from rtf.applications.run.children import Child, Children
from rtf.applications.run.errors import RunError, StartError
from rtf.applications.run.output import LINGER, LineSender, printable
from rtf.applications.run.programs import make_launch, make_window
from rtf.applications.run.protocol import (
    Ask,
    Ending,
    Kill,
    Running,
    Start,
    aborted,
    read_request,
    started,
)
from rtf.applications.run.streams import WINDOW, Streams
from rtf.bottle import Bottle
from rtf.logs.record import COLLECTOR
from rtf.middleware.errors import MiddlewareError, ProtocolError
from rtf.middleware.ports.access import address_of
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.types import Record
from rtf.testing.isolation import processes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from types import TracebackType

    from rtf.applications.run.children import Launch, Sink
    from rtf.applications.run.record import NodeRecord
    from rtf.middleware.ports.inputs import Input
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Buffer

#: The largest request, bytes; a command with 128 words and an environment has a few thousand.
MAX_REQUEST = 1 << 17
#: Programs that may run at a time, and seconds from SIGTERM to SIGKILL when the node ends.
MOST, GRACE = 256, 5.0
_SIGNALS = range(1, signal.NSIG)
#: The programs whose ends are remembered, and the last lines of each.
_ENDINGS, _LAST = 256, 20
#: The most lines of a running program in an answer; 4 KiB have at most so many.
_MOST_LINES = 4096
#: Seconds in which the client that asked the node to end reads the answer.
_FAREWELL = 1.0
#: Seconds in which the last lines of programs are sent when the node has ended; a terminal may just be connecting.
_LAST_LINES = LINGER + 3.0


class _NodePort(RpcServer):
    """The port of a node: refuses peers and sizes, and remembers in each thread who asks."""

    def __init__(self, name: str, handle: Callable[[Bottle], object], network: Network, access: RunAccess) -> None:
        self._access = access
        self._asking = threading.local()
        super().__init__(name, handle, network=network)

    @property
    def asker(self) -> str:
        """Who asks in this thread: the name that it says is its own, and its address."""
        caller: Input | None = getattr(self._asking, "caller", None)
        return "a port of this process" if caller is None else f"{caller.sender} at {address_of(caller.socket)}"

    def dispatch(self, caller: Input, key: str, text: str, data: Buffer) -> Sequence[Buffer]:
        if key in ("D", "d"):
            if not self._access.admits(address_of(caller.socket)):
                raise ProtocolError("it is not among the allowed addresses of this node; see --allow")
            if len(data) > MAX_REQUEST:
                raise ProtocolError(f"a request of {len(data)} bytes; at most {MAX_REQUEST} are accepted")
        self._asking.caller = caller
        return super().dispatch(caller, key, text, data)


class RunServer:
    """A node, open from construction to ``close``.

    ``said`` gets a line for each start, signal and end, with who asked. ``log`` is the port of the logger for the
    output of all children, None if only requests decide. ``most`` is the greatest number of children, ``grace`` the
    seconds from SIGTERM to SIGKILL when the node ends. ``record`` lets a later node of this name find held children.
    ``on_exit`` is called when somebody asks the node to end, which its owner does then with :meth:`close`.

    Raises RunError if other machines would reach the port and ``access`` names none, and MiddlewareError.
    """

    def __init__(
        self,
        name: str,
        *,
        network: Network,
        access: RunAccess | None = None,
        log: str | None = None,
        said: Callable[[str], None] = lambda _: None,
        most: int = MOST,
        grace: float = GRACE,
        record: NodeRecord | None = None,
        on_exit: Callable[[], None] = lambda: None,
    ) -> None:
        self._network = network
        self._access = access or RunAccess()
        self._log = log
        self._announce = said
        self._grace = grace
        self._record = record
        self._on_exit = on_exit
        self._ready = threading.Event()
        self._leaving = False
        self._stdio_count = 0
        self._lock = threading.Lock()
        self._senders: list[LineSender] = []
        self._answers: dict[str, Callable[[Ask], object]] = {
            "ps": self._ps,
            "isrunning": self._isrunning,
            "sigterm": self._sigterm,
            "sigtermall": self._sigtermall,
            "killstdio": self._killstdio,
            "sysinfo": self._sysinfo,
            "which": self._which,
            "exit": self._exit,
            "ended": self._ended,
            "output": self._output,
        }
        self._endings: dict[str, Ending] = {}
        token = record.token if record else f"{os.getpid()}.{id(self):x}"
        self._children = Children(
            token,
            most=most,
            said=self._say,
            changed=self._write_record,
            ended=self._note_ending,
        )
        #: The terminals that were opened for programs, and those that stay open when their program has ended.
        self._windows = Children(f"{token}-w", most=most, said=self._say)
        self._held_windows: set[int] = set()
        try:
            self._open(name, record)
        except BaseException:
            self._children.close(0.0)
            self._windows.close(0.0)
            if record is not None:
                record.close()
            raise
        finally:
            self._ready.set()

    def _open(self, name: str, record: NodeRecord | None) -> None:
        """Open the port, and take over what an earlier node of this name has left."""
        self._port = _NodePort(name, self.answer, self._network, self._access)
        try:
            self._check_address()
            self._network.names.set_property(self.name, "yarprun", ["true"])
            if record is not None:
                self._take_over(record)
        except BaseException:
            self._port.close()
            raise

    @property
    def name(self) -> str:
        """The registered name of the node."""
        return self._port.name

    @property
    def address(self) -> str:
        """The host and number at which it is reached."""
        return f"{self._port.contact.host}:{self._port.contact.port}"

    def _check_address(self) -> None:
        contact = self._port.contact
        if self._access.loopback_only and not contact.host.startswith("127."):
            raise RunError(
                f"{contact.name} would start programs for everyone who reaches {contact.host}; name the addresses that"
                " may ask with --allow, such as --allow 10.0.0.0/24"
            )

    def _take_over(self, record: NodeRecord) -> None:
        """Watch the held children of the node before, and end what else it left."""
        for found in record.held_before():
            if self._children.adopt(found, lambda child: self._sinks_of(child, child.launch.log)):
                self._say(f"found {found.tag} ({found.pid}) again: {found.command}")
        for pid in record.end_left(self._grace):
            self._say(f"ended process {pid}, which a node before has left")
        self._write_record(child for child in self._children.running() if child.launch.hold)

    def _write_record(self, held: Iterable[Child]) -> None:
        if self._record is not None:
            try:
                self._record.write(held)
            except OSError as error:  # such as a full disk: the programs run on
                self._say(f"held programs will not be found again: {error}")

    def close(self) -> None:
        """End all children that are not held, and close the port."""
        self._children.close(self._grace)
        self._windows.close(self._grace)
        deadline = clock.Deadline.after(_FAREWELL if self._leaving else 0.0)
        while self._port.inputs and not deadline.expired:
            clock.sleep(0.01)
        self._port.close()
        deadline = clock.Deadline.after(_LAST_LINES)
        for sender in self._senders:
            sender.join(deadline.remaining())
        if self._record is not None:
            self._record.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _say(self, text: str) -> None:
        """Say something that may contain what others have sent: without the characters that steer a terminal."""
        self._announce(printable(text))

    # Answers, in the thread of each connection -----------------------------------------------------------------------

    def answer(self, message: Bottle) -> object:
        """Return the answer to a request, which is encoded as a message. Raises RequestError."""
        request = read_request(message)
        self._ready.wait()  # a held program does not count as ended before it is found
        if isinstance(request, Start):
            return Bottle(self._start(request))
        if isinstance(request, Kill):
            return Bottle([f"kill {self._signal(request.tag, request.signal)}"])
        return self._answers[request.key](request)

    def _ps(self, _request: Ask) -> Bottle:
        rows = (
            Running(child.pid, child.launch.tag, "running", child.launch.command, child.launch.environment)
            for child in self._children.running()
        )
        return Bottle([row.to_list() for row in rows])

    def _isrunning(self, request: Ask) -> Bottle:
        return Bottle(["running" if self._children.find(request.about) else "not running"])

    def _sigterm(self, request: Ask) -> Bottle:
        return Bottle([f"sigterm {self._signal(request.about, signal.SIGTERM)}"])

    def _sigtermall(self, _request: Ask) -> Bottle:
        self._say(f"{self._port.asker} ends all programs")
        self._children.signal(self._children.running(), signal.SIGTERM)
        return Bottle(["sigtermall OK"])

    def _sysinfo(self, _request: Ask) -> sysinfo.SystemInfo:
        return sysinfo.measure()

    def _which(self, request: Ask) -> Record:
        return Record(shutil.which(request.about) or request.about)

    def _note_ending(self, child: Child) -> None:
        with self._lock:
            self._endings.pop(child.launch.tag, None)
            self._endings[child.launch.tag] = Ending(child.pid, child.how, (*child.tail.lines(_LAST),))
            if len(self._endings) > _ENDINGS:
                del self._endings[next(iter(self._endings))]

    def _ended(self, request: Ask) -> Bottle:
        with self._lock:
            found = self._endings.get(request.about)
        return Bottle() if found is None else found.to_bottle()

    def _output(self, request: Ask) -> Bottle:
        children = self._children.find(request.about)
        if children:
            return Bottle([*children[-1].tail.lines(_MOST_LINES)])
        with self._lock:
            found = self._endings.get(request.about)
        return Bottle() if found is None else Bottle([*found.lines])

    def _exit(self, _request: Ask) -> Bottle:
        self._say(f"{self._port.asker} ends this node")
        self._leaving = True
        self._on_exit()
        return Bottle(["exit OK"])

    def _signal(self, tag: str, signum: int) -> str:
        children = self._children.find(tag) if signum in _SIGNALS else ()
        for child in children:
            self._say(f"{self._port.asker} sends {processes.signal_name(signum)} to {tag} ({child.pid})")
        self._children.signal(children, signum)
        return "OK" if children else "FAILED"

    # Starting --------------------------------------------------------------------------------------------------------

    def _start(self, request: Start) -> list[object]:
        if request.stdio and (request.uuid or request.on != self.name):
            return self._open_window(request)
        try:
            child, streams = self._launch(request)
        except (StartError, MiddlewareError) as error:
            reason = str(error)
            self._say(f"{self._port.asker} cannot start {request.command} as {request.tag}: {reason}")
            comma = "," if reason.startswith("cannot set") else " because"
            return aborted(self.name, request, f"Can't execute command{comma} {reason}")
        reply = started(self.name, request, child.pid)
        return [*reply, streams.uuid, *streams.open_terminal(self.name)] if streams else reply

    def _launch(self, request: Start) -> tuple[Child, Streams | None]:
        """Start what is asked for. Return the child, and its streams if they are to be shown in a terminal."""
        logger = self._log if request.log is None else request.log or self._log or COLLECTOR
        launch = make_launch(request, self._access, logger)
        if not request.stdio:
            return self._children.start(launch, self._begin), None
        return self._launch_with_streams(launch, request)

    def _begin(self, child: Child) -> Iterable[Sink]:
        """Say that a program has started, before it can be said that it has ended. Return what takes its output."""
        self._say(f"{self._port.asker} starts {child.launch.command} as {child.launch.tag} ({child.pid})")
        return self._sinks_of(child, child.launch.log)

    def _sinks_of(self, child: Child, logger: str | None) -> Iterable[Sink]:
        if logger is None:
            return ()
        command = Path(child.launch.command.partition(" ")[0]).name
        return (self._sender(f"/log{self.name}/{command}/{child.pid}", logger),)

    def _sender(self, name: str, target: str, at_end: Callable[[], None] = lambda: None) -> LineSender:
        sender = LineSender(name, network=self._network, target=target, report=self._say, at_end=at_end)
        with self._lock:
            self._senders = [*(one for one in self._senders if one.open), sender]
        return sender

    # Terminals -------------------------------------------------------------------------------------------------------

    def _launch_with_streams(self, launch: Launch, request: Start) -> tuple[Child, Streams]:
        with self._lock:
            number, self._stdio_count = self._stdio_count, self._stdio_count + 1
        uuid = f"{self.name}/{os.getpid()}/{request.tag}-{number}"
        streams = Streams(uuid, request, network=self._network, report=self._say)

        def sinks(child: Child) -> Iterable[Sink]:
            return (*self._begin(child), self._sender(f"{uuid}/stdout", "", streams.close))

        try:
            return self._children.start(launch, sinks, streams.stdin), streams
        except StartError:
            streams.close()
            raise
        finally:
            os.close(streams.stdin)

    def _open_window(self, request: Start) -> list[object]:
        """Open a terminal for a program of another node, or of this one."""
        try:
            child = self._windows.start(make_window(request, self._access))
        except StartError as error:
            self._say(f"{self._port.asker} cannot open a terminal for {request.tag}: {error}")
            return aborted(self.name, request, f"Can't execute command because {error}", WINDOW)
        self._say(f"{self._port.asker} opens a terminal for {request.tag} ({child.pid})")
        if request.hold:
            with self._lock:
                still = {one.pid for one in self._windows.running()}
                self._held_windows = {*self._held_windows & still, child.pid}
        return started(self.name, request, child.pid, WINDOW)

    def _killstdio(self, request: Ask) -> Bottle:
        windows = [one for one in self._windows.find(request.about) if one.pid not in self._held_windows]
        self._windows.signal(windows, signal.SIGTERM)
        return Bottle(["killstdio OK"])
