"""What the tests of a run have done to robots, kept for those who put these back: it outlives every test.

A file in the folder of the run, a line an entry, to which tests and the fixture ``robot`` append.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.robot_testing.snapshot import Snapshot

if TYPE_CHECKING:
    from collections.abc import Iterator

FILE_NAME = "robots.jsonl"
_RUN_FOLDER = "RTF_RUN_FOLDER"


class MotionLedger:
    """The ledger of a run; ``folder`` is that of the run, without it the one that the runner names.

    Where there is no run nothing is kept. A ``place`` begins the names of a part's ports: ``/icub/head``.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        folder = folder or os.environ.get(_RUN_FOLDER)
        self._file = Path(folder, FILE_NAME) if folder else None

    def decided(self, robot: str, *, may_move: bool) -> None:
        """Note whether the operator lets a robot move; what was said last counts."""
        self._append({"robot": robot, "may_move": may_move})

    def may_move(self, robot: str) -> bool:
        """Whether somebody has let it move in this run."""
        decisions = [entry["may_move"] for entry in self._entries() if entry.get("robot") == robot]
        return bool(decisions and decisions[-1])

    def gave_up(self, place: str, joint: int) -> None:
        """Note that a joint does not obey, and was left without power."""
        self._append({"place": place, "given_up": joint})

    def given_up(self, place: str) -> set[int]:
        """The joints of a part that nobody may power again in this run."""
        return {entry["given_up"] for entry in self._entries() if entry.get("place") == place and "given_up" in entry}

    def keep(self, place: str, snapshot: Snapshot) -> None:
        """Keep how a part was before any test."""
        self._append({"place": place, "snapshot": snapshot.to_record()})

    def kept(self, place: str) -> Snapshot | None:
        """How a part was before any test; None where nobody has kept that."""
        for entry in self._entries():
            if entry.get("place") == place and "snapshot" in entry:
                return Snapshot.from_record(entry["snapshot"])
        return None

    def _append(self, entry: dict[str, Any]) -> None:
        if self._file is None:
            return
        line = f"\n{json.dumps(entry)}\n"  # on a line of its own, also behind one that was torn
        with self._file.open("ab", buffering=0) as file:
            file.write(line.encode())  # in one piece, as others may append, too

    def _entries(self) -> Iterator[dict[str, Any]]:
        if self._file is None or not self._file.exists():
            return
        for line in self._file.read_text().splitlines():
            try:
                yield json.loads(line)
            except ValueError:  # nothing, or whoever wrote it was killed in the middle of it
                continue
