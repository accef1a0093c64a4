"""A solver that is a program of its own: the iCub's ``iKinCartesianSolver``, or ``rtf cartesian solver``.

It is looked for every second while it is not connected, also after it has ended. Its settings are those of the
controller, and are sent again to one that was restarted. Nothing waits longer for it than its patience.
"""

from __future__ import annotations

import math
import threading
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.errors import RtfError
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort, Received
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.wire.contact import Contact
from rtf.robot.cartesian.requests import TABLE
from rtf.robot.cartesian.solver_messages import AnswerMessage, read_answer, write_target
from rtf.robot.cartesian.solvers import PoseSolver, Problem
from rtf.robot.errors import NoAnswerError, RefusedError
from rtf.robot.interfaces.cartesian import CartesianSolution
from rtf.robot.network.request_table import ACK, floats

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.robot.cartesian.settings import Settings
    from rtf.robot.kinematics import PointPreference

#: Seconds of real time between two looks for a solver, and the time for one of its answers.
_LOOK, PATIENCE = 1.0, 2.0
_CARRIER = "tcp"
_SET, _SHOT = Vocab("set"), Vocab("shot")


class RemoteSolver(PoseSolver):
    """The solver whose ports begin with ``solver``; own ports begin with ``name``. Raises DeviceError."""

    def __init__(
        self,
        solver: str,
        name: str,
        *,
        network: Network,
        drawn: PointPreference | None = None,
        patience: float = PATIENCE,
    ) -> None:
        self.solver = solver
        self._network = network
        self._drawn = drawn
        self._patience = patience
        self._asking = threading.Lock()  # one question at a time, and one connection
        self._state = threading.Condition()  # of what follows
        self._answer: AnswerMessage | None = None
        self._token = 0.0
        self._taken_by = clock.Deadline.after(0.0)  # until then the last target must have been taken
        self._problem: Problem | None = None
        self._settings: Settings | None = None  # those that the solver has
        self._connected = False
        self._end = threading.Event()
        with ExitStack() as opened:
            self._out: BufferedPort[Bottle] = opened.enter_context(
                BufferedPort(f"{name}/out", network=network, inputs=False)
            )
            self._in = opened.enter_context(
                BufferedPort(f"{name}/in", callback=self._take, strict=True, network=network, outputs=False)
            )
            self._rpc = opened.enter_context(closing(RpcClient(f"{name}/rpc", network=network)))
            self._opened = opened.pop_all()
        self._thread = threading.Thread(target=self._supervise, name=f"rtf-solver {solver}", daemon=True)
        self._thread.start()

    def connected(self) -> bool:
        return self._connected and bool(self._out.outputs)

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self._opened.close()

    # Questions -------------------------------------------------------------------------------------------------------

    def solve(self, problem: Problem) -> CartesianSolution:
        with self._asking:
            until = clock.Deadline.after(self._patience)
            token = self._send(problem)
            with self._state:
                if not self._state.wait_for(lambda: self._answered(token), until.remaining()):
                    self._connected = False
                    raise RefusedError(f"{self.solver} has not answered in {self._patience:g} s")
                answer = self._answer
        assert answer is not None
        return _solution(problem, answer)

    def ask(self, problem: Problem) -> CartesianSolution:
        active = [place for place, chosen in enumerate(problem.settings.active) if chosen]
        with self._asking:
            self._check()
            self._configure(problem.settings)
            request = TABLE.request("ask", problem.target, problem.start[active])
            found: CartesianSolution = TABLE.result("ask", self._ask(request)[1:])
        return found

    def request(self, problem: Problem) -> None:
        if self._asking.acquire(blocking=False):
            try:
                if self._out.wait(0.0):  # else the next period tries again
                    self._send(problem)
                elif self._taken_by.expired:
                    raise self._lost()
            finally:
                self._asking.release()

    def answer(self) -> CartesianSolution | None:
        with self._state:
            problem, answer = self._problem, self._answer
            if problem is None or answer is None or not self._answered(self._token):
                return None
            self._problem = None
        return _solution(problem, answer)

    def _send(self, problem: Problem) -> float:
        self._check()
        if not self._out.wait(self._patience):
            raise self._lost()
        self._configure(problem.settings)
        with self._state:
            self._token += 1.0
            self._problem = problem
            token = self._token
        self._out.write(write_target(problem.target, token))  # nothing is on its way
        self._taken_by = clock.Deadline.after(self._patience)
        return token

    def _lost(self) -> RefusedError:
        self._connected = False
        return RefusedError(f"{self.solver} has taken no target for {self._patience:g} s")

    def _check(self) -> None:
        if not self.connected():
            raise RefusedError(f"the solver {self.solver} is not there; start it")

    def _answered(self, token: float) -> bool:
        return self._answer is not None and self._answer.token is not None and self._answer.token >= token

    def _take(self, message: Received[Bottle]) -> None:
        """Take an answer. Runs in the thread of the port."""
        try:
            answer = read_answer(message.value)
        except RefusedError as error:
            self._network.report(f"{self.solver}/out sent {message.value.to_text()[:80]!r}: {error}")
            return
        with self._state:
            self._answer = answer
            self._state.notify_all()

    # Connection ------------------------------------------------------------------------------------------------------

    def _supervise(self) -> None:
        """Look for the solver while it is not connected. Runs in a thread of its own."""
        said = ""
        while not self._end.is_set():
            if not self.connected():
                try:
                    with self._asking:
                        self._connect()
                    said = ""
                    self._network.report(f"the solver {self.solver} is connected")
                except RtfError as error:
                    if str(error) != said:
                        said = str(error)
                        self._network.report(f"the solver {self.solver} is not connected: {said}")
            self._end.wait(_LOOK)

    def _connect(self) -> None:
        """Connect all ports, and send the settings. Raises RtfError."""
        self._connected, self._settings = False, None
        for port in (self._out, self._rpc):
            for output in list(port.outputs):
                port.remove_output(output.peer)
        if self._network.names.query(f"{self.solver}/in") is None:
            raise NoAnswerError(f"there is no port {self.solver}/in")
        self._rpc.add_output(f"{self.solver}/rpc")
        self._set("mode", _SHOT)
        if self._drawn is not None:
            place, weights = floats(self._drawn.position), floats(self._drawn.weights)
            self._set("tsk2", Bottle([self._drawn.link + 1, place, weights]))
        remote.connect(self._network, Contact(f"{self.solver}/out"), Contact(self._in.name), _CARRIER)
        self._out.add_output(f"{self.solver}/in", _CARRIER)
        self._connected = True

    def _configure(self, settings: Settings) -> None:
        """Send the settings that the solver does not have yet. Raises NoAnswerError, and RefusedError."""
        try:
            for words in _changes(self._settings, settings):
                self._set(*words)
        except (MiddlewareError, NoAnswerError) as error:
            self._connected = False
            raise NoAnswerError(f"the solver {self.solver} does not answer: {error}") from error
        self._settings = settings

    def _set(self, *words: Value | str) -> None:
        self._ask(Bottle([_SET, *(Vocab(word) if isinstance(word, str) else word for word in words)]))

    def _ask(self, request: Bottle) -> Bottle:
        """Return the reply to a request. Raises MiddlewareError without one, and RefusedError."""
        reply = self._rpc.call(request, timeout=self._patience)
        if not reply or reply[0] != ACK:
            text = "nothing" if reply is None else reply.to_text()[:80]
            raise RefusedError(f"{self.solver}/rpc answered {request.to_text()[:80]} with {text}")
        return reply


def _changes(before: Settings | None, after: Settings) -> Iterator[tuple[Value | str, ...]]:
    """Yield the requests that change the settings of a solver; ``before`` are those that it has, if they are known."""
    if before is None or before.active != after.active:
        yield "dof", Bottle([int(one) for one in after.active])
    for joint, limits in enumerate(after.limits):
        if before is None or before.limits[joint] != limits:
            yield "lim", joint, *limits
    if before is None or before.rest != after.rest:
        yield "resp", floats(after.rest)
    if before is None or before.weights != after.weights:
        yield "resw", floats(after.weights)
    if before is None or before.tip != after.tip:
        yield "tip", floats(after.tip)
    if before is None or before.priority != after.priority:
        yield "prio", Vocab("xyz" if after.priority == "position" else "ang")


def _solution(problem: Problem, answer: AnswerMessage) -> CartesianSolution:
    """Return the posture of all joints: those that are not active are where they were."""
    active = [place for place, chosen in enumerate(problem.settings.active) if chosen]
    if answer.joints.size != len(active):
        raise RefusedError(f"the solver answered with {answer.joints.size} joints; {len(active)} are active")
    joints = problem.start.copy()
    joints[active] = answer.joints
    if not all(map(math.isfinite, joints)):
        raise RefusedError("the solver answered with joints that are no numbers")
    return CartesianSolution(answer.pose, joints)
