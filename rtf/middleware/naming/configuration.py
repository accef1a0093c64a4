"""Which name server a process uses, and what its ports are called: the user's configuration, and the environment.

Every function takes the environment, so that nothing is read behind anybody's back; without one it is that of the
process. Whatever only some configurations need is loaded when one does: tools are started often, and end soon.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, as_int, as_string
from rtf.errors import RtfError
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError
from rtf.middleware.names import Contact
from rtf.middleware.naming.authentication import find_key
from rtf.middleware.network import Network, Opening

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.naming.book import Names

NAMESPACE = "/root"
_NAMESPACE_FILE = "yarp_namespace.conf"
_STANDARD_PORT = 10000
_HIGHEST = 65535
_MOST = 25_600
_OTHER = re.compile(r"[^0-9A-Za-z]")
_HOST_PORT = 2


@dataclass(frozen=True, slots=True)
class Place:
    """What a contact file says: where the name server is, and by which mode it is asked (``yarp`` or ``local``)."""

    contact: Contact
    mode: str = "yarp"


# Files -----------------------------------------------------------------------------------------------------------


def config_home(environment: Mapping[str, str] | None = None) -> Path:
    """The user's folder of YARP's configuration. Raises MiddlewareError when nothing says where it is."""
    given = os.environ if environment is None else environment
    if given.get("YARP_CONFIG_HOME"):
        return Path(given["YARP_CONFIG_HOME"])
    if given.get("XDG_CONFIG_HOME"):
        return Path(given["XDG_CONFIG_HOME"], "yarp")
    if given.get("HOME"):
        return Path(given["HOME"], ".config", "yarp")
    raise MiddlewareError("there is no folder for YARP's configuration: set YARP_CONFIG_HOME or HOME")


def namespaces(environment: Mapping[str, str] | None = None) -> list[str]:
    """The name servers that are asked, by their names: ``YARP_NAMESPACE``, else the namespace file, else ``/root``."""
    given = os.environ if environment is None else environment
    text = given.get("YARP_NAMESPACE", "")
    if not text:
        text = _read(config_home(given) / (given.get("YARP_CONFIG_NAMESPACE_FILENAME") or _NAMESPACE_FILE))
    words = Bottle.parse(text)
    group = words.find_group("name")
    found = [as_string(word) for word in (words if group is None else group.tail())]
    return [*filter(None, found)] or [NAMESPACE]


def contact_file(namespace: str = "", environment: Mapping[str, str] | None = None) -> Path:
    """The file that says where the name server is; without a namespace that of the first one."""
    namespace = namespace or namespaces(environment)[0]
    name = "yarp" if namespace == NAMESPACE else _OTHER.sub("_", namespace)
    return config_home(environment) / f"{name}.conf"


def read_place(namespace: str = "", environment: Mapping[str, str] | None = None) -> Place | None:
    """Where the name server is; None when no file says so. Raises AddressError for a file that cannot be understood."""
    namespace = namespace or namespaces(environment)[0]
    path = contact_file(namespace, environment)
    text = _read(path)
    if not text.strip():
        return None
    fields = _fields_of_section(text, namespace, path) if text.lstrip().startswith("[") else text.split()
    if len(fields) < _HOST_PORT or not fields[1].isdecimal() or not 0 < int(fields[1]) <= _HIGHEST:
        raise AddressError(f"{path} should say 'HOST PORT yarp', but says {text[:80]!r}; 'rtf conf --clean' removes it")
    mode = fields[2] if len(fields) > _HOST_PORT else "yarp"
    return Place(Contact(namespace, fields[0], int(fields[1]), "tcp"), mode or "yarp")


def _fields_of_section(text: str, namespace: str, path: Path) -> list[str]:
    """The other form of the file: a section named after the namespace, or ``name``, with keys."""
    from rtf.resources import parse_property_text

    try:
        properties = parse_property_text(text, file=str(path)).properties
    except RtfError as error:
        raise AddressError(f"{path} cannot be read: {error}") from None
    section = properties.find_group(namespace) or properties.find_group("name")
    if section is None:
        return []
    mode = as_string(section.find("mode"))
    return [as_string(section.find("host")), str(as_int(section.find("port"))), *filter(None, [mode])]


def write_place(contact: Contact, mode: str = "yarp", environment: Mapping[str, str] | None = None) -> Path:
    """Store where the name server of a namespace (its name) is; returns the file. Raises MiddlewareError."""
    path = contact_file(contact.name, environment)
    beside = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(f"{contact.host} {contact.port} {mode}\n", encoding="utf-8")
        beside.replace(path)  # so that nobody reads half of it
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise MiddlewareError(f"{path} cannot be written: {error.strerror or error}") from None
    return path


def remove_place(namespace: str = "", environment: Mapping[str, str] | None = None) -> Path:
    """Forget where the name server is; returns the file, whether it was there or not."""
    path = contact_file(namespace, environment)
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise MiddlewareError(f"{path} cannot be removed: {error.strerror or error}") from None
    return path


def _read(path: Path) -> str:
    try:
        with path.open(encoding="utf-8", errors="surrogateescape") as file:
            return file.read(_MOST)
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise MiddlewareError(f"{path} cannot be read: {error.strerror or error}") from None


# The environment -------------------------------------------------------------------------------------------------


def base_port(environment: Mapping[str, str] | None = None) -> int:
    """The number of the name server where nothing else says one: ``YARP_PORT_RANGE``, else 10000."""
    given = os.environ if environment is None else environment
    return _number(given, "YARP_PORT_RANGE") or _STANDARD_PORT


def opening(environment: Mapping[str, str], name: str) -> Opening:
    """What a port is called that the program opens by a name, and the number it shall have.

    ``YARP_RENAME_x`` replaces the name and ``YARP_PORTNUMBER_x`` says the number, where ``x`` is the name with ``_``
    for everything but letters and digits; ``YARP_PORT_PREFIX`` comes in front of what is not nameless.
    """
    if not name:
        return Opening(name)
    safe = _OTHER.sub("_", name)
    renamed = environment.get(f"YARP_RENAME{safe}") or name
    return Opening(environment.get("YARP_PORT_PREFIX", "") + renamed, _number(environment, f"YARP_PORTNUMBER{safe}"))


def _number(environment: Mapping[str, str], variable: str) -> int:
    text = environment.get(variable, "")
    if not text:
        return 0
    if not text.isdecimal() or not 0 < int(text) <= _HIGHEST:
        raise AddressError(f"{variable} is {text!r}; write a number from 1 to {_HIGHEST}")
    return int(text)


# The network of the process --------------------------------------------------------------------------------------


def find_names(environment: Mapping[str, str] | None = None) -> Names:
    """The names that the configuration says; without a contact file a server at the standard place of this machine.

    Nothing is asked yet. Raises MiddlewareError for a configuration that cannot be used.
    """
    given = os.environ if environment is None else environment
    found = [_names_of(namespace, given) for namespace in namespaces(given)]
    if len(found) == 1:
        return found[0]
    from rtf.middleware.naming.several import SeveralNames

    return SeveralNames(found)


def _names_of(namespace: str, environment: Mapping[str, str]) -> Names:
    place = read_place(namespace, environment)
    if place is None:
        place = Place(Contact(namespace, "127.0.0.1", base_port(environment), "tcp"))
    if place.mode == "local":
        from rtf.middleware.naming.local import LocalNames

        return LocalNames()
    if place.mode != "yarp":
        raise ConnectError(
            f"{contact_file(namespace, environment)} asks for a name server of mode {place.mode!r};"
            " there are yarp and local"
        )
    from rtf.middleware.naming.client import RemoteNames
    from rtf.middleware.naming.interfaces import chosen_address

    return RemoteNames(place.contact, address=chosen_address(environment), key=find_key(environment))


def find_network(environment: Mapping[str, str] | None = None) -> Network:
    """The network that the configuration says, for ports that are given none."""
    given = os.environ if environment is None else environment
    return Network(find_names(given), opening=partial(opening, given), key=find_key(given))
