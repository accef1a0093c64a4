"""The figures of a machine: what a node answers to ``sysinfo``.

On the wire they are a record of its own: numbers, and texts that end with a line end. The original also sends its
whole environment, passwords included, and its user's name and home; ours sends the machine's figures alone.
"""

from __future__ import annotations

import os
import platform
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rtf.bottle import Bottle, BottleLimitError
from rtf.bottle.binary import TruncatedBottleError
from rtf.middleware.types.codecs import TextCodec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.bottle import Dialect
    from rtf.middleware.types.codecs import Buffer

_MIB = 1 << 20
#: The longest text, bytes: an environment of a real node.
_MOST = 1 << 18
_NOBODY = -1


@dataclass(frozen=True, slots=True)
class SystemInfo:
    """The figures of a machine. Sizes are in MiB, the frequency in MHz; loads are Linux's load averages.

    ``memory_free`` of our node is what programs could still get. ``cpu_load`` is the number of running threads.
    """

    memory_total: int = 0
    memory_free: int = 0
    storage_total: int = 0
    storage_free: int = 0
    architecture: str = ""
    model: str = ""
    vendor: str = ""
    family: int = 0
    model_number: int = 0
    cores: int = 0
    siblings: int = 0
    frequency: float = 0.0
    load_1: float = 0.0
    load_5: float = 0.0
    load_15: float = 0.0
    cpu_load: int = 0
    name: str = ""
    distribution: str = ""
    release: str = ""
    codename: str = ""
    kernel: str = ""
    environment: str = ""
    user: str = ""
    real_name: str = ""
    home: str = ""
    user_id: int = _NOBODY

    codec: ClassVar[SystemInfoCodec]


class SystemInfoCodec(TextCodec[SystemInfo]):
    """Codec of the figures. Little-endian numbers and texts with line ends, in the order of the fields."""

    def encode(self, value: SystemInfo, dialect: Dialect) -> Sequence[Buffer]:  # noqa: ARG002 - one form for both
        """One block."""
        return (b"".join(_pack(getattr(value, name)) for name in SystemInfo.__slots__),)

    def decode_from(self, data: Buffer, dialect: Dialect) -> tuple[SystemInfo, int]:  # noqa: ARG002
        """Decode the fields one after the other."""
        view, place = bytes(data), 0
        fields: list[object] = []
        for default in _DEFAULTS:
            value, place = _unpack(view, place, default)
            fields.append(value)
        return SystemInfo(*fields), place  # type: ignore[arg-type]  # each has the type of its default

    def to_text(self, value: SystemInfo) -> str:
        """The fields as lists of name and value."""
        return Bottle([[name, getattr(value, name)] for name in SystemInfo.__slots__]).to_text()

    def from_text(self, text: str) -> SystemInfo:
        """Read what :meth:`to_text` writes."""
        found = Bottle.parse(text)
        given = {name: found.find(name) for name in SystemInfo.__slots__}
        return SystemInfo(**{name: value for name, value in given.items() if value is not None})  # type: ignore[arg-type]


SystemInfo.codec = SystemInfoCodec()
_DEFAULTS = tuple(getattr(SystemInfo(), name) for name in SystemInfo.__slots__)


def _pack(value: object) -> bytes:
    if isinstance(value, float):
        return struct.pack("<d", value)
    if isinstance(value, int):
        return struct.pack("<i", max(-(1 << 31), min(value, (1 << 31) - 1)))
    return str(value).replace("\r\n", " ").encode("utf-8", "surrogateescape") + b"\r\n"


def _unpack(data: bytes, place: int, like: object) -> tuple[object, int]:
    if isinstance(like, str):
        end = data.find(b"\r\n", place, place + _MOST)
        if end < 0:
            if len(data) - place > _MOST:
                raise BottleLimitError(f"a text of more than {_MOST} bytes")
            raise TruncatedBottleError(len(data) + 1)
        return data[place:end].decode("utf-8", "surrogateescape"), end + 2
    form = "<d" if isinstance(like, float) else "<i"
    size = struct.calcsize(form)
    if len(data) < place + size:
        raise TruncatedBottleError(place + size)
    return struct.unpack_from(form, data, place)[0], place + size


# Of this machine -------------------------------------------------------------------------------------------------


def measure() -> SystemInfo:
    """Return the figures of this machine now."""
    import psutil  # imported here: clients do not need it

    memory, storage = psutil.virtual_memory(), psutil.disk_usage("/")
    processor = _processor()
    system = _distribution()
    load_1, load_5, load_15 = os.getloadavg()
    return SystemInfo(
        memory_total=memory.total // _MIB,
        memory_free=memory.available // _MIB,
        storage_total=storage.total // _MIB,
        storage_free=storage.free // _MIB,
        architecture=platform.machine(),
        model=processor.get("model name", ""),
        vendor=processor.get("vendor_id", ""),
        family=_number(processor, "cpu family"),
        model_number=_number(processor, "model"),
        cores=psutil.cpu_count(logical=False) or 0,
        siblings=psutil.cpu_count() or 0,
        frequency=float(processor.get("cpu MHz", "0") or 0),
        load_1=load_1,
        load_5=load_5,
        load_15=load_15,
        cpu_load=_running_threads(),
        name=platform.system(),
        distribution=system.get("NAME", "").partition(" ")[0],
        release=system.get("VERSION_ID", ""),
        codename=system.get("VERSION_CODENAME", ""),
        kernel=platform.release(),
    )


def _processor() -> dict[str, str]:
    """What the kernel says of the first processor; some architectures say less than others."""
    with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as stream:  # noqa: PTH123
        pairs = (line.partition(":") for line in stream.read().partition("\n\n")[0].splitlines())
        return {key.strip(): value.strip() for key, _, value in pairs}


def _number(found: dict[str, str], key: str) -> int:
    text = found.get(key, "")
    return int(text) if text.isdecimal() else 0


def _distribution() -> dict[str, str]:
    try:
        return platform.freedesktop_os_release()
    except OSError:  # a system without the file has no name
        return {}


def _running_threads() -> int:
    """The threads that run now, without the one that asks."""
    with open("/proc/loadavg", encoding="ascii") as stream:  # noqa: PTH123
        return max(0, int(stream.read().split()[3].partition("/")[0]) - 1)
