"""What controllers in space have in common: motions that end, settings that are stored, and events.

A task is what is asked in space, such as a pose of the hand or a point to look at. See
:mod:`~rtf.robot.interfaces.cartesian` and :mod:`~rtf.robot.interfaces.gaze`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from rtf import clock

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.bottle import Bottle
    from rtf.robot.interfaces.axes import FloatArray


class ControllerEvent(NamedTuple):
    """Something that happened at a time, in seconds of the robot's clock.

    Names are ``motion-onset``, ``motion-ongoing``, which has the share of the way as ``checkpoint``, ``motion-done``,
    ``closing``, and others of a controller.
    """

    name: str
    time: float
    checkpoint: float | None = None


#: Called with each event, in a thread of the sender, which waits.
EventObserver: TypeAlias = "Callable[[ControllerEvent], None]"


class ITaskControl(ABC):
    """Motions to a target, contexts and events. A context is all that has been set, stored under a number."""

    @abstractmethod
    def stop(self) -> None:
        """End a motion; the joints hold their positions."""

    @abstractmethod
    def motion_done(self) -> bool:
        """Return whether the last motion has ended."""

    def wait_motion_done(self, timeout: float, period: float = 0.1) -> bool:
        """Ask every ``period`` whether the motion has ended; False after ``timeout``, in seconds of the robot's clock.

        Raises what :meth:`motion_done` does.
        """
        time = clock.current()
        end = time.now() + timeout
        while not self.motion_done():
            left = end - time.now()
            if left <= 0.0:
                return False
            time.sleep(min(period, left))
        return True

    @abstractmethod
    def info(self) -> Bottle:
        """Return what the controller says of itself: pairs of a key, such as ``server_version``, and its value."""

    @abstractmethod
    def tracking(self) -> bool:
        """Return whether the target is kept after the motion, whatever other joints do."""

    @abstractmethod
    def set_tracking(self, tracking: bool) -> None:
        """Set it."""

    @abstractmethod
    def tweaks(self) -> Bottle:
        """Return the settings of an expert: pairs of a key and its value."""

    @abstractmethod
    def set_tweaks(self, tweaks: Bottle) -> None:
        """Set some of them."""

    # Contexts --------------------------------------------------------------------------------------------------------

    @abstractmethod
    def store_context(self) -> int:
        """Store all settings, and return the number under which ``restore_context`` finds them."""

    @abstractmethod
    def restore_context(self, context: int) -> None:
        """Restore settings; 0 are those of the start."""

    @abstractmethod
    def delete_contexts(self, contexts: Sequence[int]) -> None:
        """Forget stored settings; unknown numbers are ignored."""

    # Events ----------------------------------------------------------------------------------------------------------

    @abstractmethod
    def add_checkpoint(self, share: float) -> None:
        """Ask for an event ``motion-ongoing`` when a motion has done this share of its way, 0 to 1."""

    @abstractmethod
    def remove_checkpoint(self, share: float) -> None:
        """Take back what was asked for once. Raises RefusedError if it was not."""

    @abstractmethod
    def checkpoints(self) -> FloatArray:
        """Return the shares for which there will be events."""

    @abstractmethod
    def observe_events(self, observer: EventObserver) -> None:
        """Call a function with every event from now on."""

    @abstractmethod
    def unobserve_events(self, observer: EventObserver) -> None:
        """Stop calling a function; no error if it is unknown."""
