"""The solver of a chain as a part of its own, with the ports of ``iKinCartesianSolver``.

==========  ===========================================================================================================
``S/in``    targets, see :mod:`rtf.robot.cartesian.solver_messages`; only the newest counts
``S/out``   their answers
``S/rpc``   settings, questions, and its state: :data:`SOLVER_TABLE`
==========  ===========================================================================================================

It starts at the present positions of the joints. In the mode ``cont`` the last target is solved again when joints that
do not take part have moved. While the board sends no states it is suspended; it goes on by itself.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np

from rtf.bottle import Bottle, BottleError, Value, Vocab, as_vocab
from rtf.middleware.ports.buffered import BufferedPort, Received
from rtf.middleware.ports.rpc import RpcServer
from rtf.robot.cartesian.requests import TABLE
from rtf.robot.cartesian.settings import ChainSettings
from rtf.robot.cartesian.solver_messages import (
    ACTIVE,
    REST,
    WEIGHTS,
    AnswerMessage,
    TargetMessage,
    read_target,
    write_answer,
)
from rtf.robot.cartesian.solvers import OwnSolver, Problem
from rtf.robot.errors import RefusedError, RobotError
from rtf.robot.interfaces import IControlLimits, IEncoders
from rtf.robot.kinematics import PointPreference, pose_of, vector_of
from rtf.robot.kinematics.poses import POSITION
from rtf.robot.network.elements import inner, number, shown, whole
from rtf.robot.network.request_table import NACK, NOTHING, TEXT, Kind, RequestTable, alone, choice, floats, row, setting
from rtf.robot.network.stream_server import with_error_replies

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.robot.device import Device
    from rtf.robot.interfaces.axes import FloatArray, Values
    from rtf.robot.interfaces.cartesian import CartesianSolution
    from rtf.robot.kinematics import Chain

#: Seconds of real time between two looks at joints that do not take part.
_PERIOD = 0.02
#: A tracked target is solved again when they have moved by this (deg, m).
_MOVED = 1.0
_HELP = "get/set pose, prio, mode, lim, dof, resp, resw, tsk2, tip, verb; ask, susp, run, stat, help, quit"


class CartesianSolver(ChainSettings):
    """The settings and the state of a solver; ``answer`` is called with what is to be sent.

    ``board`` has the joints of the chain, in its order. All methods may be called in any thread.
    """

    def __init__(
        self,
        board: Device,
        chain: Chain,
        *,
        active: Sequence[bool] | None = None,
        together: Collection[str] = (),
        drawn: PointPreference | None = None,
        answer: Callable[[Bottle], object],
        quits: Callable[[], object],
        report: Callable[[str], None],
    ) -> None:
        self._encoders = board.view(IEncoders)  # type: ignore[type-abstract]  # it is only looked for
        limits = board.view(IControlLimits)  # type: ignore[type-abstract]  # it is only looked for
        within = chain.limited({joint: limits.limits(place) for place, joint in enumerate(chain.joints)})
        super().__init__(within, active=active, together=together, lock=threading.RLock())
        self._quits = quits
        self._solver = OwnSolver(drawn)
        self._solving = threading.Lock()  # of the inverse kinematics, which threads do not share
        self._send = answer
        self._report = report
        self._whole_pose = True
        self._verbose = self._suspended = False
        self._problem = ""  # why it is suspended, by itself
        self._newest: TargetMessage | None = None
        self._tracked: tuple[TargetMessage, FloatArray] | None = None  # and the joints that did not take part, deg
        self._awake = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="rtf-cartesian-solver", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        with self._awake:
            self._ended = True
            self._awake.notify_all()
        self._thread.join()

    # Targets ---------------------------------------------------------------------------------------------------------

    def take(self, message: Bottle) -> None:
        """Take a target, with the settings that came with it. Raises RefusedError."""
        target = read_target(message, whole_pose=self._whole_pose)
        setters = {ACTIVE: "set_active_joints", REST: "set_rest_posture", WEIGHTS: "set_rest_weights"}
        for word, value in target.others.items():
            getattr(self, setters[word])(*TABLE.by_key[setters[word]].takes.read([value]))
        if target.tracking is not None:
            self.set_tracking(target.tracking)
        with self._awake:
            self._newest = target
            self._awake.notify_all()

    def _run(self) -> None:
        """Answer targets until the end. Runs in a thread of its own."""
        while True:
            with self._awake:
                self._awake.wait_for(lambda: self._ended or (self._newest is not None and not self._suspended), _PERIOD)
                if self._ended:
                    return
                target = None
                if not self._suspended:
                    target, self._newest = self._newest, None
            try:
                if target is not None or self._moved():
                    self._answer(target or self._tracked_target())
                self._resume()
            except RobotError as error:
                self._pause(str(error))

    def _tracked_target(self) -> TargetMessage:
        assert self._tracked is not None
        return self._tracked[0]

    def _moved(self) -> bool:
        """Return whether a tracked target has to be solved again."""
        if self._suspended or not self.settings.tracking or self._tracked is None:
            return False
        others = self.other_places()
        return bool(others) and float(np.linalg.norm((self._encoders.encoders() - self._tracked[1])[others])) > _MOVED

    def _answer(self, target: TargetMessage) -> None:
        present = self._encoders.encoders()
        found = self._solve(target.target, present, attempts=6)
        self._tracked = target, present
        wanted = target.target
        if wanted.size == POSITION:
            wanted = np.concatenate([wanted, found.pose[POSITION:]])
        answer = AnswerMessage(found.pose, found.joints[self.active_places()], target.token)
        self._send(write_answer(vector_of(pose_of(wanted)), answer))
        if self._verbose:
            left = 1e3 * float(np.linalg.norm(found.pose[:POSITION] - target.target[:POSITION]))
            self._report(f"target {target.target.round(4).tolist()}: {left:.3f} mm are left")

    def _solve(self, target: FloatArray, start: FloatArray, *, attempts: int) -> CartesianSolution:
        with self._solving:
            return self._solver.solve(Problem(self.limited, self.settings, target, start, attempts))

    def _pause(self, why: str) -> None:
        if why != self._problem:
            self._problem = why
            self._report(f"no answer: {why}")

    def _resume(self) -> None:
        if self._problem:
            self._encoders.encoders()
            self._problem = ""
            self._report("it goes on")

    # Requests --------------------------------------------------------------------------------------------------------

    def ask(self, target: Values, start: Values | None = None) -> CartesianSolution:
        """Return the posture for a target; ``start`` are positions of the active joints (deg). Raises RobotError."""
        present = self._encoders.encoders()
        if start is not None:
            places, given = self.active_places(), np.atleast_1d(np.asarray(start, dtype=np.float64))
            if given.size != len(places):
                raise RefusedError(f"{len(places)} joints are active, so a start has as many values, not {given.size}")
            present = present.copy()
            present[places] = given
        return self._solve(np.atleast_1d(np.asarray(target, dtype=np.float64)), present, attempts=6)

    def tracking(self) -> bool:
        """Return whether targets are solved again when other joints move."""
        return self.settings.tracking

    def set_tracking(self, tracking: bool) -> None:
        """Set it."""
        self.change(tracking=tracking)

    def whole_pose(self) -> bool:
        """Return whether a target that does not say so is a pose, and not a position."""
        return self._whole_pose

    def set_whole_pose(self, whole_pose: bool) -> None:
        """Set it."""
        self._whole_pose = whole_pose

    def verbose(self) -> bool:
        """Return whether answers are reported."""
        return self._verbose

    def set_verbose(self, verbose: bool) -> None:
        """Set it."""
        self._verbose = verbose

    def drawn(self) -> PointPreference | None:
        """Return to which place a link is drawn."""
        return self._solver.drawn

    def set_drawn(self, drawn: PointPreference | None) -> None:
        """Set it; None: nowhere. Raises RefusedError for a link that the chain does not have."""
        if drawn is not None:
            self.chain.jacobian([0.0] * len(self.chain), drawn.link)
        with self._solving:
            self._solver.drawn = drawn

    def suspend(self) -> None:
        """Answer no targets until ``resume``."""
        self._suspended = True

    def resume(self) -> None:
        """Go on."""
        self._suspended = False

    def status(self) -> str:
        """Return ``running`` or ``suspended``."""
        return "suspended" if self._suspended or self._problem else "running"

    def quit(self) -> None:
        """End the program."""
        self._quits()

    def help(self) -> str:
        """Return the words of the requests."""
        return _HELP


def _read_drawn(value: Value) -> PointPreference | None:
    links, *rest = inner(value)
    if whole(links) < 1:
        return None
    if len(rest) < 2:  # noqa: PLR2004 - place and weights
        raise RefusedError(f"a number of links, a place and weights are needed, not {shown(value)}")
    (x, y, z), (by_x, by_y, by_z) = ([number(one) for one in inner(part, 3)][:3] for part in rest[:2])
    return PointPreference(whole(links) - 1, (x, y, z), (by_x, by_y, by_z))


def _write_drawn(drawn: PointPreference | None) -> Value:
    if drawn is None:
        return Bottle([-1])
    return Bottle([drawn.link + 1, floats(drawn.position), floats(drawn.weights)])


def _read_priority(value: Value) -> str:
    words = {Vocab("xyz"): "position", Vocab("ang"): "orientation"}
    word = as_vocab(value)
    if word is None or word not in words:
        raise RefusedError(f"the priority is xyz or ang, not {shown(value)}")
    return words[word]


_PRIORITY: Kind = alone(lambda value: Vocab("xyz" if value == "position" else "ang"), _read_priority)
_SHARED = ("active_joints", "rest_posture", "rest_weights", "limits", "tip", "tracking")
SOLVER_TABLE = RequestTable(
    (
        TABLE.by_key["ask"],
        *(TABLE.by_key[f"{prefix}{name}"] for name in _SHARED for prefix in ("", "set_")),
        *setting("pose", "whole_pose", choice(Vocab("full"), Vocab("xyz"))),
        *setting("prio", "priority", _PRIORITY),
        *setting("verb", "verbose", choice(Vocab("on"), Vocab("off"))),
        *setting("tsk2", "drawn", alone(_write_drawn, _read_drawn)),
        row("susp", "suspend"),
        row("run", "resume"),
        row("stat", "status", NOTHING, TEXT),
        row("help", "help", NOTHING, TEXT),
        row("quit", "quit"),
    ),
    spell=Vocab.truncated,
)


class SolverPorts:
    """The ports of a solver, whose names begin with ``name``. Raises ConnectError and AddressError."""

    def __init__(
        self, name: str, make: Callable[[Callable[[Bottle], object]], CartesianSolver], network: Network
    ) -> None:
        self.name = name
        self._network = network
        with ExitStack() as opened:
            out: BufferedPort[Bottle] = opened.enter_context(BufferedPort(f"{name}/out", network=network, inputs=False))
            self.solver = make(lambda answer: out.write(answer, strict=True))
            opened.callback(self.solver.close)
            opened.enter_context(BufferedPort(f"{name}/in", callback=self._take, network=network, outputs=False))
            answers = with_error_replies(
                lambda request: SOLVER_TABLE.answer(self.solver, request),
                port=f"{name}/rpc", network=network, failure=Bottle([NACK]),
            )  # fmt: skip
            opened.enter_context(RpcServer(f"{name}/rpc", answers, network=network, guarded=True))
            self._opened = opened.pop_all()

    def _take(self, message: Received[Bottle]) -> None:
        """Take a target. Runs in the thread of the port."""
        try:
            self.solver.take(message.value)
        except (RobotError, BottleError) as error:
            self._network.report(f"{self.name}/in: {message.value.to_text()[:80]!r} is ignored: {error}")

    def close(self) -> None:
        """Close the ports, and end the solver."""
        self._opened.close()
