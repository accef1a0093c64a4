"""The connection of a fixture to its runner: what its manager says, in the process that hosts it."""

from __future__ import annotations

import json
import threading
from typing import TYPE_CHECKING, Any

import msgspec

from rtf.testing import recording
from rtf.testing.events import FixtureIncident, Message, OutputCaptured
from rtf.testing.isolation.messages import Lost, Provided
from rtf.testing.session import Session, Stoppable, bounded
from rtf.testing.verdict import Phase, Severity

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from rtf.testing.isolation.messages import FailedTest, Job


class FixtureSession(Stoppable[msgspec.Struct]):
    """Sends the messages of one generation of a fixture. Any thread may send."""

    def __init__(self, job: Job, send: Callable[[msgspec.Struct], None]) -> None:
        super().__init__(send)
        self.phase: Phase = Phase.LOAD
        self.generation = job.attempt
        self.name = job.id
        self._job = job
        self._cause = ""  # why it collapsed, once it has
        self._cause_lock = threading.Lock()
        self._failed: FailedTest | None = None  # the test that is being explained
        self._provided: set[str] = set()  # the keys of the values that were handed on

    def message(self, severity: Severity, title: str, detail: object, place: tuple[str, int] = ("", 0)) -> None:
        """Send a message of the fixture into the journal."""
        self.emit(
            Message(
                severity=severity,
                title=title,
                detail=bounded(str(detail)),
                fixture=self.name,
                phase=self.phase,
                file=place[0],
                line=place[1],
            )
        )

    def output(self, text: object, stream: str) -> None:
        """Send what a program of the fixture wrote: one line, or several."""
        self.emit(OutputCaptured(stream=stream, text=bounded(str(text)) + "\n", fixture=self.name))

    def collapse(self, cause: object, *, hopeless: bool = False, **details: Any) -> None:
        """Report that the fixture is not usable any more, and why; only the first cause is sent. From any thread."""
        text = str(cause) or "no reason was given"
        with self._cause_lock:
            if self._cause:
                return
            self._cause = text
        self.emit(Lost(self._incident(text, **details), hopeless))

    def _incident(self, cause: str, output: str = "", **details: Any) -> FixtureIncident:
        return FixtureIncident(
            fixture=self.name,
            suite="",
            generation=self.generation,
            phase=self.phase,
            cause=bounded(cause),
            output=bounded(output),
            **details,
        )

    def provide_value(self, key: str, value: object) -> None:
        """Send a value to the tests and fixtures on this one, and write it into the journal."""
        self._provided.add(key)
        self.emit(Provided(values={key: value}))
        self.message(Severity.INFO, "provides", f"{key} = {json.dumps(value)}")

    def attach(self, source: str | Path | bytes, name: str, media_type: str) -> Path:
        """Keep a file of the test that failed. Raises RuntimeError when there is none."""
        failed = self._failed
        if failed is None:
            raise RuntimeError("a fixture attaches files to a test that failed, in on_test_failure()")
        session = Session(failed.test, self.emit, folder=failed.folder, run_folder=self._job.run_folder)
        return recording.attach(session, source, name, media_type)
