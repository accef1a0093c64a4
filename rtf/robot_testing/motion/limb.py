"""A limb: the joints of a kinematic chain on the parts that have them, watched by the guards of these parts."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.robot.errors import RefusedError
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.judging.encoder_agreement import Motion, Tolerance, encoder_evidence

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rtf.robot.interfaces import FloatArray
    from rtf.robot.kinematics import Chain
    from rtf.robot_testing.guard.transmission import Transmission
    from rtf.robot_testing.judging.blame import Evidence
    from rtf.robot_testing.motion.part import Part
    from rtf.robot_testing.motion.trace import Trace

#: Joint and motor encoders agree within these: play, and what gears and tendons yield by.
_AGREE = Tolerance(least=2.0, share=0.1)
_FEWEST = 10


class LimbGuardError(GuardError):
    """A guard had to stop a joint of ``part``."""

    def __init__(self, part: Part, error: GuardError) -> None:
        super().__init__(str(error), error.joint, error.excuse, error.finding, error.time, part.name)
        self.part = part


class JointPlace(NamedTuple):
    """A joint of a chain: the part that has it, and its number there."""

    part: Part
    number: int


class JointGroup:
    """Joints and the parts that have them, all of them. Raises RefusedError for one that is missing."""

    def __init__(self, joints: Sequence[str], parts: Sequence[Part]) -> None:
        self.joints = tuple(joints)
        self.parts = tuple(parts)
        found = {name: JointPlace(part, number) for part in parts for number, name in enumerate(part.names)}
        missing = [joint for joint in joints if joint not in found]
        if missing:
            raise RefusedError(f"no part has {', '.join(missing)}")
        self.places = [found[joint] for joint in joints]

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """The limits of its joints (deg), as their boards report them."""
        low = np.array([place.part.low[place.number] for place in self.places])
        high = np.array([place.part.high[place.number] for place in self.places])
        return low, high

    def positions(self) -> FloatArray:
        """Return the positions of its joints (deg) by their encoders."""
        states = {part.name: part.board.encoders() for part in self.parts}
        return np.array([states[place.part.name][place.number] for place in self.places])

    def watch(self) -> None:
        """Let the guards of its parts watch. Raises LimbGuardError."""
        for part in self.parts:
            if part.guard is None:
                continue
            try:
                part.guard.watch()
            except GuardError as error:
                raise LimbGuardError(part, error) from error

    @contextmanager
    def recorded(self) -> Iterator[list[tuple[Part, Trace]]]:
        """Record the states of its parts inside the ``with`` block."""
        with ExitStack() as recording:
            yield [(part, recording.enter_context(part.recorded())) for part in self.parts]


class Limb(JointGroup):
    """A chain and the parts of its joints; ``parts`` have all of them. Raises RefusedError for one that is missing."""

    def __init__(self, chain: Chain, parts: Sequence[Part]) -> None:
        super().__init__(chain.joints, parts)
        self.chain = chain


def encoder_disagreement(part: Part, trace: Trace, transmission: Transmission) -> list[Evidence]:
    """Return the evidence on joints of a part whose encoders do not show the same motion as those of their motors."""
    if len(trace) < _FEWEST:
        return []
    motors = trace.motor_positions
    if not np.isfinite(motors).all():
        return []
    motion = Motion.of(trace.positions, motors, transmission.gearbox, transmission.coupling)
    return encoder_evidence(motion, part.names, _AGREE, obeyed=True)
