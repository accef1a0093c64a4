"""The choice of the name server and of port names, by the user's configuration files and the environment.

Every function takes the environment as an argument; None: that of the process. Modules that only some configurations
need are imported on use: tools are started often and end soon.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Dialect, as_int, as_string, to_string
from rtf.errors import RtfError
from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError
from rtf.middleware.ports.network import Network, Opening
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.middleware.ports.names import Names

NAMESPACE = "/root"
_NAMESPACE_FILE = "yarp_namespace.conf"
_KEY_FILE, _KEY_SECTION = "auth.conf", "AUTH"
_STANDARD_PORT = 10000
_HIGHEST = 65535
_MOST = 25_600
_OTHER = re.compile(r"[^0-9A-Za-z]")
_HOST_PORT = 2


@dataclass(frozen=True, slots=True)
class Place:
    """The contents of a contact file: the name server's contact and its mode (``yarp`` or ``local``)."""

    contact: Contact
    mode: str = "yarp"


# Files -----------------------------------------------------------------------------------------------------------


def config_home(environment: Mapping[str, str] | None = None) -> Path:
    """Return the folder of YARP's user configuration. Raises MiddlewareError if no variable defines it."""
    given = os.environ if environment is None else environment
    if given.get("YARP_CONFIG_HOME"):
        return Path(given["YARP_CONFIG_HOME"])
    if given.get("XDG_CONFIG_HOME"):
        return Path(given["XDG_CONFIG_HOME"], "yarp")
    if given.get("HOME"):
        return Path(given["HOME"], ".config", "yarp")
    raise MiddlewareError("there is no folder for YARP's configuration: set YARP_CONFIG_HOME or HOME")


def namespaces(environment: Mapping[str, str] | None = None) -> list[str]:
    """Return the namespaces to use: ``YARP_NAMESPACE``, else the namespace file, else ``/root``."""
    given = os.environ if environment is None else environment
    text = given.get("YARP_NAMESPACE", "")
    if not text:
        text = _read(config_home(given) / (given.get("YARP_CONFIG_NAMESPACE_FILENAME") or _NAMESPACE_FILE))
    words = Bottle.parse(text)
    group = words.find_group("name")
    found = [as_string(word) for word in (words if group is None else group.tail())]
    return [*filter(None, found)] or [NAMESPACE]


def contact_file(namespace: str = "", environment: Mapping[str, str] | None = None) -> Path:
    """Return the path of a namespace's contact file; without a namespace that of the first one."""
    namespace = namespace or namespaces(environment)[0]
    name = "yarp" if namespace == NAMESPACE else _OTHER.sub("_", namespace)
    return config_home(environment) / f"{name}.conf"


def read_place(namespace: str = "", environment: Mapping[str, str] | None = None) -> Place | None:
    """Read the contact of the name server; None if no file has it. Raises AddressError for an invalid file."""
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
    """Read the other form of the file: a section named after the namespace, or ``name``, with keys."""
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
    """Write the contact file of a namespace (the contact's name). Return its path. Raises MiddlewareError."""
    path = contact_file(contact.name, environment)
    beside = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(f"{contact.host} {contact.port} {mode}\n", encoding="utf-8")
        beside.replace(path)  # so that no reader sees half of it
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise MiddlewareError(f"{path} cannot be written: {error.strerror or error}") from None
    return path


def remove_place(namespace: str = "", environment: Mapping[str, str] | None = None) -> Path:
    """Remove the contact file, if there is one. Return its path."""
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
    """Return the default port number of the name server: ``YARP_PORT_RANGE``, else 10000."""
    given = os.environ if environment is None else environment
    return _number(given, "YARP_PORT_RANGE") or _STANDARD_PORT


def opening(environment: Mapping[str, str], name: str) -> Opening:
    """Return the actual name and number of a port that the program opens.

    ``YARP_RENAME_x`` replaces the name and ``YARP_PORTNUMBER_x`` sets the number, where ``x`` is the name with ``_``
    for every character but letters and digits; ``YARP_PORT_PREFIX`` is put before every name but the empty one.
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
    """Return the configured name service; without a contact file a server at the default port of this machine.

    No request is sent. Raises MiddlewareError for an invalid configuration.
    """
    given = os.environ if environment is None else environment
    found = [_names_of(namespace, given) for namespace in namespaces(given)]
    if len(found) == 1:
        return found[0]
    from rtf.middleware.naming.multi_server import MultiServerNames

    return MultiServerNames(found)


def _names_of(namespace: str, environment: Mapping[str, str]) -> Names:
    place = read_place(namespace, environment)
    if place is None:
        place = Place(Contact(namespace, "127.0.0.1", base_port(environment), "tcp"))
    if place.mode == "local":
        from rtf.middleware.naming.local import LocalNames

        return LocalNames()
    if place.mode != "yarp":
        raise ConnectError(
            f"{contact_file(namespace, environment)} names the mode {place.mode!r} of a name server;"
            " the modes are yarp and local"
        )
    from rtf.middleware.naming.client import RemoteNames
    from rtf.middleware.naming.network_interfaces import chosen_address

    return RemoteNames(place.contact, address=chosen_address(environment), key=find_key(environment))


def find_key(environment: Mapping[str, str] | None = None) -> bytes:
    """Return the key of this process's network; empty if authentication is off. Raises ResourceError."""
    from rtf.resources import ResourceFinder, read_property_file

    path = ResourceFinder(environment=environment).search(_KEY_FILE).path
    if path is None:
        return b""
    section = read_property_file(path, environment=environment).properties.find_group(_KEY_SECTION)
    key = None if section is None else section.find("key")
    return b"" if key is None else to_string(key).encode("utf-8", "surrogateescape")


def find_dialect(environment: Mapping[str, str] | None = None) -> Dialect | None:
    """Return the dialect that ``RTF_DIALECT`` sets, 3 or 4; None if it does not. Raises AddressError."""
    text = (os.environ if environment is None else environment).get("RTF_DIALECT", "")
    try:
        return Dialect(int(text)) if text else None
    except ValueError:
        raise AddressError(f"RTF_DIALECT is {text!r}; set it to 3 or 4, the major version of YARP") from None


def find_network(environment: Mapping[str, str] | None = None) -> Network:
    """Return the configured network, for ports that are given none."""
    given = os.environ if environment is None else environment
    return Network(find_names(given), dialect=find_dialect(given), opening=partial(opening, given), key=find_key(given))
