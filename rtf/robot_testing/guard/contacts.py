"""Contact detection: the force-torque sensor of a limb shows when the limb hits an obstacle.

The sensor also shows the weight of the limb, which turns with it, and its inertial and centrifugal forces. A change of
force is therefore compared with the greatest change that the measured motion can explain. The rest is next to zero
while a limb is free, however fast it moves, starts, stops or falls, and grows while something holds it. The model of
the robot says which part has a sensor, and its load; the sensor sees the contacts beyond it.
"""

from __future__ import annotations

import math
import statistics
from bisect import bisect_left, bisect_right
from collections import deque
from functools import cached_property
from itertools import islice, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.errors import RtfError
from rtf.middleware.ports import remote
from rtf.middleware.ports.port import Port
from rtf.middleware.types import VECTOR, Stamp
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import RefusedError, RobotError
from rtf.robot.extended_state import Field
from rtf.robot_testing.judging.inertial_force import InertialForce, Load

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage
    from rtf.robot.boards.client import RemoteBoard
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.model import RobotModel

#: The channels of a message, with their units.
CHANNELS = {"force_x": "N", "force_y": "N", "force_z": "N", "torque_x": "Nm", "torque_y": "Nm", "torque_z": "Nm"}
_SENSOR = "/analog:o"
#: Number of messages kept for the recording of a failure: about ten seconds.
_HISTORY = 1000
#: Window in which the change of a force counts, s. A soft contact at 20 deg/s takes about as long to build up.
WITHIN = 0.2
#: The inertial force is computed from the states of this time, s, before and after the averaged forces: stamps are not
#: exact.
_BEFORE, _AFTER = 0.035, 0.025
#: A force is evaluated when there are states from this time after it, s: one and a half periods of the state. A newer
#: force may come from motion that no state shows yet.
_KNOWN = 0.015
#: The motion between two states is unknown if they are farther apart than this, s, and than this number of usual
#: periods.
_GAP, _PERIODS = 0.025, 2.2
#: Number of states that are kept, and of messages that are searched for one as old as the states.
_KEPT = 50
#: A sensor is silent if no message comes for this time, s, while states do. It sends a hundred messages a second.
_SILENT = 1.0
#: A stamp that is earlier than the last one by more, s, means that the clock was set.
_JUMP = 1.0
#: Number of forces of which the mean of the middle two counts. So a single outlier is no contact, and the window is as
#: long as that of the states which explain it: a push of 20 ms shows in one or two messages, as in the slope of states.
_AVERAGED = 4


class NoForcesError(RobotError):
    """The force-torque sensor is missing, silent, or sends something else than forces."""


class ForceMessage:
    """A message of a force-torque sensor, decoded once, when it is asked for."""

    def __init__(self, source: str, delivery: IncomingMessage) -> None:
        self._source, self._delivery = source, delivery

    @cached_property
    def stamp(self) -> Stamp:
        """Its stamp; number -1 and time 0 if it has none."""
        return Stamp.parse(self._delivery.envelope) or Stamp()

    @cached_property
    def values(self) -> FloatArray:
        """Its six numbers: force (N) and torque (Nm). Raises NoForcesError for any other content."""
        try:
            values = self._delivery.read(VECTOR)
        except RtfError as error:
            raise NoForcesError(f"{self._source} sends no forces: {error}") from error
        if values.size != len(CHANNELS):
            raise NoForcesError(
                f"{self._source} sends {values.size} numbers, not the {len(CHANNELS)} of a force-torque sensor"
            )
        return np.asarray(values, dtype=np.float64)


class Forces:
    """The last messages of a force-torque sensor, decoded on demand. Raises NoForcesError if it cannot be connected."""

    def __init__(self, source: str, *, network: Network) -> None:
        self.source = source
        self._messages: deque[ForceMessage] = deque(maxlen=_HISTORY)
        self._port = Port("", self._receive, network=network, outputs=False, nonblocking=True, promise=VECTOR.promise)
        try:
            # tcp waits for the acknowledgement: in lockstep no message is under way when the time advances.
            remote.connect(network, Contact(source), Contact(self._port.name), "tcp")
        except RtfError as error:
            self._port.close()
            raise NoForcesError(str(error)) from error

    def _receive(self, delivery: IncomingMessage) -> None:
        """Keep a message. Called in the thread of the connection."""
        self._messages.append(ForceMessage(self.source, delivery.kept()))

    def newest(self, count: int) -> list[ForceMessage]:
        """Return the last ``count`` messages, the newest first."""
        # Copied in one step: messages arrive meanwhile.
        return self.messages()[: -count - 1 : -1]

    def messages(self) -> list[ForceMessage]:
        """Return all kept messages, the oldest first."""
        return list(self._messages)

    def close(self) -> None:
        """Close the port."""
        self._port.close()


def force_rows(kept: Sequence[ForceMessage]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Decode messages: their numbers (-1 without a stamp), stamps (s), and forces (N) and torques (Nm).

    The last array has shape (messages, 6). Raises NoForcesError for a message without six numbers.
    """
    return (
        np.array([float(one.stamp.count) for one in kept]),
        np.array([one.stamp.time for one in kept]),
        np.array([one.values for one in kept]).reshape(-1, len(CHANNELS)),
    )


class _Seen(NamedTuple):
    """A state: its stamp (s), the positions of the joints that move mass (rad), and all speeds (deg/s)."""

    time: float
    positions: FloatArray
    speeds: FloatArray


class _Sample(NamedTuple):
    """A sample: time (s), force (N), joint positions (rad) and speeds (deg/s), and the most inertial force (N)."""

    time: float
    force: FloatArray
    positions: FloatArray
    speeds: FloatArray
    inertial: float


class DetectedContact(NamedTuple):
    """A contact: the change of force that the motion does not explain (N), and the joint speeds before it (deg/s)."""

    force: float
    speeds: FloatArray


class ContactWatch:
    """Contact detection of one limb. ``detect`` is called periodically from one thread, while the limb moves.

    ``forces`` are those of the limb's sensor; ``robot`` has the sensor's load, and the joints of ``part`` that move
    hardly any mass.
    """

    def __init__(self, board: RemoteBoard, forces: Forces, robot: RobotModel, part: str) -> None:
        self.forces = forces
        sensor = robot.contact_sensor(part)
        if sensor is None:
            raise RefusedError(f"{robot.name} has no force-torque sensor with a load on {part}")
        self._load = Load(sensor.weight or 0.0, sensor.lever)
        self._inertial = InertialForce(self._load)
        self._heavy = np.array([name not in robot.parts[part].light for name in board.axis_names()])
        self._states: deque[_Seen] = deque(maxlen=_KEPT)
        self._samples: deque[_Sample] = deque()
        self._heard: tuple[ForceMessage | None, float] | None = None  # the last message, and its state's time, s
        self._free: _Sample | None = None  # the sample before a contact that may last
        self._invalid_since: float | None = None  # since when forces or states are not finite, s
        self._known: float | None = None  # time of the last state around which the motion was known, s
        self._sparse = False  # whether the motion was unknown for too long
        self._board = board
        board.observe(self._see)

    def _see(self, stamp: float, state: ExtendedState) -> None:
        """Keep a state. Called in the thread of the connection."""
        positions = np.radians(state.values(Field.JOINT_POSITIONS)[self._heavy])
        self._states.append(_Seen(stamp, positions, state.values(Field.JOINT_VELOCITIES)))

    def close(self) -> None:
        """Stop observing the board, and close the port of the sensor."""
        self._board.unobserve(self._see)
        self.forces.close()

    @property
    def source(self) -> str:
        """The port of the sensor."""
        return self.forces.source

    def detect(self, limit: float) -> DetectedContact | None:
        """Return a contact, once: when the force has changed by more than ``limit`` N beyond what the motion explains.

        Raises NoForcesError if the sensor is missing or has fallen silent.
        """
        self._check_silence()
        now, samples = self._newest_sample(), self._samples
        self._check_gaps(now)
        if now is None or not self._is_finite(now):
            return None
        if samples and now.time < samples[-1].time - _JUMP:  # the clock was set
            samples.clear()
            self._free = None
        if samples and now.time <= samples[-1].time:
            return None  # nothing new
        while samples and samples[0].time < now.time - WITHIN:
            samples.popleft()
        samples.append(now)
        # The end of a contact is not another one: the force returns to what it was before.
        if self._free is not None and self._unexplained(now, self._free) <= limit:
            self._free = None
            samples.clear()
        before = samples[0] if samples else now
        force = self._unexplained(now, before)
        if force <= limit or self._is_releasing(now, before):
            return None
        self._free = self._free or before
        # The later samples also show the joints that the contact moved.
        early = islice(samples, (len(samples) + 1) // 2)
        speeds = np.mean([sample.speeds for sample in early], axis=0)
        samples.clear()
        return DetectedContact(force, speeds)

    def _is_releasing(self, now: _Sample, before: _Sample) -> bool:
        """Whether a contact ends: the force is returning to its value before the contact."""
        if self._free is None:
            return False
        free = self._free.force
        return float(np.linalg.norm(now.force - free)) < float(np.linalg.norm(before.force - free))

    def limitation(self, limit: float) -> str:
        """Return why a contact may need clearly more than ``limit`` N to be detected; "" if it does not."""
        if self._sparse:
            return f"for {_SILENT:g} s too many of its states were missing to know its motion"
        noise = self._inertial.noise
        # The noise of two samples adds up.
        return f"the noise of its speeds at rest is worth {noise:.0f} N" if 2 * noise > limit else ""

    def _check_silence(self) -> None:
        """Raise NoForcesError if the sensor has fallen silent; by the time of the states, as two clocks may differ."""
        if not self._states:
            return
        time, last = self._states[-1].time, next(iter(self.forces.newest(1)), None)
        if self._heard is None or last is not self._heard[0]:
            self._heard = last, time
        elif time - self._heard[1] > _SILENT:
            raise NoForcesError(f"nothing has come from {self.source} for {_SILENT:g} s")

    def _check_gaps(self, now: _Sample | None) -> None:
        """Note whether too many states are missing to know the motion, by the time of the states."""
        if not self._states:
            return
        time = self._states[-1].time
        if now is not None or self._known is None or time < self._known:
            self._known = time
        self._sparse = self._sparse or time - self._known > _SILENT

    def _is_finite(self, now: _Sample) -> bool:
        """Whether force and motion are finite numbers. Raises NoForcesError if they have not been for long."""
        felt = bool(np.isfinite(now.force).all())
        if felt and np.isfinite(now.inertial):
            self._invalid_since = None
            return True
        if self._invalid_since is None or now.time < self._invalid_since:
            self._invalid_since = now.time
        if now.time - self._invalid_since > _SILENT:
            what = "positions or speeds of its joints" if felt else f"the values of {self.source}"
            raise NoForcesError(f"{what} are not finite")
        return False

    def _unexplained(self, now: _Sample, before: _Sample) -> float:
        """Return the part of a change of force (N) that the motion of the joints cannot explain, at worst."""
        turned = self._load.weight * float(np.abs(now.positions - before.positions).sum())
        return float(np.linalg.norm(now.force - before.force)) - turned - now.inertial - before.inertial

    def _newest_sample(self) -> _Sample | None:
        """Return the newest sample for which both forces and states are known; None if there is none, and in a gap."""
        states = list(self._states)
        messages = self.forces.newest(_KEPT)
        if len(states) < _AVERAGED or len(messages) < _AVERAGED:
            return None
        times = [one.time for one in states]
        if messages[0].stamp.count < 0:
            raise NoForcesError(f"{self.source} sends no stamps")
        # One of the two streams may be behind the other; as a rule the first messages match, and no more are read.
        late = next((at for at, one in enumerate(messages) if one.stamp.time <= times[-1] - _KNOWN), None)
        if late is None or messages[late].stamp.time < times[0]:  # the clocks differ: take the newest of both
            near, taken = slice(-_AVERAGED, None), messages[:_AVERAGED]
            time = taken[0].stamp.time
        else:
            taken = messages[late : late + _AVERAGED]
            if len(taken) < _AVERAGED:
                return None
            stamps = [one.stamp.time for one in taken]
            time, begin = stamps[0], min(stamps) - _BEFORE
            gap = _gap(times, begin, time + _KNOWN)
            if gap > _GAP and gap > _PERIODS * statistics.median(np.diff(times).tolist()):
                return None
            near = slice(bisect_right(times, begin), bisect_right(times, time + _AFTER))
        _, low, high, _ = np.sort([one.values[:3] for one in taken], axis=0)
        speeds = np.array([one.speeds for one in states[near]])
        positions = np.array([one.positions for one in states[near]])
        inertial = self._inertial.bound(times[near], positions, np.radians(speeds[:, self._heavy]))
        return _Sample(time, 0.5 * (low + high), positions[-1], speeds[-1], inertial)


def _gap(times: Sequence[float], begin: float, end: float) -> float:
    """Return the longest time (s) between two states that touches a span; infinite if the states do not cover it."""
    first, last = bisect_right(times, begin) - 1, bisect_left(times, end)
    if not 0 <= first < last < len(times):
        return math.inf
    return max(after - before for before, after in pairwise(times[first : last + 1]))


def listen_to_forces(
    robot: RobotModel, place: str, *, network: Network, report: Callable[[str], None]
) -> Forces | None:
    """Connect to the force-torque sensor of the part whose port names begin with ``place``.

    None for a part that the robot's model gives no sensor with a load, and, with a report, if there is none.
    """
    port = force_port(robot, place)
    if port is None:
        return None
    try:
        return Forces(port, network=network)
    except NoForcesError as error:
        report(f"{place} is not watched for contacts: {error}")
        return None


def force_port(robot: RobotModel, place: str) -> str | None:
    """Return the sensor's port of a part whose port names begin with ``place``; None for a part without a sensor."""
    prefix, _, part = place.rpartition("/")
    sensor = robot.contact_sensor(part)
    return None if sensor is None else f"{prefix}/{sensor.port}{_SENSOR}"
