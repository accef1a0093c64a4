"""What a node leaves for its successor of the same name: its token, and the children that it held.

The file is written when the node begins, and when a held child starts or ends. A successor watches held children
again, and ends all others that still carry a token: those of a node that was killed together with its keeper. A lock
on the file, which the kernel releases with the process, keeps two nodes of one name apart.
"""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import socket
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from rtf.applications.run.children import HeldChild
from rtf.applications.run.errors import RunError
from rtf.applications.run.members import MARK, all_processes, end_all, look_at, mark_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.applications.run.children import Child

_OTHER = re.compile(r"[^0-9A-Za-z.-]")


class _File(msgspec.Struct):
    tokens: list[str]
    boot: str
    held: list[HeldChild] = []


class NodeRecord:
    """The record of a node, locked while it runs. Raises RunError if another node of this name runs."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.token = secrets.token_hex(6)
        self._boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if path.parent.stat().st_uid != os.getuid():
                raise RunError(f"{path.parent} belongs to another user; set XDG_STATE_HOME to a folder of your own")
            self._lock = os.open(path.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise RunError(f"{path} cannot be used: {error.strerror}; set XDG_STATE_HOME") from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._lock)
            raise RunError(f"a node of this name runs on this machine already, by {path}") from None
        self._before = self._read() or _File([], self._boot)
        self._store([*self._before.tokens, self.token], self._before.held)

    def _read(self) -> _File | None:
        try:
            found = msgspec.json.decode(self._path.read_bytes(), type=_File)
        except (OSError, msgspec.MsgspecError):  # the first node of this name, or one that was cut short
            return None
        return found if found.boot == self._boot else None

    def held_before(self) -> list[HeldChild]:
        """Return the children that the node before has held, and that still carry its mark."""
        return [child for child in self._before.held if mark_of(child.pid) == child.mark]

    def end_left(self, grace: float) -> list[int]:
        """End the processes that earlier nodes should have ended. Return them."""
        prefixes = tuple(f"{MARK}={token}-" for token in self._before.tokens)
        if not prefixes:
            return []
        return end_all(lambda: (one.pid for one in all_processes() if mark_of(one.pid).startswith(prefixes)), grace)

    def write(self, held: Iterable[Child]) -> None:
        """Write the record, in which earlier nodes have no part any more."""
        rows = []
        for child in held:
            state = look_at(child.pid)
            if state is not None:
                one = child.launch
                mine = (child.pid, state.started, child.mark)
                rows.append(HeldChild(*mine, one.tag, one.command, one.environment, one.log))
        self._store([self.token], rows)

    def _store(self, tokens: list[str], held: list[HeldChild]) -> None:
        beside = self._path.with_suffix(".new")
        beside.touch(mode=0o600)
        beside.write_bytes(msgspec.json.encode(_File(tokens, self._boot, held)))
        beside.replace(self._path)

    def close(self) -> None:
        """Release the lock. The file stays, for the held children in it."""
        os.close(self._lock)


def record_path(folder: Path, node: str, network: str) -> Path:
    """Return the file of a node in a folder, which machines may share.

    ``network`` distinguishes nodes of one name with different name servers.
    """
    parts = (node.strip("/"), socket.gethostname(), network)
    return folder / f"{'@'.join(_OTHER.sub('_', part) for part in parts)}.json"
