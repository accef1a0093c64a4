"""Faults of controllers that are devices of the program of the simulated robot."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, NoReturn, cast

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
    symptom = "It brings another point than the hand to its targets, and tells the pose of that point."
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


class _Hanging:
    """In place of a controller: all that is asked waits until it is over."""

    def __init__(self) -> None:
        self.over = threading.Event()

    def __getattr__(self, name: str) -> Callable[..., NoReturn]:
        def wait(*_: object) -> NoReturn:
            self.over.wait(_LONGEST)
            raise RefusedError(f"the controller hangs, and does not answer to {name}")

        return wait


KINDS = (ControllerFrame, ControllerSilent)
