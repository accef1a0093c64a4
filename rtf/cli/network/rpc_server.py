"""``rtf rpcserver``: open a port, print the questions that come to it, and send the answers that are typed."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from functools import partial
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.cli.network.options import make_network, make_parser, own_name
from rtf.cli.network.terminal import Bell, opened, progress, say, typed
from rtf.middleware.errors import PortClosedError
from rtf.middleware.rpc import RpcServer
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence


def rpcserver(words: Sequence[str]) -> ExitCode:
    """Answer questions until there are no more answers, or a signal comes."""
    parser = make_parser(
        "rpcserver",
        "Open a port and answer the questions that come to it, one after the other, with the lines of the standard"
        " input. Without a line left it ends.",
        "rtf rpcserver /oracle < answers.txt",
    )
    parser.add_argument("port", type=own_name, metavar="/PORT", help="the port to open; ... for any name")
    options = parser.parse_args(words)
    desk = _Desk()
    make = partial(RpcServer, options.port, desk.bring, network=make_network())
    with contextlib.suppress(KeyboardInterrupt), opened(make) as port:
        progress(f"Port {port.name} active at {port.contact}")
        try:
            desk.serve()
        finally:
            desk.close()
    return ExitCode.PASSED


class _Question:
    """One question, and the place for its answer."""

    def __init__(self, words: Bottle) -> None:
        self.words = words
        self.answer: Bottle | None = None
        self.settled = threading.Event()

    def settle(self, answer: Bottle | None) -> None:
        """Answer it; None: nobody will."""
        self.answer = answer
        self.settled.set()


class _Desk:
    """Where the threads of those who ask wait for the one who answers."""

    def __init__(self) -> None:
        self._questions: deque[_Question] = deque()
        self._bell = Bell()
        self._lock = threading.Lock()
        self._open: set[_Question] | None = set()

    def bring(self, words: Bottle) -> Bottle:
        """Wait for the answer to a question. Raises PortClosedError when there will be none."""
        question = _Question(words)
        with self._lock:
            if self._open is None:
                raise PortClosedError("nobody answers here any more")
            self._open.add(question)
        self._questions.append(question)
        self._bell.ring()
        question.settled.wait()
        if question.answer is None:
            raise PortClosedError("nobody answers here any more")
        return question.answer

    def serve(self) -> None:
        """Show questions and have answers typed."""
        answers = typed("Reply: ")
        while True:
            progress("Waiting for a message...")
            self._bell.wait()
            question = self._questions.popleft()
            say(f"Message: {question.words.to_text()}")
            answer = next(answers, None)
            if answer is None:
                return
            with self._lock:
                if self._open is not None:
                    self._open.discard(question)
            question.settle(Bottle.parse(answer))

    def close(self) -> None:
        """Nobody waits here any more."""
        with self._lock:
            waiting, self._open = self._open or set(), None
        for question in waiting:
            question.settle(None)
