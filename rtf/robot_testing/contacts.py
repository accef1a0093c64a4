"""Contacts: a limb that runs into something shows it at its force-torque sensor.

What a limb weighs shows there, too, and changes as the limb turns; and what hastens, slows down or swings presses on
it. So it does not count by how much the force changes, but what is left of that beyond what the measured motion can
explain: next to nothing while a limb is free, however fast it moves, starts, stops or falls, and more and more while
something holds it. Arms and legs have a sensor; it feels what happens beyond it, so not the upper arm or the hip.
"""

from __future__ import annotations

import re
from collections import deque
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.errors import RtfError
from rtf.middleware import remote
from rtf.middleware.names import Contact
from rtf.middleware.port import Port
from rtf.middleware.types import VECTOR, Stamp
from rtf.robot.errors import RobotError
from rtf.robot.extended_state import Field
from rtf.robot_testing.pressing import Load, Pressing

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rtf.middleware.incoming_message import IncomingMessage
    from rtf.middleware.network import Network
    from rtf.robot.client.control_board import RemoteControlBoard
    from rtf.robot.extended_state import ExtendedState
    from rtf.robot.interfaces import FloatArray

#: What is sent, each with its unit.
CHANNELS = {"force_x": "N", "force_y": "N", "force_z": "N", "torque_x": "Nm", "torque_y": "Nm", "torque_z": "Nm"}
_SENSOR = "/analog:o"
#: Messages that are kept, for who wants to know what led to a failure: some ten seconds.
_HISTORY = 1000
#: Time within which a force has to change, s. Touching something softly at 20 deg/s takes about as long to be felt.
WITHIN = 0.2
#: States from so long before the first of these, s, to so long after the last say what presses on the sensor: stamps
#: are not exact.
_BEFORE, _AFTER = 0.035, 0.025
#: A force is looked at when the states go on for so long after it, s. What is newer may be of what no state shows yet:
#: the simulated leg, stepped by 2 deg, pulls with 12 to 36 N more than the states up to 20 ms before explain.
_KNOWN = 0.015
#: Between states that are farther apart than this, s, and than so many usual periods, a limb may have done anything.
_GAP, _PERIODS = 0.025, 2.2
#: States that are kept, and messages that are looked through where they are behind.
_KEPT = 50
#: A sensor of which nothing comes for so long, s, while states do, is silent: it sends a hundred messages a second.
_SILENT = 1.0
#: Stamps that go back so far, s, are of a clock that was set.
_JUMP = 1.0
#: Forces of which the mean of the middle two counts: a single one that is wrong is no contact, and they last as long as
#: the states whose line explains them. A leg that is pushed off by all of its motor for 20 ms shows 80 N once or twice,
#: as it happens, and its states' line 50 N: of three forces the middle one was up to 28 N too much, these are 0.3 N.
_AVERAGED = 4
#: Joints that move next to nothing, whatever they do.
_LIGHT = re.compile(r"hand|thumb|finger|index|middle|ring|pinky|little")


#: By the last word of the part's name; from the model of the iCub, in which arms weigh 20.0 N and legs 46.4 N there.
_LOADS = {"arm": Load(20.0, 0.3), "leg": Load(46.5, 0.4)}


class NoForcesError(RobotError):
    """There is no sensor to listen to, or it is none."""


class Forces:
    """The last messages of a force-torque sensor, read when somebody wants to know. Raises NoForcesError."""

    def __init__(self, source: str, *, network: Network) -> None:
        self.source = source
        self._messages: deque[IncomingMessage] = deque(maxlen=_HISTORY)
        self._port = Port("", self._receive, network=network, outputs=False, nonblocking=True, promise=VECTOR.promise)
        try:
            # By tcp, whose sender waits: in lockstep nothing is on its way when the time goes on.
            remote.connect(network, Contact(source), Contact(self._port.name), "tcp")
        except RtfError as error:
            self._port.close()
            raise NoForcesError(str(error)) from error

    def _receive(self, delivery: IncomingMessage) -> None:
        """In the thread of the connection."""
        self._messages.append(delivery.kept())

    def newest(self, count: int) -> list[IncomingMessage]:
        """The last messages, the newest first."""
        # Copied in one step, for messages come meanwhile.
        return self.kept()[: -count - 1 : -1]

    def kept(self) -> list[IncomingMessage]:
        """All messages that are kept, the oldest first."""
        return list(self._messages)

    def rows(self, kept: Sequence[IncomingMessage]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What messages say: their numbers (-1 without a stamp), stamps (s), and forces (N) and torques (Nm).

        The last has a row a message. Raises NoForcesError when they are no six numbers each.
        """
        stamps = [stamp_of(delivery) for delivery in kept]
        return (
            np.array([float(stamp.count) for stamp in stamps]),
            np.array([stamp.time for stamp in stamps]),
            np.array([self.read(delivery) for delivery in kept]).reshape(-1, len(CHANNELS)),
        )

    def read(self, delivery: IncomingMessage) -> FloatArray:
        """The six numbers of a message. Raises NoForcesError for others."""
        try:
            values = delivery.read(VECTOR)
        except RtfError as error:
            raise NoForcesError(f"{self.source} sends no forces: {error}") from error
        if values.size != len(CHANNELS):
            raise NoForcesError(
                f"{self.source} sends {values.size} numbers, not the {len(CHANNELS)} of a force-torque sensor"
            )
        return np.asarray(values, dtype=np.float64)

    def close(self) -> None:
        """Hang up."""
        self._port.close()


def stamp_of(delivery: IncomingMessage) -> Stamp:
    """The stamp of a message; number -1 and time 0 where it has none."""
    return Stamp.parse(delivery.envelope) or Stamp()


class _Look(NamedTuple):
    """A moment: its time (s), the force (N), where joints were (rad), how fast (deg/s), and what may press so (N)."""

    time: float
    force: FloatArray
    positions: FloatArray
    speeds: FloatArray
    pressing: float


class Strike(NamedTuple):
    """A contact: the change of force that the motion does not explain (N), and how fast joints were before (deg/s)."""

    force: float
    speeds: FloatArray


class ContactWatch:
    """Watches a limb: ``look`` is called while it moves, from one thread. ``forces`` come from its ``force_port``."""

    def __init__(self, board: RemoteControlBoard, forces: Forces) -> None:
        self.forces = forces
        self._load = _LOADS[_limb(forces.source.removesuffix(_SENSOR))]
        self._pressing = Pressing(self._load)
        self._heavy = np.array([not _LIGHT.search(name) for name in board.axis_names()])
        self._states: deque[tuple[float, ExtendedState]] = deque(maxlen=_KEPT)
        self._looks: deque[_Look] = deque()
        #: The last message, and the time of its state, s.
        self._heard: tuple[IncomingMessage | None, float] | None = None
        self._free: _Look | None = None  # how it was before it struck something that it may still touch
        self._strange_since: float | None = None  # since when forces or states are no numbers, s
        self._known: float | None = None  # the last state of which it was known what the limb did around it, s
        self._sparse = False  # whether that has long been not known
        self._board = board
        board.observe(self._see)

    def _see(self, stamp: float, state: ExtendedState) -> None:
        """In the thread of the connection."""
        self._states.append((stamp, state))

    def close(self) -> None:
        """Look at the board no more, and hang up the sensor."""
        self._board.unobserve(self._see)
        self.forces.close()

    @property
    def source(self) -> str:
        """The port of the sensor."""
        return self.forces.source

    def look(self, limit: float) -> Strike | None:
        """What it strikes, once a contact: whether the force has changed by more than ``limit`` N without a reason.

        Raises NoForcesError where the sensor is none, or has fallen silent.
        """
        self._listen()
        now, looks = self._now(), self._looks
        self._notice_gaps(now)
        if now is None or not self._are_numbers(now):
            return None
        if looks and now.time < looks[-1].time - _JUMP:  # what was before is of another time
            looks.clear()
            self._free = None
        if looks and now.time <= looks[-1].time:
            return None  # nothing new
        while looks and looks[0].time < now.time - WITHIN:
            looks.popleft()
        looks.append(now)
        # What lets go is no contact: the force becomes what it was before.
        if self._free is not None and self._unexplained(now, self._free) <= limit:
            self._free = None
            looks.clear()
        before = looks[0] if looks else now
        force = self._unexplained(now, before)
        if force <= limit or self._lets_go(now, before):
            return None
        self._free = self._free or before
        # The later ones are also of joints that the blow moved.
        early = islice(looks, (len(looks) + 1) // 2)
        speeds = np.abs([look.speeds for look in early]).mean(axis=0)
        looks.clear()
        return Strike(force, speeds)

    def _lets_go(self, now: _Look, before: _Look) -> bool:
        """Whether what it struck presses less than before: the force is on its way to what it was when it was free."""
        if self._free is None:
            return False
        free = self._free.force
        return float(np.linalg.norm(now.force - free)) < float(np.linalg.norm(before.force - free))

    def doubt(self, limit: float) -> str:
        """Why contacts may take clearly more than ``limit`` N to be felt; "" where they do not."""
        if self._sparse:
            return f"for {_SILENT:g} s so many of its states were missing that its motion was not known"
        noise = self._pressing.noise
        # Of two looks.
        return f"its speeds are noisy, at rest as if it pressed with {noise:.0f} N" if 2 * noise > limit else ""

    def _listen(self) -> None:
        """Notice when nothing comes any more. By the states' time, as two clocks may differ."""
        if not self._states:
            return
        time, last = self._states[-1][0], next(iter(self.forces.newest(1)), None)
        if self._heard is None or last is not self._heard[0]:
            self._heard = last, time
        elif time - self._heard[1] > _SILENT:
            raise NoForcesError(f"nothing has come from {self.source} for {_SILENT:g} s")

    def _notice_gaps(self, now: _Look | None) -> None:
        """Notice when too many states are missing to say anything; by their time."""
        if not self._states:
            return
        time = self._states[-1][0]
        if now is not None or self._known is None or time < self._known:
            self._known = time
        self._sparse = self._sparse or time - self._known > _SILENT

    def _are_numbers(self, now: _Look) -> bool:
        """Whether force and motion are known. Raises NoForcesError where one of them has long not been."""
        felt = bool(np.isfinite(now.force).all())
        if felt and np.isfinite(now.pressing):
            self._strange_since = None
            return True
        if self._strange_since is None or now.time < self._strange_since:
            self._strange_since = now.time
        if now.time - self._strange_since > _SILENT:
            what = "places or speeds of its joints" if felt else f"what comes from {self.source}"
            raise NoForcesError(f"{what} are no numbers")
        return False

    def _unexplained(self, now: _Look, before: _Look) -> float:
        """What is left of a change of force (N) when all joints have done their worst together."""
        turned = self._load.weight * float(np.abs(now.positions - before.positions).sum())
        return float(np.linalg.norm(now.force - before.force)) - turned - now.pressing - before.pressing

    def _now(self) -> _Look | None:
        """The newest moment of which both forces and states are known; None before there is any, and in a gap."""
        states = list(self._states)
        messages = self.forces.newest(_KEPT)
        if len(states) < _AVERAGED or len(messages) < _AVERAGED:
            return None
        times = np.array([time for time, _ in states])
        if stamp_of(messages[0]).count < 0:
            raise NoForcesError(f"{self.source} sends no stamps")
        # One of the two streams may be behind the other; as a rule the first messages tell, and no more are read.
        late = next((at for at, one in enumerate(messages) if stamp_of(one).time <= times[-1] - _KNOWN), None)
        if late is None or stamp_of(messages[late]).time < times[0]:  # of clocks that differ: what came last has to do
            near, taken = range(len(states) - _AVERAGED, len(states)), messages[:_AVERAGED]
            time = stamp_of(taken[0]).time
        else:
            taken = messages[late : late + _AVERAGED]
            if len(taken) < _AVERAGED:
                return None
            stamps = [stamp_of(one).time for one in taken]
            time, begin = stamps[0], min(stamps) - _BEFORE
            gap = _gap(times, begin, time + _KNOWN)
            if gap > _GAP and gap > _PERIODS * float(np.median(np.diff(times))):
                return None
            near = range(*np.searchsorted(times, (begin, time + _AFTER), "right"))
        force = np.sort([self.forces.read(one)[:3] for one in taken], axis=0)[1:-1].mean(axis=0)
        speeds = np.array([states[at][1].values(Field.JOINT_VELOCITIES) for at in near])
        positions = np.radians([states[at][1].values(Field.JOINT_POSITIONS)[self._heavy] for at in near])
        pressing = self._pressing.most(times[near.start : near.stop], positions, np.radians(speeds[:, self._heavy]))
        return _Look(time, force, positions[-1], speeds[-1], pressing)


def _gap(times: FloatArray, begin: float, end: float) -> float:
    """The longest time (s) without a state that touches a span; infinite where the span is not within the states."""
    first, last = int(np.searchsorted(times, begin, "right")) - 1, int(np.searchsorted(times, end))
    return float(np.diff(times[first : last + 1]).max()) if 0 <= first < last < len(times) else np.inf


def listen_to_forces(place: str, *, network: Network, report: Callable[[str], None]) -> Forces | None:
    """The sensor of a limb; None for other parts, and, which is reported, where it has none."""
    port = force_port(place)
    if port is None:
        return None
    try:
        return Forces(port, network=network)
    except NoForcesError as error:
        report(f"{place} is not watched for contacts: {error}")
        return None


def force_port(place: str) -> str | None:
    """The port of the sensor of a part, of which ``place`` begins the names of the ports; None where it has none."""
    return f"{place}{_SENSOR}" if _limb(place) in _LOADS else None


def _limb(place: str) -> str:
    return place.rpartition("_")[2]
