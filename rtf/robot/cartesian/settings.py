"""Settings of the motions of a chain: what a context stores, and the methods that read and change it.

They are those of a controller, and those of a solver that is a program of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.controllers.cartesian import STRAIGHTNESS
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import pose_of, vector_of

if TYPE_CHECKING:
    import threading
    from collections.abc import Collection, Sequence

    from rtf.robot.interfaces.axes import FloatArray, Values
    from rtf.robot.interfaces.cartesian import CartesianPriority
    from rtf.robot.kinematics import Chain


@dataclass(frozen=True, slots=True)
class Settings:
    """What a context stores."""

    active: tuple[bool, ...]
    rest: tuple[float, ...]  # deg
    weights: tuple[float, ...]
    limits: tuple[tuple[float, float], ...]  # deg
    tip: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    duration: float = 2.0  # s
    tolerance: float = 0.01  # m and rad
    tracking: bool = False
    priority: CartesianPriority = "position"
    straightness: float = STRAIGHTNESS


class ChainSettings:
    """The settings of a chain with the limits of its board; the methods are those of ``ICartesianControl``.

    ``active`` joints take part in motions at first; those ``together`` are only switched together. Raises RefusedError
    for joints that the chain does not have.
    """

    def __init__(
        self,
        chain: Chain,
        *,
        active: Sequence[bool] | None = None,
        together: Collection[str] = (),
        lock: threading.RLock,
    ) -> None:
        self._settings_lock = lock
        self._chain = chain
        self._together = [chain.index(joint) for joint in together]
        self._board_limits = tuple(zip(chain.minima.tolist(), chain.maxima.tolist(), strict=True))
        count = len(chain)
        rest = np.clip(np.zeros(count), chain.minima, chain.maxima)
        chosen = tuple(active) if active is not None else (True,) * count
        self.use(Settings(chosen, tuple(rest.tolist()), (0.0,) * count, self._board_limits))

    @property
    def chain(self) -> Chain:
        """The chain to the frame of the hand, with the limits of the board; another hand has another one."""
        return self._chain

    @chain.setter
    def chain(self, chain: Chain) -> None:
        with self._settings_lock:
            self._chain = chain
            self.use(self.settings)

    def use(self, settings: Settings) -> None:
        """Take settings, and make what follows from them: the chain with the tool, and the same within limits."""
        self.settings = settings
        self.tipped = self._chain.with_tip(self._chain.tip @ pose_of(settings.tip))
        self.limited = self.tipped.limited(dict(zip(self._chain.joints, settings.limits, strict=True)))

    def change(self, **changes: object) -> None:
        """Change some members of the settings."""
        with self._settings_lock:
            self.use(replace(self.settings, **changes))  # type: ignore[arg-type] # names of members

    def active_places(self) -> list[int]:
        """Return the places of the joints that take part."""
        return [place for place, chosen in enumerate(self.settings.active) if chosen]

    def other_places(self) -> list[int]:
        """Return the places of the joints that do not."""
        return [place for place, chosen in enumerate(self.settings.active) if not chosen]

    def priority(self) -> CartesianPriority:
        """Return what is met first of a pose that cannot be met."""
        return self.settings.priority

    def set_priority(self, priority: CartesianPriority) -> None:
        """Set it. Raises RefusedError for another word."""
        if priority not in ("position", "orientation"):
            raise RefusedError(f"the priority is position or orientation, not {priority!r}")
        self.change(priority=priority)

    def active_joints(self) -> tuple[bool, ...]:
        """Return which joints of the chain take part in motions."""
        return self.settings.active

    def set_active_joints(self, active: Sequence[bool | None]) -> tuple[bool, ...]:
        """Choose the joints that take part, and return which do; see ICartesianControl."""
        with self._settings_lock:
            present = self.settings.active
            if len(active) > len(present):
                raise RefusedError(f"{self._chain.name} has {len(present)} joints, not {len(active)}")
            chosen = [old if new is None else new for old, new in zip(present, active, strict=False)]
            chosen += present[len(active) :]
            if len({chosen[place] for place in self._together}) > 1:
                for place in self._together:
                    chosen[place] = present[place]
            self.change(active=tuple(chosen))
        return tuple(chosen)

    def rest_posture(self) -> FloatArray:
        """Return the posture that is preferred (deg)."""
        return np.array(self.settings.rest)

    def set_rest_posture(self, posture: Values) -> FloatArray:
        """Set it for the first joints, and return all of it, within the limits. Raises RefusedError."""
        given = self._first(posture, self.settings.rest)
        low, high = np.array(self.settings.limits).T
        self.change(rest=tuple(np.clip(given, low, high).tolist()))
        return self.rest_posture()

    def rest_weights(self) -> FloatArray:
        """Return how much each joint is drawn to the rest posture; 0: to where it is."""
        return np.array(self.settings.weights)

    def set_rest_weights(self, weights: Values) -> FloatArray:
        """Set it for the first joints, and return all of it. Raises RefusedError."""
        given = self._first(weights, self.settings.weights)
        self.change(weights=tuple(np.maximum(given, 0.0).tolist()))
        return self.rest_weights()

    def _first(self, values: Values, present: Sequence[float]) -> FloatArray:
        """Return the present values, the first of them changed."""
        given = np.atleast_1d(np.asarray(values, dtype=np.float64))
        if given.ndim != 1 or given.size > len(present) or not np.isfinite(given).all():
            raise RefusedError(
                f"{self._chain.name} has {len(present)} joints: {given.tolist()} are not values of these"
            )
        return np.concatenate([given, present[given.size :]])

    def limits(self, joint: int) -> tuple[float, float]:
        """Return the limits of a joint in motions (deg). Raises RefusedError."""
        return self.settings.limits[self._joint(joint)]

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """Set them, within those of the board. Raises RefusedError."""
        low, high = self._board_limits[self._joint(joint)]
        if not low <= minimum <= maximum <= high:
            name = self._chain.joints[joint]
            raise RefusedError(f"limits of {name} lie within {low:g} and {high:g}, not {minimum:g} and {maximum:g}")
        with self._settings_lock:
            limits = list(self.settings.limits)
            limits[joint] = (float(minimum), float(maximum))
            self.change(limits=tuple(limits))

    def _joint(self, joint: int) -> int:
        if not 0 <= joint < len(self._chain):
            raise RefusedError(f"{self._chain.name} has joints 0 to {len(self._chain) - 1}, not {joint}")
        return joint

    def tip(self) -> FloatArray:
        """Return the pose of the tool in the frame of the last link, seven numbers."""
        return np.array(self.settings.tip)

    def set_tip(self, tip: Values) -> None:
        """Set the tool. Raises RefusedError."""
        values = np.atleast_1d(np.asarray(tip, dtype=np.float64))
        self.change(tip=tuple(vector_of(pose_of(values)).tolist()))
