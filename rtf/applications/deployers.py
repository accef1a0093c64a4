"""Deployers: the ways to start, watch and end a module where it belongs.

``local`` runs modules on this machine, ``node`` on a node of ``rtf run --server`` or ``yarprun``, and ``ssh`` on a
machine that has none (:mod:`rtf.applications.ssh`). Others are plug-ins of the kind ``deployer``: a file beside the
application, or in a folder of plug-ins, with a class derived from :class:`Deployer`.
"""

from __future__ import annotations

import re
import signal
import socket
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rtf.applications.deployer import Deployer, DeployerContext
from rtf.applications.errors import DeployerError
from rtf.applications.run import sysinfo
from rtf.applications.run.client import RunClient
from rtf.applications.run.errors import NodeError, RequestError
from rtf.applications.run.protocol import Start
from rtf.applications.run.server import RunServer
from rtf.applications.xml.model import LOCALHOST
from rtf.middleware.types.codecs import BOTTLE
from rtf.testing import plugins

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rtf.applications.run.protocol import Ending, Request
    from rtf.applications.run.sysinfo import SystemInfo
    from rtf.applications.xml.model import Module
    from rtf.middleware.ports.network import Network
    from rtf.middleware.types.codecs import Codec

#: Seconds that a node may take to list programs. It is asked all the time, so a node that hangs is noticed soon.
_LISTING = 5.0
#: Seconds for the answer that YARP's nodes do not give.
_LAST_WORDS = 2.0
_OTHER = re.compile(r"[^0-9A-Za-z]")


class NodeDeployer(Deployer):
    """Runs modules on a node, ours or YARP's, that has been started there."""

    def __init__(self, place: str, context: DeployerContext) -> None:
        super().__init__(place, context)
        self.place = place if place.startswith("/") else f"/{place}"

    def _client(self, timeout: float) -> RunClient:
        return RunClient(self.place, network=self.context.network, timeout=timeout)

    def start(self, request: Start) -> int:
        reply = self._client(10.0).start(replace(request, on=self.place if request.stdio else ""))
        if reply.pid <= 0:
            reason = reply.text.strip().rpartition("\n")[2] or "the node gave no reason"
            raise DeployerError(f"{request.command} cannot be started on {self.place}: {reason}")
        return reply.pid

    def running(self) -> Mapping[str, int]:
        rows = self._client(_LISTING).running()
        return {
            row.tag: row.pid for row in rows if row.status != "zombie"
        }  # which yarprun lists until it has reaped it

    def signal(self, tag: str, signum: int) -> bool:
        client = self._client(_LISTING)
        return client.terminate(tag) if signum == signal.SIGTERM else client.kill(tag, signum)

    def ending(self, tag: str) -> Ending | None:
        try:
            return self._client(_LAST_WORDS).ending(tag)
        except NodeError:  # one of YARP, or one that is gone
            return None

    def output(self, tag: str) -> Sequence[str]:
        try:
            return self._client(_LAST_WORDS).output(tag)
        except NodeError:
            return ()

    def which(self, program: str, directory: str = "") -> str | None:
        if directory or "/" in program:  # nodes look for names on their PATH alone
            return None
        found = self._client(_LISTING).which(program)
        return found if found != program else ""

    def figures(self) -> SystemInfo | None:
        return self._client(_LISTING).system_info()


class LocalDeployer(NodeDeployer):
    """Runs modules on this machine: its node is part of this process, and is asked without the network."""

    def __init__(self, place: str, context: DeployerContext) -> None:
        super().__init__(place, context)
        self.place = context.own_name
        self._server: RunServer | None = None
        if not context.attached:
            self._opening = True
            self._server = RunServer(
                context.own_name,
                network=context.local,
                log=context.log,
                record=context.record(),
                said=self._say,
            )
            self._opening = False

    def _say(self, text: str) -> None:
        """Pass on what is done with programs that were left; the manager itself reports all else."""
        if self._opening:
            self.context.report(text)

    def _client(self, timeout: float) -> RunClient:
        if self._server is None:
            return super()._client(timeout)
        return _OwnNode(self._server, self.context.local, timeout)

    def figures(self) -> SystemInfo | None:
        return sysinfo.measure()

    def close(self) -> None:
        if self._server is not None:
            self._server.close()


class _OwnNode(RunClient):
    """The client of a node in this process. The node reads requests, and its answers, as if they had been sent."""

    def __init__(self, server: RunServer, network: Network, timeout: float) -> None:
        super().__init__(server.name, network=network, timeout=timeout)
        self._server = server

    def ask(self, request: Request, answer: Codec[Any] = BOTTLE) -> Any:  # Any: what the codec reads
        try:
            reply = self._server.answer(request.to_bottle())
        except RequestError as error:
            raise NodeError(str(error)) from None
        assert answer is BOTTLE, "figures are asked of a node by the network"
        return reply


_KNOWN: dict[str, type[Deployer]] = {"local": LocalDeployer, "node": NodeDeployer, "yarprun": NodeDeployer}
#: The deployer that needs an optional package.
SSH = "ssh"
#: The names of those that ask a machine over the network; the empty one is chosen by the node.
KNOWN_DEPLOYERS = ("", "node", "yarprun", SSH)
#: A deployer of yarpmanager that is a program in front of the module's.
PREFIXES = {"yarpdev": "yarpdev --device"}


def program_of(module: Module) -> str:
    """Return the program that is started for a module."""
    return PREFIXES.get(module.deployer, module.name).partition(" ")[0]


def is_local(node: str) -> bool:
    """Return whether a node's name means this machine."""
    return node.lower() in (LOCALHOST, "127.0.0.1", "", socket.gethostname().lower())


def find_deployer(module: Module, beside: Path) -> type[Deployer]:
    """Return the deployer of a module: the one that it names, else by its node. Raises DeployerError."""
    name = module.deployer
    if not name or name in PREFIXES:
        return LocalDeployer if is_local(module.node) else NodeDeployer
    if name in _KNOWN:
        return _KNOWN[name]
    if name == SSH:
        return _ssh_deployer()
    try:
        return plugins.load_class(plugins.find("deployer", name, beside=beside), Deployer)  # type: ignore[type-abstract]
    except plugins.PluginNotFoundError:
        raise DeployerError(
            f"there is no deployer {name!r}; there are {', '.join((*_KNOWN, SSH, *PREFIXES))}"
        ) from None
    except plugins.PluginError as error:
        raise DeployerError(f"the deployer {name!r}: {error}") from None


def _ssh_deployer() -> type[Deployer]:
    try:
        from rtf.applications.ssh.deployer import SshDeployer
    except ImportError as error:
        raise DeployerError(f"the deployer ssh needs {error.name}: pip install 'rtf[ssh]'") from None
    return SshDeployer


def request_of(module: Module, context: DeployerContext) -> Start:
    """Return the request by which a node starts a module."""
    first = PREFIXES.get(module.deployer, "")
    variables = [str(module.environment)] if module.environment else []
    if module.prefix:
        variables.append(f"YARP_PORT_PREFIX={module.prefix}")
    if module.display:
        variables.append(f"DISPLAY={module.display}")
    variables += (f"YARP_RENAME{_OTHER.sub('_', old)}={new}" for old, new in module.ports)
    return Start(
        module.tag,
        f"{first} {module.command}".lstrip(),
        directory=module.workdir,
        environment=";".join(variables),
        stdio=module.stdio,
        hold=context.hold,
        log=context.log,
    )
