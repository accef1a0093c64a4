"""The demonstration ``demoRedBall``: the robot looks at the ball and reaches for it, on the ports of the original.

============================== =======================================================================================
``/demoRedBall/rpc``           ``start [AZI ELE VER]``: look there (deg), then follow the ball; ``stop``: stop, and go
                               home; ``update_pose DX DY DZ``: put the simulated ball at an offset (m) from its first
                               place; ``status``: its state, the reason, and where the ball is (m). The replies begin
                               with ``[ok]``, or are ``[fail]`` and a message
``/demoRedBall/trackTarget:i`` the places of the tracker
``/demoRedBall/gui:o``         while it runs, the ball for a viewer: 15 elements
============================== =======================================================================================

The reply to ``start`` comes when the robot has looked there, that to ``stop`` when it is on its way home.
"""

from __future__ import annotations

import queue
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NoResultError
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rtf import clock
from rtf.bottle import Bottle, Property, Vocab, as_float, as_string
from rtf.errors import RtfError
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.rpc import RpcServer
from rtf.red_ball.behaviour import Behaviour, Parts, State
from rtf.red_ball.eyes import cameras_of
from rtf.red_ball.hand import Hand, Reach
from rtf.red_ball.history import Positions
from rtf.red_ball.scene import SceneBall
from rtf.red_ball.target import Target
from rtf.robot.boards.client import connect
from rtf.robot.device import make_device
from rtf.robot.errors import RefusedError
from rtf.robot.interfaces import IGazeControl
from rtf.robot.interfaces.gaze import GazeAngles

if TYPE_CHECKING:
    import threading
    from collections.abc import Sequence

    from rtf.bottle import Value
    from rtf.middleware.ports.network import Network
    from rtf.red_ball.hand import Side
    from rtf.robot.model import RobotModel

NAME, TRACKER, GAZE = "/demoRedBall", "/pf3dTracker", "/iKinGazeCtrl"
PERIOD = 0.02  # s
#: How long a request waits to be done, by the machine's clock (s).
_PATIENCE = 60.0
_OK, _FAIL = Vocab("ok"), Vocab("fail")
_CARRIER = "tcp"
#: What a viewer gets besides the place: a size (mm), no turn, red, not transparent.
_SIZE, _LOOK = [50.0] * 3, [0.0, 0.0, 0.0, 255, 0, 0, 1.0]
_MILLIMETRES = 1e3


@dataclass(frozen=True, slots=True)
class DemoSettings:
    """Its settings. ``robot`` is the beginning of the names of the robot's ports, ``name`` that of its own."""

    model: RobotModel
    robot: str = "icubSim"
    name: str = NAME
    tracker: str = TRACKER  # empty: others connect it
    gaze: str = GAZE
    sides: tuple[Side, ...] = ("left", "right")
    reach: Reach = field(default_factory=Reach)
    patience: float = 20.0  # how long the program waits for the robot (s)


class Demo:
    """The demonstration, from its construction to ``close``; one thread calls ``run``.

    Raises RtfError if something of the robot is not there.
    """

    def __init__(self, settings: DemoSettings, *, network: Network) -> None:
        self._settings = settings
        self._network = network
        self._asked: queue.SimpleQueue[tuple[Bottle, Future[Bottle]]] = queue.SimpleQueue()
        self._waiting: list[tuple[State, Future[Bottle]]] = []
        self._shown = False
        with ExitStack() as opened:
            self._open(opened)
            self._opened = opened.pop_all()

    def _open(self, opened: ExitStack) -> None:
        settings, network = self._settings, self._network
        name, robot = settings.name, settings.robot
        torso, head = (
            opened.enter_context(connect(f"/{robot}/{part}", local=f"{name}/{part}", carrier=_CARRIER, network=network))
            for part in ("torso", "head")
        )
        hands = {side: Hand(side, robot, name, settings.reach, network, opened) for side in settings.sides}
        remote = {"remote": settings.gaze, "local": f"{name}/gaze", "carrier": _CARRIER, "timeout": 1.0}
        client = opened.enter_context(closing(make_device("gazecontrollerclient", Property(remote), network=network)))
        gaze = client.view(IGazeControl)  # type: ignore[type-abstract]  # it is only looked for
        self._scene = SceneBall.find(robot, network, opened)
        seen_by = cameras_of(settings.model), [Positions(torso), Positions(head)]
        self._target = opened.enter_context(closing(Target(f"{name}/trackTarget:i", *seen_by, network=network)))
        if settings.tracker:
            self._target.connect(f"{settings.tracker}/data:o", _CARRIER)
        self.behaviour = Behaviour(Parts(gaze, hands, torso), self._target, network.report)
        self._gui: BufferedPort[Bottle] = opened.enter_context(
            BufferedPort(f"{name}/gui:o", network=network, inputs=False)
        )
        opened.enter_context(RpcServer(f"{name}/rpc", self.answer, network=network))

    def close(self) -> None:
        """Close all ports; what moves is stopped."""
        if self.behaviour.state is not State.IDLE:
            self.behaviour.give_up("the demonstration ends")
        self._opened.close()

    # Requests, in the threads of the clients -------------------------------------------------------------------------

    def answer(self, request: Bottle) -> object:
        """Return the reply to a request, when it is done; words that are none have an empty one, as in the original."""
        word = as_string(request.get(0))
        try:
            if word == "update_pose":
                return self._move_ball(request)
            if word == "status":
                return self._status()
            return self._pass_on(request) if word in ("start", "stop") else Bottle()
        except RtfError as error:
            return Bottle([_FAIL, str(error)])

    def _move_ball(self, request: Bottle) -> Bottle:
        if self._scene is None:
            raise RefusedError("update_pose: only a simulated ball can be moved; /ROBOT/world is not there")
        self._scene.move(_numbers(list(request)[1:], 3, "update_pose DX DY DZ"))
        return Bottle([_OK])

    def _status(self) -> Bottle:
        ball = self._target.ball
        place = [] if ball is None else [float(one) for one in ball.place]
        return Bottle([_OK, str(self.behaviour.state), self.behaviour.reason, Bottle(place)])

    def _pass_on(self, request: Bottle) -> Bottle:
        """Have the loop do it."""
        done: Future[Bottle] = Future()
        self._asked.put((request, done))
        try:
            return done.result(_PATIENCE)
        except NoResultError:
            return Bottle([_FAIL, f"{as_string(request.get(0))} was not done within {_PATIENCE:g} s"])

    # The loop --------------------------------------------------------------------------------------------------------

    def run(self, end: threading.Event) -> None:
        """Go on until ``end`` is set, in the time of this process's clock."""
        time = clock.current()
        due = time.now()
        while not end.is_set():
            self.step(time.now())
            due = max(due + PERIOD, time.now())
            time.sleep(due - time.now())

    def step(self, now: float) -> None:
        """Do what has to be done at ``now`` (s)."""
        while not self._asked.empty():
            self._begin(*self._asked.get(), now)
        self.behaviour.step(now)
        self._reply()
        self._show()

    def _begin(self, request: Bottle, done: Future[Bottle], now: float) -> None:
        try:
            if as_string(request.get(0)) == "stop":
                self.behaviour.stop(now)
            else:
                words = list(request)[1:]
                self.behaviour.start(now, _angles(words) if words else None)
        except RtfError as error:
            done.set_result(Bottle([_FAIL, str(error)]))
            return
        self._waiting.append((self.behaviour.state, done))

    def _reply(self) -> None:
        """Reply to those whose request has been done: the state it led to has passed, or holds until further notice."""
        behaviour, waiting = self.behaviour, self._waiting
        self._waiting = []
        for state, done in waiting:
            if state in (State.LOOKING, State.STOPPING) and behaviour.state is state:
                self._waiting.append((state, done))
            elif behaviour.state is State.IDLE and behaviour.reason:
                done.set_result(Bottle([_FAIL, behaviour.reason]))
            else:
                done.set_result(Bottle([_OK]))

    def _show(self) -> None:
        """Tell a viewer where the ball is."""
        ball = self._target.ball
        if self.behaviour.state in (State.FOLLOWING, State.LOST) and ball is not None:
            place = [float(one) * _MILLIMETRES for one in ball.place]
            self._gui.write(Bottle(["object", "ball", *_SIZE, *place, *_LOOK]))
            self._shown = True
        elif self._shown:
            self._gui.write(Bottle(["delete", "ball"]))
            self._shown = False


def _angles(words: Sequence[Value]) -> GazeAngles:
    azimuth, elevation, vergence = _numbers(words, 3, "start [AZI ELE VER]")
    return GazeAngles(azimuth, elevation, vergence)


def _numbers(words: Sequence[Value], count: int, usage: str) -> list[float]:
    numbers = [as_float(one) for one in words if isinstance(one, int | float)]
    if not len(numbers) == len(words) == count or not np.isfinite(numbers).all():
        raise RefusedError(f"write {usage}, with {count} numbers")
    return numbers
