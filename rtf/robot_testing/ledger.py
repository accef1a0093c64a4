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
        """Whether somebody has let it move in this run, since it was last begun or resumed."""
        decisions = [entry["may_move"] for entry in self._recent() if entry.get("robot") == robot]
        return bool(decisions and decisions[-1])

    def resumed(self) -> None:
        """Note that the run goes on, perhaps days later: what was allowed then, and how robots were, is of the past."""
        if any(True for _ in self._entries()):
            self._append({"resumed": True})

    def blocked(self, place: str) -> None:
        """Note that something was in the way when a part was brought back."""
        self._append({"place": place, "blocked": True})

    def is_blocked(self, place: str) -> bool:
        """Whether something was in a part's way, and nobody has let its robot move since."""
        robot, found = place.strip("/").partition("/")[0], False
        for entry in self._entries():
            if entry.get("place") == place and "blocked" in entry:
                found = True
            elif entry.get("robot") == robot and entry.get("may_move"):
                found = False
        return found

    def gave_up(self, place: str, joint: int) -> None:
        """Note that a joint does not obey, and was left without power."""
        self._append({"place": place, "given_up": joint})

    def given_up(self, place: str) -> set[int]:
        """The joints of a part that whoever puts it back may not power again: only a test may, with permission."""
        return {entry["given_up"] for entry in self._entries() if entry.get("place") == place and "given_up" in entry}

    def left_idle(self, robot: str) -> list[str]:
        """The joints of all parts of a robot that were given up, as people read it: ``/icub/head joint 2``."""
        begin = f"/{robot}/"
        return sorted({
            f"{entry['place']} joint {entry['given_up']}"
            for entry in self._entries()
            if "given_up" in entry and str(entry.get("place")).startswith(begin)
        })  # fmt: skip

    def keep(self, place: str, snapshot: Snapshot) -> None:
        """Keep how a part was before any test."""
        self._append({"place": place, "snapshot": snapshot.to_record()})

    def put_back(self, place: str) -> None:
        """Note that a part is as nobody need change it: what was kept of it is done with."""
        self._append({"place": place, "snapshot": None})

    def kept(self, place: str) -> Snapshot | None:
        """How a part was before any test that was not cleaned up after; None where nobody has kept that."""
        found: dict[str, Any] | None = None
        for entry in self._recent():
            if entry.get("place") == place and "snapshot" in entry:
                found = (found or entry["snapshot"]) if entry["snapshot"] else None
        return None if found is None else Snapshot.from_record(found)

    def _append(self, entry: dict[str, Any]) -> None:
        if self._file is None:
            return
        line = f"\n{json.dumps(entry)}\n"  # on a line of its own, also behind one that was torn
        with self._file.open("ab", buffering=0) as file:
            file.write(line.encode())  # in one piece, as others may append, too

    def _recent(self) -> Iterator[dict[str, Any]]:
        entries = list(self._entries())
        last = max((number for number, entry in enumerate(entries) if "resumed" in entry), default=-1)
        yield from entries[last + 1 :]

    def _entries(self) -> Iterator[dict[str, Any]]:
        if self._file is None or not self._file.exists():
            return
        for line in self._file.read_text().splitlines():
            try:
                yield json.loads(line)
            except ValueError:  # nothing, or whoever wrote it was killed in the middle of it
                continue
