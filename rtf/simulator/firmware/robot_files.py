"""The drivers of emulated boards as files of a robot interface, as the files of real robots have them.

A bus is a number. Interface and channel of all buses are parameters of the command line, so that the same files serve
boards in another process, on an interface of the machine, and in a simulated robot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from rtf.bottle import Bottle, Property, to_string
from rtf.robot.devices.can.bus_settings import MULTICAST, MULTICAST_PORT
from rtf.simulator.firmware.configuration import can_configuration, sensor_configuration
from rtf.simulator.simulated_sensors import SimulatedForceTorque, SimulatedImu
from rtf.simulator.skin import SimulatedSkin

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rtf.simulator.firmware.boards_on_buses import Firmware

_HEAD = """<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE devices PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
"""
#: The parameters of the bus that the command line may replace. The channel is that which is usual for the interface.
_EXTERNAL = {"interface": MULTICAST, "channel": '""', "port": MULTICAST_PORT}
#: The types of the iCub's files for those of ours that are one type there.
_TYPES = {"canBusStrain": ("canBusAnalogSensor", 6), "canBusMais": ("canBusAnalogSensor", 15)}


def robot_files(firmware: Firmware) -> dict[str, str]:
    """Return the files by their names: ``PART.xml`` for the boards of each part, and ``sensors.xml``, with servers.

    The board of a part is ``PART_board``, over the devices of its buses, which have the names of these.
    """
    files = {f"{part}.xml": _file(_part(firmware, part)) for part in firmware.part_wires}
    if firmware.sensors:
        files["sensors.xml"] = _file(_sensors(firmware))
    return files


def _file(devices: Iterable[str]) -> str:
    return f"{_HEAD}<devices>\n{''.join(devices)}</devices>\n"


def _part(firmware: Firmware, part: str) -> Iterator[str]:
    """Yield the devices of a part."""
    wires = firmware.wires_of(part)
    for wire in wires:
        yield _device(firmware, wire, "canBusMotionControl", can_configuration(firmware, wire), wire)
    boards = firmware.simulation.boards
    names = " ".join(boards.names[axis] for board in firmware.boards_of(part) for axis in board.axes)
    yield _over(f"{part}_board", "controlboardremapper", f'<param name="axesNames"> ({names}) </param>', wires)
    yield _server(f"{part}_server", "controlBoard_nws_yarp", part, "0.01", f"{part}_board")


def _sensors(firmware: Firmware) -> Iterator[str]:
    """Yield the devices of all sensors, and their servers."""
    force_torques = []
    for placed in firmware.sensors:
        kind, configuration = sensor_configuration(placed)
        sensor, name = placed.sensor, placed.key
        if kind in _TYPES:
            kind, channels = _TYPES[kind]
            configuration.put("channels", channels)
        if isinstance(sensor, SimulatedSkin):
            name += "_skin"
            servers = [("analogServer", sensor.settings.port, "20")]
        elif isinstance(sensor, SimulatedImu):
            servers = [("multipleanalogsensorsserver", name, "10"), ("inertial", name, "0.01")]
        else:
            servers = [("analogServer", f"{name}/analog:o", "10")]
            if isinstance(sensor, SimulatedForceTorque):
                name += "_ft"
                force_torques.append((sensor.name, name))
            else:
                name += "_angles"
        yield _device(firmware, name, kind, configuration, placed.wire)
        for number, (server, port, period) in enumerate(servers):
            yield _server(f"{name}_server{number or ''}", server, port, period, name)
    if force_torques:
        names = " ".join(name for name, _ in force_torques)
        listed = f'<param name="SixAxisForceTorqueSensorsNames"> ({names}) </param>'
        yield _over("fts", "multipleanalogsensorsremapper", listed, [device for _, device in force_torques])
        yield _server("fts_server", "multipleanalogsensorsserver", "FTs", "10", "fts")


def _over(name: str, kind: str, parameter: str, devices: list[str]) -> str:
    """Return a device that is attached to others."""
    attached = "".join(f'\n            <param name="{one}"> {one} </param>' for one in devices)
    return f"""    <device name="{name}" type="{kind}">
        {parameter}
        <action phase="startup" level="1" type="attach">
            <param name="networks"> ({" ".join(devices)}) </param>{attached}
        </action>
        <action phase="shutdown" level="7" type="detach"/>
    </device>
"""


def _server(name: str, kind: str, port: str, period: str, device: str) -> str:
    return f"""    <device name="{name}" type="{kind}">
        <param name="name"> ${{portprefix}}/{port} </param>
        <param name="period"> {period} </param>
        <action phase="startup" level="5" type="attach"> <param name="device"> {device} </param> </action>
        <action phase="shutdown" level="5" type="detach"/>
    </device>
"""


def _device(firmware: Firmware, name: str, kind: str, configuration: Property, wire: str) -> str:
    """Return a device on a bus."""
    lines: list[str] = []
    for key, group in configuration.items():
        inner = [one for one in group[1:] if isinstance(one, Bottle)]
        if len(inner) < len(group) - 1:
            lines.append(f"        {_parameter(key, Bottle(group[1:]))}")
            continue
        lines.append(f'        <group name="{key}">')
        if key == "CAN":
            inner = [one for one in inner if one[0] not in _EXTERNAL]
            lines += [
                f'            <param name="{what}" extern-name="{what}"> {value} </param>'
                for what, value in _EXTERNAL.items()
            ]
            number = list(firmware.wires).index(wire)
            inner += [Bottle(["CanDeviceNum", number]), Bottle(["busName", wire])]
        lines += [f"            {_parameter(str(one[0]), Bottle(one[1:]))}" for one in inner]
        lines.append("        </group>")
    body = "\n".join(lines)
    return f'    <device name="{name}" type="{kind}">\n{body}\n    </device>\n'


def _parameter(key: str, values: Bottle) -> str:
    words = " ".join(repr(one) if isinstance(one, float) else to_string(Bottle([one])) for one in values)
    return f'<param name="{key}"> {escape(words)} </param>'
