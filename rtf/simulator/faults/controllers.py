"""Faults of controllers that are devices of the program of the simulated robot."""

from __future__ import annotations

import threading
from abc import abstractmethod
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, cast

from rtf.robot.cartesian.controller import CartesianController
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics.poses import homogeneous
from rtf.robot.network.task_server import ControlledServer
from rtf.robot.publishing import PeriodicPublishing
from rtf.simulator.faults.base import Fault, Layer, Parameter, Target

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.robot.interfaces import ITaskControl

#: Seconds of real time after which a request to a silent controller is refused, so that its program can always end.
_LONGEST = 60.0


class _ControllerFault(Fault):
    """A fault of one controller, which is named by the beginning of its ports."""

    layer = Layer.CONTROLLER
    target_kind = Target.CONTROLLER
    controlled: ControlledServer[Any]

    def aim(self) -> None:
        published = [one.publisher for one in self.simulation.publishers if isinstance(one, PeriodicPublishing)]
        known = {one.server.name: one for one in published if isinstance(one, ControlledServer)}
        if self.target not in known:
            there = ", ".join(sorted(known)) or "none in its program"
            raise RefusedError(f"{self.kind}: there is no controller {self.target!r}; there are {there}")
        self.controlled = known[self.target]


class ControllerFrame(_ControllerFault):
    """A frame of the hand that is not that of the robot."""

    kind = "controller_frame"
    description = "The Cartesian controller has a wrong frame of the hand, or a tool that is not there."
    symptom = "It brings another point than the hand to its targets, and reports the pose of that point."
    parameters = (Parameter("shift", 20.0, "mm", "of the frame, along its x axis", -1000.0, 1000.0),)
    shift: float

    def begin(self) -> None:
        controller = self.controlled.controller
        if not isinstance(controller, CartesianController):
            raise RefusedError(f"{self.kind}: {self.target} controls no hand")
        self._chain = controller.chain
        wrong = homogeneous(self._chain.tip[:3, :3], self._chain.tip[:3, 3] + self._chain.tip[:3, 0] * self.shift / 1e3)
        controller.chain = self._chain.with_tip(wrong)

    def end(self) -> None:
        self.controlled.controller.chain = self._chain


class _WrongAnswers(_ControllerFault):
    """A controller of which one request is answered by something else than the controller."""

    request: ClassVar[str]

    def begin(self) -> None:
        server = self.controlled.server
        self._task = server.task
        instead = partial(self.answer, getattr(self._task, self.request))
        server.task = cast("ITaskControl", _Instead(self._task, self.request, instead))

    def end(self) -> None:
        self.controlled.server.task = self._task

    @abstractmethod
    def answer(self, healthy: Callable[..., object], *values: object) -> object:
        """Answer the request in place of the healthy controller."""


class ControllerStopIgnored(_WrongAnswers):
    """A controller that does not stop."""

    kind = "controller_stop_ignored"
    description = "The controller acknowledges a stop, and goes on."
    symptom = "A motion ends at its target, although a client, a guard or an operator stops it."
    request = "stop"

    def answer(self, healthy: Callable[..., object], *values: object) -> object:
        del healthy, values
        return None  # as a stop does


class ControllerEarly(_WrongAnswers):
    """A controller that says too early that a motion is done."""

    kind = "controller_early"
    description = "The controller says that its motion is done as soon as it begins."
    symptom = "Clients go on with their next step while the joints still move."
    request = "motion_done"

    def answer(self, healthy: Callable[..., object], *values: object) -> object:
        del healthy, values
        return True


class ControllerQuick(_WrongAnswers):
    """A Cartesian controller that does not keep to the duration of a trajectory."""

    kind = "controller_quick"
    description = "The Cartesian controller takes a part of the time that it is given for a trajectory."
    symptom = "The hand, and all joints, are faster than they were asked to be."
    parameters = (Parameter("share", 0.5, "", "of the time", 0.05, 20.0, healthy=1.0),)
    share: float
    request = "go_to"

    def answer(self, healthy: Callable[..., object], *values: object) -> object:
        target, *rest = values
        given = rest[0] if rest and rest[0] is not None else self.controlled.controller.trajectory_time()
        return healthy(target, self.share * cast("float", given))


class ControllerSilent(_ControllerFault):
    """A controller that takes requests and never answers."""

    kind = "controller_silent"
    description = "The controller hangs: it takes requests and does not answer."
    symptom = "Its clients wait for their answers in vain; its poses are sent."

    def begin(self) -> None:
        server = self.controlled.server
        self._task, self._hanging = server.task, _Hanging()
        server.task = cast("ITaskControl", self._hanging)

    def end(self) -> None:
        self.controlled.server.task = self._task
        self._hanging.over.set()


class _Instead:
    """In place of a controller: one request has another answer."""

    def __init__(self, task: ITaskControl, request: str, answer: Callable[..., object]) -> None:
        self._task, self._request, self._answer = task, request, answer

    def __getattr__(self, name: str) -> object:
        return self._answer if name == self._request else getattr(self._task, name)


class _Hanging:
    """In place of a controller: all that is asked waits until it is over."""

    def __init__(self) -> None:
        self.over = threading.Event()

    def __getattr__(self, name: str) -> Callable[..., NoReturn]:
        def wait(*_: object) -> NoReturn:
            self.over.wait(_LONGEST)
            raise RefusedError(f"the controller hangs, and does not answer to {name}")

        return wait


KINDS = (ControllerFrame, ControllerStopIgnored, ControllerEarly, ControllerQuick, ControllerSilent)
