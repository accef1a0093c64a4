"""From files to the application that is run: embedded ones are read, too, variables replaced, prefixes applied."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rtf.applications.xml.descriptions import figures
from rtf.applications.xml.fields import Fields
from rtf.applications.xml.model import (
    LOCALHOST,
    TCP,
    Application,
    Arbitrator,
    Connection,
    End,
    Module,
    PortDependency,
    Restart,
    RestartPolicy,
    Text,
)
from rtf.applications.xml.tree import read_tree
from rtf.applications.xml.vocabulary import check
from rtf.resources import ResourceFinder
from rtf.testing.suite.diagnostics import DiagnosticLog
from rtf.testing.verdict import Severity
from rtf.xml_tree import XmlError, quote

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from rtf.errors import Location
    from rtf.testing.events import Diagnosed
    from rtf.xml_tree import Element

#: What an application may have, with all that it embeds; and how deep that may be.
MAX_MODULES, MAX_CONNECTIONS, MAX_EMBEDDED, MAX_NESTED = 2000, 20_000, 1000, 32
_SUFFIXES = ("", ".xml", ".xml.template")


@dataclass(frozen=True, slots=True)
class Loaded:
    """What was read, and all problems. An application with errors is not run."""

    application: Application
    diagnostics: tuple[Diagnosed, ...]

    @property
    def has_errors(self) -> bool:
        """Whether it cannot be used."""
        return any(one.severity is Severity.ERROR for one in self.diagnostics)


def read_application(path: Path, variables: Mapping[str, str] | None = None, *, root: Element | None = None) -> Loaded:
    """Read an application, or the template of one, and all that it embeds. ``variables`` replace those of the file.

    ``root`` is read instead of the content of the file, which may not have it yet.
    """
    problems = DiagnosticLog()
    reader = _Reader(problems, variables or {}, {} if root is None else {path.resolve(): root})
    application = Application(Text(path.stem), str(path))
    try:
        application = reader.read(path, (), "", {})
    except XmlError as error:
        problems.error(error.message, error.location, error.hint)
    return Loaded(application, tuple(problems))


class _Reader:
    """Reads one application. Problems are collected, and reading goes on where it can."""

    def __init__(self, problems: DiagnosticLog, given: Mapping[str, str], unsaved: Mapping[Path, Element]) -> None:
        self._problems = problems
        self._given = given
        self._unsaved = unsaved
        self._trees: dict[Path, Element] = {}
        self._spent = [0]
        self._counts: Counter[str] = Counter()
        self._same: Counter[Module] = Counter()

    def read(self, path: Path, above: tuple[Path, ...], prefix: str, inherited: Mapping[str, str]) -> Application:
        """Read a file; ``above`` are those that embed it, outermost first."""
        root = self._tree(path)
        if root.name != "application":
            raise XmlError(
                f"the file holds <{root.tag[:40]}>", root.location, "an application begins with <application>"
            )
        fields = Fields(self._problems, self._variables(root, inherited), self._spent)
        modules, connections, arbitrators, embedded = [], [], [], []
        needed = [*self._dependencies(root, fields, prefix)]
        for child in root.children:
            match child.name:
                case "module":
                    modules.append(self._module(child, fields, prefix))
                case "connection":
                    connections.append(self._connection(child, fields, prefix))
                case "arbitrator":
                    arbitrators.append(self._arbitrator(child, fields, prefix))
                case "application":
                    inner = self._embedded(child, fields, (*above, path), prefix)
                    if inner is not None:
                        embedded += [inner.file, *inner.embedded]
                        modules += inner.modules
                        connections += inner.connections
                        arbitrators += inner.arbitrators
                        needed += inner.dependencies
        return Application(
            fields.text(root, "name", path.name.partition(".")[0]),
            str(path),
            fields.text(root, "description"),
            fields.text(root, "version"),
            tuple(fields.of(one) for group in fields.all(root, "authors") for one in fields.all(group, "author")),
            tuple(dict.fromkeys(needed)),
            tuple(filter(None, modules)),
            tuple(filter(None, connections)),
            tuple(filter(None, arbitrators)),
            tuple(embedded),
        )

    def _tree(self, path: Path) -> Element:
        real = path.resolve()
        if real not in self._trees:
            root = self._trees[real] = self._unsaved.get(real) or read_tree(path, self._problems.warning)
            if root.name == "application":
                check(root, "application", self._problems)
        return self._trees[real]

    def _variables(self, root: Element, inherited: Mapping[str, str]) -> Mapping[str, str]:
        """Return the variables of a file: its own, whose values may use earlier ones, over those of the embedding."""
        found = {**inherited, **self._given}
        fields = Fields(self._problems, found, self._spent)
        for element in fields.all(root, "var"):
            name = fields.attribute(element, "name")
            if not name:
                self._problems.error("<var> has no name", element.location, 'write <var name="…">')
            elif name not in self._given:
                found[name] = fields.of(element)
        return found

    def _count(self, what: str, most: int, place: Location) -> None:
        self._counts[what] += 1
        if self._counts[what] > most:
            raise XmlError(f"the application has more than {most} {what}", place, "take it apart")

    # Elements ----------------------------------------------------------------------------------------------------

    def _module(self, element: Element, fields: Fields, prefix: str) -> Module | None:
        self._count("modules", MAX_MODULES, element.location)
        name = fields.text(element, "name")
        if not name:
            self._problems.error("<module> has no name", element.location, "write <name>PROGRAM</name>")
            return None
        waits = {"start": 0.0, "stop": 0.0}
        for one in (wait for group in fields.all(element, "ensure") for wait in fields.all(group, "wait")):
            when = fields.attribute(one, "when").lower() or "start"
            if when not in waits:
                self._problems.error(f"when is start or stop, not {quote(when)}", one.attribute_location("when"))
            waits[when] = fields.seconds(fields.of(one), "<wait>", 0.0) or 0.0
        made = Module(
            name,
            fields.text(element, "parameters"),
            fields.text(element, "node", LOCALHOST),
            fields.text(element, "deployer"),
            fields.text(element, "stdio"),
            fields.text(element, "workdir"),
            prefix + fields.text(element, "prefix"),
            fields.text(element, "environment"),
            fields.text(element, "display"),
            tuple(self._dependencies(element, fields, prefix)),
            waits["start"],
            waits["stop"],
            tuple((fields.text(one, "old"), fields.text(one, "new")) for one in fields.all(element, "portmap")),
            self._restart(element, fields),
            anywhere=not fields.text(element, "node"),
            needs=tuple(
                pair
                for group in fields.all(element, "dependencies")
                for one in fields.all(group, "computer")
                for pair in figures(one, fields)
            ),
            location=element.location,
        )
        alike = Module(name, made.parameters, made.node, environment=made.environment)
        self._same[alike] += 1
        return replace(made, number=self._same[alike] - 1)

    def _restart(self, element: Element, fields: Fields) -> Restart:
        found = next(fields.all(element, "restart"), None)
        if found is None:
            return Restart()
        policy = fields.choice(fields.of(found), RestartPolicy, RestartPolicy.NEVER, "<restart>")
        attempts, most = fields.attribute(found, "attempts") or "5", 1000
        if not (attempts.isascii() and attempts.isdigit() and 0 < int(attempts[:5]) <= most):
            self._problems.error(f"attempts is a whole number from 1 to {most}", found.location)
            attempts = "5"
        backoff = fields.seconds(fields.attribute(found, "backoff"), "backoff", 1.0)
        return Restart(policy, int(attempts), 1.0 if backoff is None else backoff)

    def _dependencies(self, element: Element, fields: Fields, prefix: str) -> Iterator[PortDependency]:
        for one in (port for group in fields.all(element, "dependencies") for port in fields.all(group, "port")):
            port = self._port(fields.of(one), prefix)
            if port is not None:
                timeout = fields.seconds(fields.attribute(one, "timeout"), "timeout")
                yield PortDependency(port, timeout, fields.attribute(one, "request"), fields.attribute(one, "reply"))

    def _connection(self, element: Element, fields: Fields, prefix: str) -> Connection | None:
        self._count("connections", MAX_CONNECTIONS, element.location)
        ends = [self._end(element, fields, prefix, *names) for names in (("from", "output"), ("to", "input"))]
        if ends[0] is None or ends[1] is None:
            return None
        return Connection(
            ends[0],
            ends[1],
            fields.text(element, "protocol", TCP),
            fields.truth(fields.attribute(element, "persist"), "persist"),
            fields.attribute(element, "id"),
            element.location,
        )

    def _end(self, element: Element, fields: Fields, prefix: str, *names: str) -> End | None:
        found = next(fields.all(element, *names), None)
        if found is None:
            self._problems.error(f"<connection> has no <{names[0]}>", element.location, "it needs <from> and <to>")
            return None
        external = fields.truth(fields.attribute(found, "external"), "external")
        port = self._port(fields.of(found), "" if external else prefix)
        qos = fields.attribute(found, "qos") or fields.attribute(element, "qos")
        return None if port is None else End(port, external, qos)

    def _arbitrator(self, element: Element, fields: Fields, prefix: str) -> Arbitrator | None:
        port = self._port(fields.text(element, "port"), prefix)
        rules = ((fields.attribute(one, "connection"), fields.of(one)) for one in fields.all(element, "rule"))
        return None if port is None else Arbitrator(port, tuple(rules))

    def _port(self, name: Text, prefix: str) -> Text | None:
        if not name.startswith("/") or any(map(str.isspace, name)):
            what = f"{quote(name)} is no port" if name else "the name of a port is missing"
            self._problems.error(what, name.location, "it begins with '/' and has no blanks, such as /camera/left")
            return None
        return Text(prefix + name, name.location)

    # Embedding ---------------------------------------------------------------------------------------------------

    def _embedded(self, element: Element, fields: Fields, above: tuple[Path, ...], prefix: str) -> Application | None:
        self._count("embedded applications", MAX_EMBEDDED, element.location)
        name, own = fields.text(element, "name"), fields.text(element, "prefix")
        path = find_application(name, above[-1].parent) if name else None
        if path is None:
            beside = f"put its file beside {above[-1].name}, or into a folder 'applications' of YARP_DATA_DIRS"
            self._problems.error(f"there is no application {quote(name)}", name.location, beside)
            return None
        if path.resolve() in [one.resolve() for one in above] or len(above) >= MAX_NESTED:
            chain = " -> ".join(one.name for one in (*above, path))
            self._problems.error(f"the application embeds itself: {chain}", name.location, "remove one of them")
            return None
        try:
            return self.read(path, above, prefix + own, fields.variables)
        except XmlError as error:
            self._problems.error(error.message, error.location, error.hint)
            return None


def find_application(name: str, beside: Path) -> Path | None:
    """Return the file of an application: by its file name, or by its ``<name>``; beside a file, or where YARP looks."""
    finder = ResourceFinder(cwd=beside)
    for suffix in _SUFFIXES:
        if (beside / f"{name}{suffix}").is_file():
            return beside / f"{name}{suffix}"
        found = finder.search(f"{name}{suffix}", resource_type="applications").path
        if found is not None and found.is_file():
            return found
    return next((path for path in _files(beside) if name_in(path) == name), None)


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.xml"))[:MAX_EMBEDDED]


def name_in(path: Path) -> str:
    """Return the name in an application's file; empty if it is none."""
    try:
        root = read_tree(path)
    except XmlError:
        return ""
    names = (child.text for child in root.children if child.name == "name")
    return next(names, path.stem) if root.name == "application" else ""
