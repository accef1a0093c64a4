"""What a runner tells a worker to do: plain data that crosses a process boundary as one framed message."""

from __future__ import annotations

import marshal
import struct
from typing import NamedTuple

from rtf.testing.plugins import PluginRef

#: A job on the wire: this byte, which begins no JSON line, then the length of what follows.
JOB_MARK = b"J"
HEADER = struct.Struct("=cI")


class Job(NamedTuple):
    """One attempt at a test, the hosting of one fixture, or the making of a template.

    ``param`` is the suite's parameter string, ``parameters`` its ``<parameter>`` elements, ``overrides`` the ``--set``
    values; they count in this order. ``attempt`` counts the attempts at a test, or the generations of a fixture,
    from 1. ``suite_place`` is the suite's file and line, for provenance; ``suite_folder`` its folder. ``memory`` is the
    private memory in bytes a process may use, 0 for no limit. ``last`` says that no other job follows.
    ``variables`` are set in the environment of the process; ``values`` are those of its fixtures, as a JSON text.

    Jobs and plug-in references are tuples, so that a child makes them without running a line of Python.
    """

    plugin: PluginRef  # stays the first: see from_data
    kind: str  # "test", "fixture" or "template"
    id: str
    name: str
    folder: str
    run_folder: str
    param: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    overrides: tuple[tuple[str, str], ...] = ()
    suite_place: str = ""
    suite_folder: str = ""
    environment: str = ""
    repetition: int = 0
    attempt: int = 1
    memory: int = 0
    can_ask: bool = False
    check_period: float = 0.5
    last: bool = True
    variables: tuple[tuple[str, str], ...] = ()
    values: str = ""

    def to_message(self) -> bytes:
        """Write the job as it crosses the wire. Both ends are the same interpreter, so ``marshal`` will do."""
        data = marshal.dumps((tuple(self.plugin), *self[1:]))
        return HEADER.pack(JOB_MARK, len(data)) + data

    @classmethod
    def from_data(cls, data: bytes) -> Job:
        """Read a job from what follows the header."""
        plugin, *members = marshal.loads(data)  # noqa: S302 - written by the runner that started this process
        return tuple.__new__(cls, (tuple.__new__(PluginRef, plugin), *members))
