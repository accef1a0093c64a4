"""The record of motion: what the tests of a run did to robots and must be undone, even if a test is killed.

It is a file in the run folder with one entry a line. Tests and the fixture ``robot`` append to it.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf.robot_testing.guard.snapshot import Snapshot

if TYPE_CHECKING:
    from collections.abc import Iterator

FILE_NAME = "robots.jsonl"
_RUN_FOLDER = "RTF_RUN_FOLDER"


class MotionRecord:
    """The record of motion of a run; ``folder`` is the run folder, by default that of the environment variable.

    Without a run folder nothing is recorded. A ``place`` is the prefix of a part's ports, such as ``/icub/head``.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        folder = folder or os.environ.get(_RUN_FOLDER)
        self._file = Path(folder, FILE_NAME) if folder else None

    def record_permission(self, robot: str, *, may_move: bool) -> None:
        """Record whether the operator permits the robot to move; the last record counts."""
        self._append({"robot": robot, "may_move": may_move})

    def may_move(self, robot: str) -> bool:
        """Return whether the robot may move, by the last decision since the run was begun or resumed."""
        decisions = [entry["may_move"] for entry in self._recent() if entry.get("robot") == robot]
        return bool(decisions and decisions[-1])

    def record_resume(self) -> None:
        """Record that the run is resumed: permissions and snapshots of before are no longer valid."""
        if any(True for _ in self._entries()):
            self._append({"resumed": True})

    def record_obstacle(self, place: str) -> None:
        """Record that a part met an obstacle when it was moved back."""
        self._append({"place": place, "blocked": True})

    def is_blocked(self, place: str) -> bool:
        """Return whether a part met an obstacle, and no permission to move was given since."""
        robot, found = place.strip("/").partition("/")[0], False
        for entry in self._entries():
            if entry.get("place") == place and "blocked" in entry:
                found = True
            elif entry.get("robot") == robot and entry.get("may_move"):
                found = False
        return found

    def record_excluded(self, place: str, joint: int) -> None:
        """Record that a joint does not obey, and was left without power."""
        self._append({"place": place, "excluded": joint})

    def excluded(self, place: str) -> set[int]:
        """Return the excluded joints of a part. Only a test with permission may power them again."""
        return {entry["excluded"] for entry in self._entries() if entry.get("place") == place and "excluded" in entry}

    def excluded_joints(self, robot: str) -> list[str]:
        """Return the excluded joints of all parts of a robot as text, such as ``/icub/head joint 2``."""
        begin = f"/{robot}/"
        return sorted({
            f"{entry['place']} joint {entry['excluded']}"
            for entry in self._entries()
            if "excluded" in entry and str(entry.get("place")).startswith(begin)
        })  # fmt: skip

    def save_snapshot(self, place: str, snapshot: Snapshot) -> None:
        """Save the state of a part before the first test that moves it."""
        self._append({"place": place, "snapshot": snapshot.to_record()})

    def record_unrestored(self, place: str, reason: str) -> None:
        """Record that a part answers, but could not be restored; "" for a part that was restored later."""
        self._append({"place": place, "unrestored": reason})

    def unrestored(self, place: str) -> str:
        """Return why a part could not be restored since the run was begun or resumed; "" if there is no reason."""
        reasons = [
            entry["unrestored"] for entry in self._recent() if entry.get("place") == place and "unrestored" in entry
        ]
        return reasons[-1] if reasons else ""

    def discard_snapshot(self, place: str) -> None:
        """Record that a part was restored: its snapshot is no longer needed."""
        self._append({"place": place, "snapshot": None})

    def snapshot(self, place: str) -> Snapshot | None:
        """Return the state of a part before the first test that was not restored; None if there is no snapshot."""
        found: dict[str, Any] | None = None
        for entry in self._recent():
            if entry.get("place") == place and "snapshot" in entry:
                found = (found or entry["snapshot"]) if entry["snapshot"] else None
        return None if found is None else Snapshot.from_record(found)

    def _append(self, entry: dict[str, Any]) -> None:
        if self._file is None:
            return
        line = f"\n{json.dumps(entry)}\n"  # a new line first, as the last one may be incomplete
        with self._file.open("ab", buffering=0) as file:
            file.write(line.encode())  # in one write, as other processes append, too

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
            except ValueError:  # empty or incomplete: its writer was killed
                continue
