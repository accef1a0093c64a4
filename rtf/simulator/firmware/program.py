"""The program of the emulated boards: the robot in real time, its buses as buses of python-can, signals and end."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rtf import clock
from rtf.errors import RtfError
from rtf.robot.devices.can.bus_settings import GROUPS, BusSettings
from rtf.robot.interface.network_program import say
from rtf.robot.interface.signals import signal_listener
from rtf.simulator.firmware.boards_on_buses import Firmware
from rtf.simulator.firmware.bridge import Bridge
from rtf.simulator.firmware.robot_files import robot_files
from rtf.simulator.plant import Options, build
from rtf.simulator.robot_sensors import RobotSensors
from rtf.simulator.simulation import Simulation

if TYPE_CHECKING:
    import signal
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.robot.model import RobotModel

FINE, FAILED = 0, 1
#: Simulated seconds between two looks whether the program is to end.
_STRIDE = 0.05


@dataclass(frozen=True, slots=True)
class BoardsProgram:
    """What the command line says. ``channel`` with ``{}``: the place of the number of each bus.

    With ``udp_multicast`` and ``datagrams``, whose channel is a group, buses have the ports from ``port`` on instead.
    """

    model: RobotModel
    interface: str
    channel: str
    port: int
    parts: tuple[str, ...] = ()  # all
    seed: int = 0
    unit: int = 0
    drives: tuple[str, ...] = ()

    def buses(self, names: list[str]) -> Iterator[tuple[str, BusSettings]]:
        """Yield the settings of each bus, by its name."""
        for number, name in enumerate(names):
            settings = BusSettings(self.interface, self.channel.replace("{}", str(number)))
            if self.interface in GROUPS:
                settings = replace(settings, options=(("port", self.port + number),))
            yield name, settings

    def build(self) -> tuple[Simulation, Firmware]:
        """Build the robot with its boards. Raises SimulatorError."""
        simulation = Simulation(build(self.model, Options(unit=self.unit)), seed=self.seed, factor=1.0)
        return simulation, Firmware(simulation, self.parts or None, RobotSensors(simulation), self.drives)


def write_files(program: BoardsProgram, folder: Path) -> int:
    """Write the configuration of the drivers of the boards; return the exit code."""
    try:
        files = robot_files(program.build()[1])
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
    except (RtfError, OSError) as error:
        say(f"FAILED: the files of {program.model.name} could not be written: {error}")
        return FAILED
    say(f"{folder}: {', '.join(files)}")
    return FINE


def run_boards(program: BoardsProgram) -> int:
    """Run the boards until a signal ends them; return the exit code. To be called in the main thread."""
    end = threading.Event()

    def on_signal(number: signal.Signals) -> None:
        say(f"{number.name}: ends")
        end.set()

    began = clock.monotonic()
    with signal_listener(on_signal), ExitStack() as opened:
        try:
            simulation, firmware = program.build()
            for name, settings in program.buses(list(firmware.wires)):
                bridge = Bridge(firmware.wires[name], settings, simulation, _warn)
                opened.callback(bridge.close)
                boards = [board for board in firmware.all_boards if board.wire is bridge.wire]
                addresses = ", ".join(f"{board.address} {board.board_type.name}" for board in boards)
                say(f"{name}: {settings.name} {dict(settings.options) or ''}: boards {addresses}")
        except (RtfError, OSError) as error:
            say(f"FAILED: the boards of {program.model.name} could not be started: {error}")
            return FAILED
        took = clock.monotonic() - began
        say(f"READY in {took:.2f} s: boards {len(firmware.all_boards)}, buses {len(firmware.wires)}")
        while not end.is_set():
            simulation.advance(simulation.now + _STRIDE)
    return FINE


def _warn(sentence: str) -> None:
    say(f"[WARNING] {sentence}")
