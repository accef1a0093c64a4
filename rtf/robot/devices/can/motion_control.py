"""The driver of motor boards on a CAN bus: boards that control joints, and boards that drive motors."""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf import clock
from rtf.bottle import Bottle
from rtf.robot.control_modes import REQUESTS, USER_MODES, ControlMode
from rtf.robot.devices.board_driver import BoardDriver
from rtf.robot.devices.can.axis_link import MODE_PATIENCE, NEVER
from rtf.robot.devices.can.axis_settings import CanSettings, can_settings
from rtf.robot.devices.can.bus import CanBus, Load, LoadMeter, share, unshare
from rtf.robot.devices.can.bus_settings import bus_settings
from rtf.robot.devices.can.codec import decode
from rtf.robot.devices.can.codes import FOC_BOARDS, JOINT_BOARDS, BoardMode
from rtf.robot.devices.can.exchange import PROTOCOL, Exchange, Version
from rtf.robot.devices.can.foc_link import BOARDS, FocLink
from rtf.robot.devices.can.joint_link import BROADCASTS, JointLink
from rtf.robot.devices.can.messages import HOST, MessageClass, Setting
from rtf.robot.devices.can.motor_messages import BROADCASTS as SET_BROADCASTS
from rtf.robot.devices.can.motor_messages import CONTROL_MODE, FOC_CONTROL_MODE, SETPOINTS
from rtf.robot.errors import BusError, DeviceError, MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.bottle import Property
    from rtf.robot.devices.board_axes import BoardAxis
    from rtf.robot.devices.board_driver import Setpoints
    from rtf.robot.devices.can.axis_link import AxisLink, Sent
    from rtf.robot.devices.can.codec import Decoded
    from rtf.robot.devices.can.messages import Frame, Message
    from rtf.robot.extended_state import ExtendedState

#: The codes of faults that are found here; those that a board reports begin at ``FIRST_FAULT`` with bit 0.
MODE_LOST, BOARD_RESET, BUS_LOST, FIRST_FAULT = 10, 11, 12, 20
#: Seconds after which a board that sends no positions counts as silent, and in which it sends the first ones.
SILENCE, FIRST_POSITIONS = 0.1, 1.0
#: Seconds between two setpoints for boards that answer setpoints with positions, while the first ones are awaited.
_SETPOINT_PERIOD = 0.01
#: Seconds that a calibration may take, and of the pause after it.
_CALIBRATION = (20.0, 0.01)
_UNCONFIGURED = frozenset({BoardMode.NOT_CONFIGURED, BoardMode.CONFIGURED})
#: Modes by their numbers, and one of boards: enumerations are slow to look up.
_MODES = {int(mode): mode for mode in ControlMode}
_CALIBRATING = BoardMode.CALIBRATING
#: What is measured, in the order of the fields of a state.
_measured = attrgetter(
    "position",
    "velocity",
    "acceleration",
    "motor_position",
    "motor_velocity",
    "motor_acceleration",
    "torque",
    "duty",
    "current",
)
#: Seconds between two measurements of the load.
_LOAD_PERIOD = 1.0
#: Seconds between two attempts to have silent boards send again.
_ASK_AGAIN = 0.5


class CanMotionControl(BoardDriver):
    """``canMotionControl``: the boards of a part, on one bus.

    The type of each board is that which it says. For the configuration see :mod:`rtf.robot.devices.can.axis_settings`,
    and :func:`rtf.robot.devices.can.bus_settings.bus_settings` for that of the bus.
    """

    plugin_name = "canMotionControl"
    calibration_time = _CALIBRATION

    def __init__(self) -> None:
        self._bus: CanBus | None = None
        self._exchange: Exchange | None = None
        self._meter: LoadMeter | None = None
        self._load = Load(0.0, 0.0)
        self._measured = NEVER
        self._ends: list[Callable[[], None]] = []
        self._broadcasts: dict[int, _Broadcast] = {}  # by identifier
        self._links: list[AxisLink] = []
        self._of_board: dict[int, list[AxisLink]] = {}
        self._warned: dict[int, tuple[str, ...]] = {}
        self._damaged = 0
        self._asked_again = NEVER
        self._restarted = False
        self._restarted_at: float | None = None  # s, while positions of boards that were reset are awaited
        self._patience = FIRST_POSITIONS  # seconds of silence, longer while boards are configured on a busy host
        self.versions: dict[int, Version] = {}

    # Connecting ------------------------------------------------------------------------------------------------------

    def connect(self, configuration: Property) -> list[BoardAxis]:
        """Open the bus, find the boards, and wait for their first positions."""
        settings = can_settings(configuration)
        self._links, self._patience = [], FIRST_POSITIONS
        self._bus = share(bus_settings(configuration), self.report)
        self._meter = LoadMeter(self._bus)
        self.lock = None if self._bus.threaded else self._bus.lock  # a simulation's: its loop calls the cycles
        try:
            exchange = self._exchange = Exchange(self._bus, settings.timeout, settings.retries)
            self.versions = {board: _version(exchange, board) for board in settings.boards}
            self._link(settings)
            self._claim(self._bus)
            self._begin(self._bus, exchange)
        except BaseException:
            self.disconnect()
            raise
        self.period, self.couplings = settings.period, settings.couplings
        return [one.axis for one in settings.axes]

    def _link(self, settings: CanSettings) -> None:
        """Make the links of the axes, of the types of their boards."""
        self._links, self._of_board, self._warned, self._damaged = [], {}, {}, 0
        self._broadcasts = {}
        self._restarted, self._restarted_at = False, None
        for one in settings.axes:
            scale = replace(one.scale, saturated=self._saturation(one.axis.name))
            drives = self.versions[one.board].board_type in FOC_BOARDS
            link = FocLink(one, scale) if drives else JointLink(one, scale)
            if drives and (one.board not in BOARDS or one.index):
                raise DeviceError(
                    f"board {one.board} cannot have {one.axis.name}: a board that drives a motor has one axis, and an "
                    "address from 1 to 4"
                )
            self._links.append(link)
            self._of_board.setdefault(one.board, []).append(link)
            for message, keep in link.kept.items():
                broadcast = self._broadcasts.setdefault(message.identifier(one.board), _Broadcast(message))
                broadcast.keep.append(partial(keep, link))
        self._drives = [link for link in self._links if isinstance(link, FocLink)]
        self.measures = frozenset.intersection(*(link.measured() for link in self._links))
        common = frozenset.intersection(*(link.supported() for link in self._links))
        self.supported = frozenset(REQUESTS) - (frozenset(USER_MODES) - common)

    def _claim(self, bus: CanBus) -> None:
        """Reserve the axes, and the setpoints of drives, which are one frame for all. Raises DeviceError."""
        axes = [f"axis {link.index} of board {link.board}" for link in self._links]
        try:
            bus.claim(self, *axes, *(["the setpoints of the drives"] if self._drives else []))
        except DeviceError:
            self._links = []  # which are not this device's to switch off
            raise

    def _saturation(self, name: str) -> Callable[[str, float, int], None]:
        """Return what reports values that do not fit into messages, each kind once."""
        reported: set[str] = set()

        def saturated(what: str, value: float, limit: int) -> None:
            if what not in reported:
                reported.add(what)
                self.report(f"{name}: the {what} of {value:.6g} does not fit into a message; {limit} is sent")

        return saturated

    def _begin(self, bus: CanBus, exchange: Exchange) -> None:
        """Receive what the boards send, and wait for the first positions and the modes."""
        kind = MessageClass.MOTOR_PERIODIC << 8
        numbers = [kind | board << 4 | code for board in self._of_board for code in range(16)]
        answers = [board << 4 for board in self._of_board]
        bus.on_restart.append(self._note_restart)
        for number, broadcast in self._broadcasts.items():
            broadcast.seen = bus.traffic[number].latest if number in bus.traffic else None
        self._ends = [
            bus.subscribe(None, numbers),
            bus.subscribe(self._take_answer, answers),
            lambda: bus.on_restart.remove(self._note_restart),
        ]
        for link in self._links:
            if isinstance(link, JointLink):
                bus.send(SET_BROADCASTS.frame(link.board, BROADCASTS))
            exchange.ask(link.mode_question, link.board, axis=link.index)
        if clashes := exchange.clashes():
            raise DeviceError(
                f"two boards on {bus.name} have the address {', '.join(map(str, clashes))}: disconnect one, and give "
                "it another one"
            )
        patience = max(FIRST_POSITIONS, exchange.timeout)  # boards that may answer late may be late in this, too
        deadline = clock.Deadline.after(patience)
        while any(link.feedback.stamp == NEVER for link in self._links):
            if deadline.expired:
                silent = sorted({link.board for link in self._links if link.feedback.stamp == NEVER})
                raise DeviceError(
                    f"the boards {silent} on {bus.name} send no positions within {patience:g} s of the start"
                )
            self._send_setpoints([0] * len(BOARDS))
            if bus.threaded:
                clock.sleep(_SETPOINT_PERIOD)
            else:
                bus.poll(_SETPOINT_PERIOD)
            self._take_latest(bus)

    def disconnect(self) -> None:
        """Switch the motors off, have the boards send nothing more, and give the bus back."""
        bus, self._bus = self._bus, None
        if bus is None:
            return
        try:
            bus.send(*(frame for link in self._links for frame in link.request(ControlMode.IDLE, NEVER)))
            bus.send(*(SET_BROADCASTS.frame(link.board, 0) for link in self._links if isinstance(link, JointLink)))
        except BusError as error:
            self.report(f"the motors are not switched off: {error}")
        for end in self._ends:
            end()
        self._ends = []
        if self._exchange is not None:
            self._exchange.close()
        self._exchange = None
        bus.disclaim(self)
        unshare(bus)

    # Receiving -------------------------------------------------------------------------------------------------------

    def _take_answer(self, frame: Frame, stamp: float) -> None:
        """Keep the mode that a board answers. Called by the thread of the bus."""
        del stamp
        links = self._of_board[frame.identifier >> 4]
        got = self._decoded(frame, links)
        if got is not None and got.message in (CONTROL_MODE.value, FOC_CONTROL_MODE.value):
            for link in links:
                if link.index == got.axis:
                    link.feedback.mode = int(got.values[0])

    def _decoded(self, frame: Frame, links: list[AxisLink]) -> Decoded | None:
        """Return the message of a frame of the board of some axes; None, which is reported once, if there is none."""
        try:
            return decode(*frame, links[0].dialect)
        except MessageError as error:
            self._damaged += 1
            if self._damaged == 1:
                self.report(f"{error} (the first of such frames; they are counted and ignored)")
            return None

    def _take_latest(self, bus: CanBus) -> None:
        """Keep the latest broadcasts of each kind, if they are new: those between two calls do not count."""
        traffic = bus.traffic
        for identifier, broadcast in self._broadcasts.items():
            found = traffic.get(identifier)
            if found is None or found.latest is broadcast.seen:
                continue
            broadcast.seen = (_, data), stamp = found.latest
            try:
                values = broadcast.unpack(data)
            except struct.error:
                self._decoded(found.latest[0], self._of_board[identifier >> 4 & 0xF])  # which says what is wrong
                continue
            for keep in broadcast.keep:
                keep(values, stamp)

    def read(self, state: ExtendedState) -> None:
        bus = self._connected()
        if not bus.threaded:
            while bus.poll():
                pass
        self._take_latest(bus)
        now = self.time()
        self._follow_restart(bus, now)
        state.floats[...] = np.array([_measured(link.feedback) for link in self._links]).T
        state.temperatures[:] = [link.feedback.temperature for link in self._links]
        for axis, link in enumerate(self._links):
            if link.feedback.mode == link.wanted and link.wanted is not _CALIBRATING:
                link.settles = NEVER
            else:
                self._check_mode(axis, link, now)
            if link.feedback.warnings != self._warned.get(link.board, ()):
                self._warned[link.board] = link.feedback.warnings
                self.report(
                    f"board {link.board} reports: {', '.join(link.feedback.warnings) or 'no warnings any more'}"
                )
        if self._meter is not None and now - self._measured >= _LOAD_PERIOD:
            self._measured, self._load = now, self._meter.load()
        self._check_silence(bus, now)

    def variables(self) -> dict[str, Bottle]:
        """Return ``canBoards``, what each board is, and ``canBus``, the load of the bus and what has happened on it.

        A board is its address, type, firmware, protocol, and errors of transmission and reception; the bus is pairs of
        a name and a number, with the load as a share of its bits in the latest second. ``canAxes`` has the name of each
        axis, the channel of its bus, the address of its board and its place there; ``canSettings`` has channel, board,
        place and name of each setting that the boards can be asked for, and the numbers that were sent.
        """
        bus = self._bus
        if bus is None:
            return {}
        errors = {link.board: link.feedback.errors for link in self._links}
        boards = [
            Bottle(
                [
                    number,
                    one.type_name,
                    one.firmware_text,
                    ".".join(map(str, one.protocol)),
                    *errors.get(number, (0, 0)),
                ]
            )
            for number, one in self.versions.items()
        ]
        counted = {"load": self._load.share, "rate": self._load.rate, **asdict(bus.counters)}
        pairs = [Bottle([name, number]) for name, number in counted.items()]
        channel = bus.settings.channel
        places = [Bottle([link.settings.axis.name, channel, link.board, link.index]) for link in self._links]
        settings = [
            Bottle([channel, link.board, link.index, what.set.name, *values])
            for axis, link in enumerate(self._links)
            for what, values in link.all_settings(self.board, axis)
            if isinstance(what, Setting)
        ]
        return {
            "canBoards": Bottle(boards),
            "canBus": Bottle([Bottle(["name", bus.name]), *pairs]),
            "canAxes": Bottle(places),
            "canSettings": Bottle(settings),
        }

    def stamp(self, now: float) -> float:
        """Return the mean time of the frames with the latest positions."""
        stamps = [link.feedback.stamp for link in self._links]
        return min(sum(stamps) / len(stamps), now)

    def _check_silence(self, bus: CanBus, now: float) -> None:
        patience = self._patience
        silent = sorted({link.board for link in self._links if now - link.feedback.stamp > patience})
        if not silent:
            self._patience = SILENCE
            return
        off = ", which is off" if bus.off else ""
        if not bus.off and now - self._asked_again > _ASK_AGAIN:
            self._asked_again = now
            self._ask_again(bus, silent)
        elif not bus.off:
            self._send_setpoints([0] * len(BOARDS))  # drives that speak stand still, and go on to speak
        raise DeviceError(f"the boards {silent} on {bus.name}{off} have sent no positions for more than {patience:g} s")

    def _note_restart(self) -> None:
        """Take note that the boards have been reset on purpose. May be called from any thread."""
        self._restarted = True

    def _follow_restart(self, bus: CanBus, now: float) -> None:
        """Have boards that were reset send positions, and start again once there are some of all axes."""
        if self._restarted:
            self._restarted, self._restarted_at = False, now
            for link in self._links:
                link.feedback.stamp, link.settles = now, now + MODE_PATIENCE
            self._ask_again(bus, [*self._of_board])
        elif self._restarted_at is not None and all(link.feedback.stamp > self._restarted_at for link in self._links):
            self._restarted_at = None
            self.board.restart()

    def _ask_again(self, bus: CanBus, silent: list[int]) -> None:
        """Have boards send positions again that may have been reset; what was set may be lost."""
        for link in self._links:
            if link.board in silent:
                link.forget()
                if isinstance(link, JointLink):
                    bus.send(SET_BROADCASTS.frame(link.board, BROADCASTS))
                    bus.send(link.mode_question.get.frame(link.board, axis=link.index))
        self._send_setpoints([0] * len(BOARDS))  # which drives answer, with their modes and faults

    def _check_mode(self, axis: int, link: AxisLink, now: float) -> None:
        """Put an axis into fault whose board reports one, or is not in the mode that was requested."""
        reported, shown = link.feedback.mode, self.board.mode[axis]
        if shown == ControlMode.CALIBRATING and link.wanted is BoardMode.CALIBRATING:
            self._check_calibration(axis, link, reported, now)
        if reported == link.wanted:
            link.settles = NEVER
        if reported == link.wanted or now < link.settles:
            return
        if shown == ControlMode.HARDWARE_FAULT:
            self._switch_off(link, reported, now)
            return
        known = BoardMode(reported).name.lower().replace("_", " ") if reported in set(BoardMode) else f"{reported:#x}"
        wanted = link.wanted.name.lower().replace("_", " ")
        if reported == BoardMode.HARDWARE_FAULT:
            self.board.fault(axis, FIRST_FAULT + link.first_fault, f"board {link.board} reports {link.fault_names()}")
        elif reported in _UNCONFIGURED:
            self.board.fault(axis, BOARD_RESET, f"board {link.board} was reset: it is {known}")
        elif shown != ControlMode.CALIBRATING:
            self.board.fault(axis, MODE_LOST, f"board {link.board} is in the mode {known} instead of {wanted}")

    def _switch_off(self, link: AxisLink, reported: int, now: float) -> None:
        """Ask a board again to switch off an axis in fault, if it still has power, as the request may be lost."""
        if reported != BoardMode.HARDWARE_FAULT and reported not in _UNCONFIGURED and self._bus is not None:
            with suppress(BusError):  # until the bus is on again
                self._bus.send(*link.request(ControlMode.HARDWARE_FAULT, now))

    def _check_calibration(self, axis: int, link: AxisLink, reported: int, now: float) -> None:
        """End the calibration of an axis, once its board has ended its own."""
        if reported != BoardMode.CALIBRATING and now >= link.settles and reported != BoardMode.HARDWARE_FAULT:
            self.board.end_calibration(axis)

    # Sending ---------------------------------------------------------------------------------------------------------

    def write(self, setpoints: Setpoints, modes: NDArray[np.int32]) -> None:
        bus, now, board = self._connected(), self.time(), self.board
        frames: dict[int, Frame] = {}
        words = [0] * len(BOARDS)
        for axis, (link, mode) in enumerate(zip(self._links, map(_MODES.__getitem__, modes.tolist()), strict=True)):
            if isinstance(link, FocLink):
                words[link.board - 1] = link.word(mode, setpoints, axis)
            elif isinstance(link, JointLink):
                frame = link.setpoint(mode, board, setpoints, axis, now)
                if frame is not None:
                    frames[axis] = frame
        try:
            bus.send(*frames.values())
        except BusError as error:
            for axis in frames:  # a setpoint is not sent later, when nobody expects it any more
                self.board.fault(axis, BUS_LOST, f"its setpoint is lost: {error}")
            raise
        self._send_setpoints(words)

    def _send_setpoints(self, words: list[int]) -> None:
        """Send the setpoints of the boards that drive motors, up to the last of them."""
        if self._drives:
            last = max(link.board for link in self._drives)
            self._connected().send(SETPOINTS[last - 1].frame(HOST, *words[:last]))

    def configure(self, axis: int) -> None:
        bus, link, mode = self._connected(), self._links[axis], ControlMode(int(self.board.mode[axis]))
        if mode is ControlMode.HARDWARE_FAULT:
            self._enter(axis, link, mode)
            return
        if link.feedback.mode in _UNCONFIGURED and link.verified:
            link.forget()
        changed = link.changed_settings(self.board, axis)
        try:
            bus.send(*(frame for _, _, frame in changed))
        except BusError:
            link.forget()
            raise
        if not link.verified:
            self._verify(link, [(what, values) for what, values, _ in changed])
            link.verified = True
        if mode is not link.mode:
            self._enter(axis, link, mode)

    def _enter(self, axis: int, link: AxisLink, mode: ControlMode) -> None:
        """Request a mode of a board, or a calibration."""
        bus, now = self._connected(), self.time()
        frames = link.request(mode, now)
        if isinstance(link, JointLink):
            link.begin(self.board, axis)
            if mode is ControlMode.CALIBRATING:
                frames = [link.calibrate(self.board, axis)]
        if mode is ControlMode.HARDWARE_FAULT:
            with suppress(BusError):  # it is repeated until the board has no power
                bus.send(*frames)
        elif mode is not ControlMode.CALIBRATION_DONE:
            bus.send(*frames)

    def _verify(self, link: AxisLink, sent: list[Sent]) -> None:
        """Read settings back. Raises DeviceError for one that the board has not taken."""
        self._send_setpoints([0] * len(BOARDS))  # so that drives, which have no power yet, go on to send positions
        for what, values in sent:
            if isinstance(what, Setting) and self._exchange is not None:
                got = self._exchange.ask(what, link.board, axis=link.index, dialect=link.dialect)
                if tuple(got) != tuple(values):
                    name = f"{link.settings.axis.name}: board {link.board}"
                    raise DeviceError(f"{name} has not taken {what.set.name}: it has {got}, not {values}")

    def _connected(self) -> CanBus:
        if self._bus is None:
            raise DeviceError("the boards are not connected")
        return self._bus


class _Broadcast:
    """A message that a board sends by itself: how it is unpacked, what keeps it, and the frame that was kept last."""

    def __init__(self, message: Message) -> None:
        (layout,) = message.structs.values()
        self.unpack = layout.unpack
        self.keep: list[Callable[[tuple[Any, ...], float], None]] = []
        self.seen: tuple[Frame, float] | None = None


def _version(exchange: Exchange, board: int) -> Version:
    """Return the version of a board. Raises DeviceError for a board that cannot be driven."""
    found = exchange.version(board)
    name = f"board {board} on {exchange.bus.name}"
    if found.board_type not in FOC_BOARDS | JOINT_BOARDS:
        raise DeviceError(f"{name} is no motor board but a {found.type_name}; look at CanAddresses")
    if not found.acknowledged:
        spoken, own = (".".join(map(str, one)) for one in (found.protocol, PROTOCOL))
        raise DeviceError(f"{name} speaks version {spoken} of the protocol, not {own}; update its firmware")
    return found
