"""What is wrong in an application before anything is started: by its files alone, and by asking the network."""

from __future__ import annotations

import re
import threading
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.applications.connections import read_qos
from rtf.applications.deployer import DeployerContext
from rtf.applications.deployers import (
    KNOWN_DEPLOYERS,
    SSH,
    LocalDeployer,
    find_deployer,
    is_local,
    program_of,
)
from rtf.applications.errors import ApplicationError
from rtf.applications.placement import Placement, allowed_nodes, lacking
from rtf.applications.ports import Order, beginnings, ports_of
from rtf.applications.run.protocol import read_environment, split_words
from rtf.applications.substitutions import is_there, substitute, table_of
from rtf.applications.xml.descriptions import find_computers, find_description
from rtf.errors import RtfError
from rtf.middleware.carriers import registry
from rtf.middleware.ports import remote
from rtf.middleware.ports.qos import QosError
from rtf.middleware.wire import modifiers
from rtf.middleware.wire.contact import Contact
from rtf.xml_tree import quote

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rtf.applications.deployer import Deployer
    from rtf.applications.xml.model import Application, Channel, Connection, Module, Text
    from rtf.middleware.ports.network import Network
    from rtf.testing.suite.diagnostics import DiagnosticLog

#: Carriers that YARP has, as an option of its build, and RTF does not.
_OF_YARP = (
    *("shmem", "bcast", "bayer", "depthimage", "depthimage2", "h264", "mpi", "xmlrpc", "rossrv", "tcpros"),
    *("websocket", "zfp"),
)
_SPACE = re.compile(r"\s+|\w+::")
_ANY = ("", "*", "any")


def check_application(
    application: Application, problems: DiagnosticLog, network: Network | None = None
) -> Sequence[str]:
    """Collect the problems of an application. With a network its nodes and external ports are asked for.

    Returns which nodes would be chosen now, a sentence for each module that leaves the choice.
    """
    return _Check(application, problems, network).run()


class _Check:
    def __init__(self, application: Application, problems: DiagnosticLog, network: Network | None) -> None:
        self._application = application
        self._modules = application.modules
        self._problems = problems
        self._network = network
        self._folder = Path(application.file).parent
        self._descriptions = [find_description(one.name, self._folder, problems) for one in self._modules]
        self._ports = [ports_of(*pair) for pair in zip(self._modules, self._descriptions, strict=True)]
        self._computers = find_computers(self._folder, problems)

    def run(self) -> Sequence[str]:
        """Make all checks. Return the sentences about nodes."""
        self._check_programs()
        self._check_arguments()
        self._check_names()
        self._check_order()
        for connection in self._application.connections:
            self._check_carrier(connection)
            self._check_types(connection)
        self._check_required_inputs()
        self._check_twice()
        self._check_arbitrators()
        self._check_openers()
        self._check_computers()
        return [] if self._network is None else self._check_places(self._network)

    # Modules -----------------------------------------------------------------------------------------------------

    def _check_programs(self) -> None:
        try:
            table = table_of(self._folder)
        except ApplicationError as error:
            return self._problems.error(str(error), self._application.name.location)
        for module in self._modules:
            found = substitute(module, table)
            if found.missing and not found.optional:
                self._problems.error(found.message, module.name.location, "install it, or take the module out")
            elif found.message:
                self._problems.warning(found.message, module.name.location)
            try:
                local = find_deployer(module, self._folder) is LocalDeployer
            except ApplicationError as error:
                self._problems.error(str(error), module.deployer.location)
                continue
            if module.deployer == SSH and module.stdio:
                message = f"{module}: no terminal is opened for a program that is started by ssh"
                self._problems.warning(
                    message, module.stdio.location, "remove <stdio>; its output is shown all the same"
                )
            program = program_of(module)
            local = local and not allowed_nodes(module, self._computers)
            if local and not found.message and not is_there(program, module.workdir):
                self._problems.error(f"there is no program {quote(program)}", module.name.location, "install it")
        return None

    def _check_arguments(self) -> None:
        for module, description in zip(self._modules, self._descriptions, strict=True):
            words = split_words(module.parameters)
            for argument in description.arguments if description is not None else ():
                if argument.required and not argument.default and f"--{argument.name}" not in words:
                    self._problems.error(
                        f"{module.name} needs the argument --{argument.name}", module.location, argument.description
                    )

    def _check_names(self) -> None:
        """Find modules that open the same port: by their descriptions, or because they are the same."""
        by_port: dict[str, list[Module]] = defaultdict(list)
        for module, ports in zip(self._modules, self._ports, strict=True):
            for port in ports.described or ([ports.stem] if ports.stem else []):
                by_port[port].append(module)
        for port, modules in by_port.items():
            for other in modules[1:]:
                self._problems.error(
                    f"{other} opens the port {port}, and so does {modules[0]}",
                    other.location,
                    "give one of them a <prefix>, a <portmap> or another --name",
                )

    def _check_order(self) -> None:
        order = Order(self._application, self._ports)
        if order.circle:
            place = self._modules[order.circle[0]].location
            message = f"modules wait for each other: {order.circle_text(self._application)}"
            self._problems.error(message, place, "remove one of their <dependencies>")

    # Connections -------------------------------------------------------------------------------------------------

    def _check_carrier(self, connection: Connection) -> None:
        carrier = connection.carrier
        plain = modifiers.split(carrier)[0]
        if plain in _OF_YARP:
            self._problems.warning(f"{connection}: only programs of YARP have the carrier {plain}", carrier.location)
        elif plain not in registry.names():
            hint = self._problems.did_you_mean(plain, registry.names())
            self._problems.error(f"{connection}: there is no carrier {quote(plain)}", carrier.location, hint)
        for end in (connection.source, connection.target):
            try:
                read_qos(end.qos)
            except QosError as error:
                self._problems.error(f"{connection}: {error}", end.qos.location)

    def _check_types(self, connection: Connection) -> None:
        source, target = self._channel(connection.source.port), self._channel(connection.target.port)
        if source is None or target is None:
            return
        if source[0] == "input" or target[0] == "output":
            wrong = connection.source.port if source[0] == "input" else connection.target.port
            kind = source[0] if source[0] == "input" else target[0]
            self._problems.error(f"{connection} is the wrong way round: {wrong} is an {kind}", connection.location)
            return
        sent, read = (_SPACE.sub("", one[1].type).lower() for one in (source, target))
        if sent not in _ANY and read not in _ANY and sent != read:
            message = f"{connection}: {source[1].type} is sent, and {target[1].type} is read"
            self._problems.error(message, connection.location, "connect ports of one type")

    def _channel(self, port: str) -> tuple[str, Channel] | None:
        return next((one.described[port] for one in self._ports if port in one.described), None)

    def _check_required_inputs(self) -> None:
        fed = {str(one.target.port) for one in self._application.connections}
        for module, ports in zip(self._modules, self._ports, strict=True):
            for port, (kind, channel) in ports.described.items():
                if kind == "input" and channel.required and port not in fed:
                    message = f"nothing is connected to {port}, which {module.name} requires"
                    self._problems.error(message, module.location, f"add a <connection> to {port}")

    def _check_twice(self) -> None:
        counts = Counter((one.source.port, one.target.port) for one in self._application.connections)
        for one in self._application.connections:
            if counts.pop((one.source.port, one.target.port), 0) > 1:
                self._problems.warning(f"{one} is there more than once", one.location, "keep one")

    def _check_arbitrators(self) -> None:
        known = {one.name for one in self._application.connections}
        for arbitrator in self._application.arbitrators:
            message = f"the rules of {arbitrator.port} are drawn, and not applied, by yarpmanager as well"
            hint = "give its connections monitors, such as tcp+recv.portmonitor+type.py+file.only+constraint.not.e_a"
            self._problems.warning(message, arbitrator.port.location, hint)
            for name, _ in arbitrator.rules:
                if name not in known:
                    hint = self._problems.did_you_mean(name, known - {""})
                    self._problems.error(f"there is no connection with the id {quote(name)}", name.location, hint)

    def _check_openers(self) -> None:
        """Find ports that nobody opens. A program of which nothing is known could open any."""
        known = all(one.described or one.stem for one in self._ports)
        report = self._problems.error if all(self._descriptions) else self._problems.warning
        described = {port for one in self._ports for port in one.described}
        stems = {one.stem for one in self._ports}
        for port, external in self._mentioned():
            if port in described or not stems.isdisjoint(beginnings(port)) or self._exists(port):
                continue
            if external and self._network is not None:
                self._problems.error(f"the external port {port} is not open", port.location, "start its program")
            elif known and not external:
                report(f"no program opens the port {port}", port.location, 'or mark it with external="true"')

    def _mentioned(self) -> Iterator[tuple[Text, bool]]:
        application = self._application
        for connection in application.connections:
            for end in (connection.source, connection.target):
                yield end.port, end.external
        for dependency in application.dependencies:
            yield dependency.port, True
        for module in self._modules:
            yield from ((one.port, False) for one in module.dependencies)

    def _exists(self, port: str) -> bool:
        return self._network is not None and remote.exists(self._network, Contact(port))

    def _check_computers(self) -> None:
        """Compare what descriptions need with the machines that are described."""
        computers = {one.name.lstrip("/"): one for one in self._computers}
        for module, description in zip(self._modules, self._descriptions, strict=True):
            computer = computers.get(module.node.lstrip("/"))
            if computer is None or module.anywhere:
                continue
            if computer.disabled:
                message = f"the machine {module.node} is disabled, by {computer.name.location}"
                self._problems.error(message, module.node.location, "choose another node")
            needs = [*(description.needs if description is not None else ()), dict(module.needs)]
            for lack in lacking(computer.figures, needs):
                self._problems.error(
                    f"{module.name} cannot run on {module.node}: {lack}", module.node.location, "choose another node"
                )

    # The network -------------------------------------------------------------------------------------------------

    def _check_places(self, network: Network) -> Sequence[str]:
        """Ask the nodes of all modules, also for their programs. Return which nodes would be chosen."""
        context = DeployerContext(network, network, "/app/check", attached=True)
        deployers: dict[tuple[type[Deployer], str], Deployer] = {}
        making = threading.Lock()

        def deployer_of(module: Module) -> Deployer:
            key = find_deployer(module, self._folder), module.node.lstrip("/")
            with making:
                if key not in deployers:
                    deployers[key] = key[0](module.node, context)
                return deployers[key]

        try:
            self._check_nodes(deployer_of)
            return [*self._choices(deployer_of)]
        finally:
            for deployer in deployers.values():
                deployer.close()

    def _check_nodes(self, deployer_of: Callable[[Module], Deployer]) -> None:
        """Ask each node once if it is there, and then for the programs of its modules."""
        asked: dict[tuple[str, str], list[Module]] = defaultdict(list)
        for module in self._modules:
            known = module.deployer in KNOWN_DEPLOYERS and not is_local(module.node)
            if known and not allowed_nodes(module, self._computers):
                asked[module.deployer, module.node].append(module)

        def ask(modules: Sequence[Module]) -> tuple[RtfError | None, Sequence[Module]]:
            try:
                deployer_of(modules[0]).running()
                return None, [one for one in modules if not _is_there(one, deployer_of(one))]
            except RtfError as error:
                return error, ()

        with ThreadPoolExecutor(max(1, min(len(asked), 16))) as pool:
            for (first, *_), (error, missing) in zip(asked.values(), pool.map(ask, asked.values()), strict=True):
                if error is not None:
                    hint = (
                        "" if first.deployer == SSH else f"start it there: rtf run --server /{first.node.lstrip('/')}"
                    )
                    self._problems.error(str(error), first.node.location, hint)
                for module in missing:
                    message = f"there is no program {quote(program_of(module))} on {module.node}"
                    self._problems.error(message, module.name.location, "install it there")

    def _choices(self, deployer_of: Callable[[Module], Deployer]) -> Iterator[str]:
        placement = Placement(self._modules, self._computers, deployer_of, find=False)
        for module, description in zip(self._modules, self._descriptions, strict=True):
            placed = placement.place(module, description.needs if description is not None else ())
            if placed.module is None:
                self._problems.error(f"{module}: {placed.why}", module.node.location, "start a node, or need less")
            elif placed.why:
                yield placed.why


def _is_there(module: Module, deployer: Deployer) -> bool:
    """Return whether a module's program is on its machine, as far as that is known."""
    if "PATH" in read_environment(module.environment):
        return True
    return deployer.which(program_of(module), module.workdir) != ""
