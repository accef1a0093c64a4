"""The vocabulary of application files: which elements there are, what may stand in each, and what each is for.

Files are checked by this one table, and the published schema ``application.xsd`` is made of it, so the two agree.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from rtf.errors import nearest
from rtf.xml_tree import COMMENT, quote

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rtf.testing.suite.diagnostics import DiagnosticLog
    from rtf.xml_tree import Element

_FOREIGN = ("xmlns", "xsi:", "xml:")  # what editors put there to find the schema


@dataclass(frozen=True, slots=True)
class Kind:
    """What a kind of element is for, the kinds of the elements in it by name, its attributes, and if it has text."""

    about: str
    children: Mapping[str, str] = field(default_factory=dict)
    attributes: tuple[str, ...] = ()
    text: bool = True


def _inside(words: str) -> dict[str, str]:
    """Read ``name port:needed``: the kind is that of the name unless it is written behind it."""
    pairs = (word.partition(":") for word in words.split())
    return {name: kind or name for name, _, kind in pairs}


def _group(about: str, words: str, *attributes: str) -> Kind:
    return Kind(about, _inside(words), attributes, text=False)


_TEXT = "name:text description:text version:text"
KINDS: Mapping[str, Kind] = {
    "application": _group(
        "An application: programs, their connections, and other applications.",
        f"{_TEXT} authors var dependencies module:program application:embedded connection arbitrator",
    ),
    "text": Kind("A text. ${x} stands for the variable x of the file, $ENV{X} for one of the environment."),
    "authors": _group("Who has written it.", "author"),
    "author": Kind("A name.", attributes=("email",)),
    "var": Kind("The value of a variable.", attributes=("name",)),
    "dependencies": _group("What has to be there before something is started.", "port:needed computer:figures"),
    "needed": Kind(
        "A port that has to be open and, with a request, has to give the reply. The timeout is in seconds.",
        attributes=("timeout", "request", "reply"),
    ),
    "program": _group(
        "A program that is started.",
        "name:text parameters:text node:text stdio:text workdir:text deployer:text prefix:text environment:text"
        " display:text rank:text tag:text description:text dependencies ensure portmap restart geometry:text",
    ),
    "ensure": _group("When it counts as started.", "wait"),
    "wait": Kind("Seconds to wait: after its start, or before its stop.", attributes=("when",)),
    "portmap": _group("A port that gets another name.", "old:text new:text"),
    "restart": Kind(
        "Whether it is started again when it ends: never, on-failure or always. Seconds between two attempts: backoff."
        " An extension of RTF.",
        attributes=("attempts", "backoff"),
    ),
    "embedded": _group("Another application, by its file or its name.", "name:text prefix:text geometry:text"),
    "connection": _group(
        "A connection, made when both ports are open. One that persists is made again whenever they are.",
        "from:end to:end output:end input:end protocol:text description:text geometry:text",
        "id",
        "persist",
        "qos",
    ),
    "end": Kind(
        "A port; external, if no program of this application opens it.", attributes=("external", "qos", "type")
    ),
    "arbitrator": _group("Rules for which of several connections a port accepts.", "port:text rule geometry:text"),
    "rule": Kind("When the connection is accepted.", attributes=("connection",)),
    "module": _group(
        "The description of a program: what it takes, reads, writes and needs.",
        f"{_TEXT} authors arguments data services dependencies development deployer:text geometry:text",
    ),
    "arguments": _group("The words of its command line.", "param switch:param"),
    "param": Kind("A --parameter with a value, or a --switch without one.", attributes=("required", "default", "desc")),
    "data": _group("The ports with its data.", "input:channel output:channel"),
    "services": _group("The ports for requests.", "server:channel client:channel"),
    "channel": _group(
        "A port, and the type of its messages; whether it has to be connected.",
        "type:text port:described required:text priority:text description:text name:text",
        "port_type",
    ),
    "described": Kind("The name of the port.", attributes=("carrier",)),
    "development": _group("How it is built.", "library:text header:text version:text"),
    "resources": _group("The machines of a lab.", "computer"),
    "computer": _group(
        "A machine: the name of its node, and its figures.",
        "name:text description:text disable:text os:figures platform:figures memory:figures storage:figures"
        " processor:figures network:figures gpu:figures peripheral:figures",
    ),
    "figures": Kind("Figures by name."),
}
ROOTS = ("application", "module", "resources")


def check(element: Element, kind: str, problems: DiagnosticLog) -> None:
    """Warn of elements, attributes and texts that have no meaning, in an element of a kind and all below it."""
    known = KINDS[kind]
    for name in element.attributes:
        if name not in known.attributes and not name.startswith(_FOREIGN):
            hint = _hint(name, known.attributes)
            place = element.attribute_location(name)
            problems.warning(f"the attribute {quote(name)} of <{element.name}> has no meaning", place, hint)
    if kind == "figures":
        return
    if not known.text and element.text:
        problems.warning(f"the text {quote(element.text)} in <{element.name}> has no meaning", element.location)
    for child in element.children:
        if child.name in known.children:
            check(child, known.children[child.name], problems)
        elif child.tag != COMMENT:
            problems.warning(
                f"<{quote(child.tag)[1:-1]}> in <{element.name}> has no meaning",
                child.location,
                _hint(child.name, known.children),
            )


def _hint(name: str, known: Mapping[str, str] | tuple[str, ...]) -> str:
    near = nearest(name[:64], known)
    return f"did you mean {near}?" if near else ""


def schema() -> str:
    """Return the XML schema of application files, which editors use to complete and explain them."""
    return "\n".join(_schema()) + "\n"


def _schema() -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" elementFormDefault="unqualified" version="1.0">'
    yield from (f'  <xs:element name="{name}" type="{name}"/>' for name in ROOTS)
    for name, kind in KINDS.items():
        mixed = ' mixed="true"' if kind.text else ""
        yield f'  <xs:complexType name="{name}"{mixed}>'
        yield f"    <xs:annotation><xs:documentation>{escape(kind.about)}</xs:documentation></xs:annotation>"
        yield '    <xs:choice minOccurs="0" maxOccurs="unbounded">'
        if name == "figures":
            yield '      <xs:any processContents="skip"/>'
        for child, its_kind in kind.children.items():
            yield f"      <xs:element name={quoteattr(child)} type={quoteattr(its_kind)}/>"
        yield "    </xs:choice>"
        yield from (f'    <xs:attribute name="{one}" type="xs:string"/>' for one in kind.attributes)
        yield "  </xs:complexType>"
    yield "</xs:schema>"
