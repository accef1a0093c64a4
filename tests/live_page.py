"""A run with its live page, and clients of it: requests, streams of events, and raw bytes."""

from __future__ import annotations

import http.client
import json
import os
import re
import socket
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from harness import Command

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_ADDRESS = re.compile(r"web page: http://(?P<host>[^/]+):(?P<port>\d+)/(?:#token=(?P<token>\S+))?")
_PATIENCE = 20.0

#: A test that goes on when it is told to, on the page or at the console.
WAITING = """
from rtf.testing import TestCase

class Waiting(TestCase):
    def run(self):
        self.measure("voltage", 23.9, "V", low=23.5, high=24.5)
        self.check(self.confirm("go on?", timeout=60), "went on")
"""


@dataclass
class Answer:
    """What the server said: status, headers by lower-case name, body."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        """The body as JSON."""
        return json.loads(self.body)


class Message:
    """One server-sent event."""

    def __init__(self, fields: dict[str, str]) -> None:
        self.event = fields.get("event", "message")
        self.id = int(fields["id"]) if "id" in fields else None
        self.data = json.loads(fields["data"])


class Stream:
    """A client that follows the run, from the beginning or after a number of lines."""

    def __init__(self, page: Page, after: int | None = None) -> None:
        self._connection = page.connect()
        headers = {} if after is None else {"Last-Event-ID": str(after)}
        self._connection.request("GET", "/events", headers=headers)
        self.response = self._connection.getresponse()
        assert self.response.status == 200, self.response.read()
        self.records = self._read()

    def __iter__(self) -> Iterator[Message]:
        """The messages, until the server closes the stream."""
        fields: dict[str, str] = {}
        while line := self.response.readline():
            text = line.decode().rstrip("\n")
            if text:
                name, _, value = text.partition(":")
                fields[name] = value.removeprefix(" ")
            else:
                if "data" in fields:
                    yield Message(fields)
                fields = {}

    def _read(self) -> Iterator[dict[str, Any]]:
        """The records one by one, and at the end one without members."""
        for message in self:
            if message.event == "end":
                yield {}
            elif message.event == "message":
                assert message.id == message.data[-1]["seq"]
                yield from message.data
        raise AssertionError("the stream was closed")

    def until_end(self) -> list[dict[str, Any]]:
        """All further records up to the event ``end``."""
        return [*iter(lambda: next(self.records), {})]

    def until(self, **members: object) -> dict[str, Any]:
        """The next record that has these members."""
        for record in self.records:
            assert record, f"the run ended before there was {members}"
            if all(record.get(name) == value for name, value in members.items()):
                return record
        raise AssertionError

    def close(self) -> None:
        """Close the connection."""
        self.response.close()
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass
class Page:
    """A page that is served."""

    host: str
    port: int
    token: str = ""

    @classmethod
    def said(cls, line: str) -> Page:
        """The page whose address was printed."""
        found = _ADDRESS.search(line)
        assert found is not None, line
        return cls(found["host"], int(found["port"]), found["token"] or "")

    def connect(self) -> http.client.HTTPConnection:
        """Open a connection."""
        return http.client.HTTPConnection(self.host, self.port, timeout=_PATIENCE)

    def ask(self, method: str, path: str, body: bytes | None = None, **headers: str) -> Answer:
        """Send one request on a connection of its own; ``_`` in the name of a header stands for ``-``."""
        connection = self.connect()
        connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
        response = connection.getresponse()
        answer = Answer(
            response.status, {name.lower(): value for name, value in response.getheaders()}, response.read()
        )
        connection.close()
        return answer

    def get(self, path: str, **headers: str) -> Answer:
        """Send a GET request."""
        return self.ask("GET", path, **headers)

    def control(self, what: str, **command: object) -> Answer:
        """A request, as the page sends it."""
        headers = {"Content-Type": "application/json", "Authorization": f"Bearer {self.token}"}
        return self.ask("POST", f"/control/{what}", json.dumps(command).encode(), **headers)

    def follow(self, after: int | None = None) -> Stream:
        """Open the stream of the run."""
        return Stream(self, after)

    def say(self, data: bytes, *, patience: float = 5.0, close: bool = False) -> bytes:
        """Send bytes; return the answer until the server closes, or until a time-out."""
        with socket.create_connection((self.host, self.port), timeout=patience) as client:
            said = b""
            try:
                client.sendall(data)
                if close:
                    client.shutdown(socket.SHUT_WR)
                while chunk := client.recv(1 << 16):
                    said += chunk
            except OSError:  # the other end has gone, or says nothing more
                pass
            return said


class LiveRun(Command):
    """A run with its page, with arguments as those of the command; the port is any free one."""

    def __init__(self, folder: Path, *arguments: str, **environment: str) -> None:
        super().__init__(folder, *arguments, "-w", "--web-port", "0", **environment)
        self.page = Page.said(self.line())

    def line(self) -> str:
        """The next line on standard error, and no byte more."""
        assert self.process.stderr is not None
        line = b""
        while not line.endswith(b"\n"):
            byte = os.read(self.process.stderr.fileno(), 1)
            assert byte, f"it ended after {line!r}"
            line += byte
        return line.decode()

    @property
    def run_folder(self) -> Path:
        """The folder of the run."""
        return (self.folder / "rtf-runs" / "latest").resolve()
