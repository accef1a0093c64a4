"""System status: this machine has enough CPU time, memory and disk space for a robot."""

from __future__ import annotations

import os
import secrets
import socket
import struct
from typing import TYPE_CHECKING

import psutil

from rtf import clock
from rtf.bottle import Bottle, to_string
from rtf.middleware.clocks.network_clock import CLOCK_VARIABLE, YARP_CLOCK_VARIABLE
from rtf.robot_testing.stream_test import StreamTest
from rtf.testing import Parameter, TestCase

if TYPE_CHECKING:
    from collections.abc import Mapping

_MIB = 1 << 20
#: Seconds from 1900, where the time of NTP begins, to 1970.
_NTP_BEGIN = 2_208_988_800
_NTP_PORT, _NTP_SIZE = 123, 48
_NTP_QUESTION = 0x23  # version 4, from a client
_NTP_ANSWER = 4  # from a server
_COUNTED = ("errin", "errout", "dropin", "dropout")
_ALL = 100.0  # %
_ANSWERS = 4  # of several answers the quickest is the most exact


class SystemStatus(TestCase):
    """Measures processors, memory, disk, temperatures, network and clock of this machine, each with a limit.

    It needs no robot. To test another machine, run it there. With a simulator's clock the load average is only
    recorded, unless a limit is given: no real robot depends on such a machine.
    """

    aliases = ("systemStatus", "system-status")
    tags = ("machine",)

    time = Parameter(float, "how long processors and network are watched", unit="s", default=1.0, low=0.1)
    hosts = Parameter(
        Bottle, "other machines: (port of yarprun, most load in %); they are not tested", default=Bottle(), key="hosts"
    )
    # Beyond 1 some process always waits for a processor.
    load = Parameter(float, "runnable processes for each processor, mean of a minute; 0: any", default=1.0, low=0.0)
    cpu = Parameter(float, "greatest load of one processor; 100: any", unit="%", default=100.0, low=0.0, high=100.0)
    cpu_mean = Parameter(float, "mean load of all of them; 100: any", unit="%", default=100.0, low=0.0, high=100.0)
    # 400 MiB of the 8 GiB of a robot's PC: the need of one more program.
    memory = Parameter(float, "least memory that is available", unit="%", default=5.0, low=0.0, high=100.0)
    # Used swap does no harm while memory is available; without free swap programs are killed.
    swap = Parameter(float, "most used swap space", unit="%", default=90.0, low=0.0, high=100.0)
    # The share that ext4 reserves for root: other users cannot write then.
    disk = Parameter(float, "least space that is free", unit="%", default=5.0, low=0.0, high=100.0)
    path = Parameter(str, "where on the disk; none: the folder of the run", default="")
    # At about 100 degC processors throttle.
    temperature = Parameter(float, "highest temperature of a sensor", unit="degC", default=90.0)
    network_errors = Parameter(int, "most errors of an interface during the test", default=0, low=0)
    time_server = Parameter(str, "an NTP server to compare the clock with; none: it is not compared", default="")
    # chrony and ntpd keep a few ms in a local network; stamps of two machines are to agree within some messages.
    clock_offset = Parameter(float, "greatest offset of the clock", unit="ms", default=50.0, low=0.0)

    def run(self) -> None:
        """Watch for a while, then judge each."""
        for host in StreamTest.lines(self.hosts):
            name, *limits = map(to_string, host)
            given = "".join(f" --set cpu_mean={limit}" for limit in limits[:1])
            with self.subresult(name):
                self.skip(
                    f"{name} is another machine, which is not tested; run there: testrunner --test SystemStatus{given}"
                )
        psutil.cpu_percent(percpu=True)  # the counting begins here
        before = psutil.net_io_counters(pernic=True)
        clock.sleep(self.time)
        loads = psutil.cpu_percent(percpu=True)
        after = psutil.net_io_counters(pernic=True)
        with self.subresult("processors"):
            self._judge_processors(loads)
        with self.subresult("memory"):
            self._judge_memory()
        with self.subresult("disk"):
            self._judge_disk(self.path or str(self.folder))
        with self.subresult("temperature"):
            self._judge_temperatures()
        with self.subresult("network"):
            self._judge_network(before, after)
        with self.subresult("clock"):
            self._judge_clock()

    def _judge_processors(self, loads: list[float]) -> None:
        busy = "this machine is overloaded; likely: a runaway program, or one that belongs on another machine"
        for number, load in enumerate(loads):
            self.measure(f"processor {number}", load, "%", high=_limit(self.cpu), hint=busy)
        self.measure("all processors", sum(loads) / len(loads), "%", high=_limit(self.cpu_mean), hint=busy)
        for minutes, load in zip((1, 5, 15), psutil.getloadavg(), strict=True):
            most = self._most_load(len(loads)) if minutes == 1 else None
            hint = f"{load:.1f} processes want to run on {len(loads)} processors: {busy}"
            self.measure(f"processes that want to run, mean of {minutes} min", load, "count", high=most, hint=hint)

    def _most_load(self, processors: int) -> float | None:
        """Return the greatest number of runnable processes; None for any."""
        simulated = any(os.environ.get(name) for name in (CLOCK_VARIABLE, YARP_CLOCK_VARIABLE))
        if not self.load or (simulated and self.parameter_source("load") == "default"):
            return None
        return self.load * processors

    def _judge_memory(self) -> None:
        memory, swap = psutil.virtual_memory(), psutil.swap_memory()
        self.measure("total memory", memory.total / _MIB, "MiB")
        leak = "programs will soon be killed for lack of memory; likely: a memory leak"
        self.measure("available memory", 100.0 * memory.available / memory.total, "%", low=self.memory, hint=leak)
        self.measure("used swap space", swap.percent, "%", high=self.swap, hint=leak)

    def _judge_disk(self, path: str) -> None:
        usage = psutil.disk_usage(path)
        hint = f"the disk of {path} fills up; likely: recordings, logs, and core dumps"
        self.measure("free space", 100.0 * usage.free / usage.total, "%", low=self.disk, hint=hint)

    def _judge_temperatures(self) -> None:
        sensors = psutil.sensors_temperatures() if hasattr(psutil, "sensors_temperatures") else {}
        found = [
            (f"{chip} {reading.label or number}", reading.current)
            for chip, readings in sensors.items()
            for number, reading in enumerate(readings)
        ]
        if not found:
            self.skip("this machine shows no temperatures")
        for name, current in found:
            hint = f"{name} is hot, and its chip will slow down; likely: dust, a fan that has stopped"
            self.measure(name, current, "degC", high=self.temperature, hint=hint)

    def _judge_network(self, before: Mapping[str, object], after: Mapping[str, object]) -> None:
        for name in sorted(set(before) & set(after)):
            counts = {field: getattr(after[name], field) - getattr(before[name], field) for field in _COUNTED}
            errors = counts["errin"] + counts["errout"]
            hint = f"{errors} packets of {name} had errors; likely: a cable, a connector, a wrong duplex mode"
            self.measure(f"errors of {name}", errors, "count", high=self.network_errors, hint=hint)
            # Systems also count unrequested packets as dropped.
            self.measure(f"packets that {name} dropped", counts["dropin"] + counts["dropout"], "count")

    def _judge_clock(self) -> None:
        if not self.time_server:
            self.skip("no time_server is given to compare the clock with")
        host, _, port = self.time_server.partition(":")
        try:
            answers = [_ask_time(host, int(port or _NTP_PORT)) for _ in range(_ANSWERS)]
        except (OSError, ValueError) as error:
            self.assert_error(f"the time server {self.time_server} gives no time: {error}")
        way, offset = min(answers)
        self.measure("way to the time server and back", way * 1e3, "ms")
        hint = f"the clock is not that of {self.time_server}; likely: no chrony or ntpd here, or another server"
        self.measure("clock is ahead by", -offset * 1e3, "ms", -self.clock_offset, self.clock_offset, hint=hint)


def _limit(percent: float) -> float | None:
    """Return the limit of a load; None for 100 %, which cannot be exceeded."""
    return percent if percent < _ALL else None


def _ask_time(host: str, port: int, timeout: float = 2.0) -> tuple[float, float]:
    """Ask an NTP server (RFC 5905, SNTP); return the round-trip time and the offset of the clock, both in s.

    Raises OSError, or ValueError for an invalid answer.
    """
    cookie = secrets.token_bytes(8)  # the server repeats it, which identifies its answer
    question = bytes([_NTP_QUESTION]) + bytes(_NTP_SIZE - 9) + cookie
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.settimeout(timeout)
        asking.connect((host, port))
        sent = clock.now()
        asking.send(question)
        answer = asking.recv(_NTP_SIZE)
        came = clock.now()
    if len(answer) < _NTP_SIZE or answer[0] & 7 != _NTP_ANSWER or answer[24:32] != cookie or answer[1] == 0:
        raise ValueError(f"{len(answer)} bytes that are no answer of an NTP server with a time")
    received, transmitted = (_ntp_time(answer, at) for at in (32, 40))
    return (came - sent) - (transmitted - received), ((received - sent) + (transmitted - came)) / 2


def _ntp_time(message: bytes, at: int) -> float:
    seconds, fraction = struct.unpack_from(">2I", message, at)
    return float(seconds - _NTP_BEGIN + fraction / (1 << 32))
