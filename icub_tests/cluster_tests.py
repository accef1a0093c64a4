"""Cluster tests: the machines of a robot are set up for real-time programs and large messages."""

from __future__ import annotations

import re
import subprocess

from rtf.testing import Parameter, TestCase

#: What a host may be called, user included; nothing that ssh would take for an option.
_HOST = re.compile(r"(?:[\w.-]+@)?\w[\w.:-]*", re.ASCII)


class ClusterTests(TestCase):
    """Asks each machine through ssh for limits of real-time priorities and for the size of network buffers.

    ssh must be able to log in without being asked anything: a machine that wants a password is an error.
    """

    aliases = ("cluster-tests", "clusterTests", "cluster-tests.lua")
    tags = ("machine",)
    words_key = "hosts"  # where their names stand alone, as they did for the script of old

    hosts = Parameter(list[str], "names of the machines, user@host allowed", default=[])
    timeout_per_question = Parameter(float, "time that an answer may take", unit="s", default=10.0, low=0.1)
    priority = Parameter(int, "real-time priority that a process may have", default=99, low=0, high=99)
    receive_buffer = Parameter(int, "largest receive buffer of a socket", unit="B", default=8_388_608, low=0)

    def setup(self) -> None:
        """Refuse what is no host."""
        wrong = [host for host in self.hosts if not _HOST.fullmatch(host)]
        self.assert_error_if_true(wrong, f"{', '.join(map(repr, wrong))}: write a host as pc104 or icub@pc104")

    def run(self) -> None:
        """Ask machine by machine."""
        if not self.hosts:
            self.skip("no machines are named: --set 'hosts=(pc104 icub16)'")
        for host in self.hosts:
            with self.subresult(host):
                self._judge(host, "soft limit of the real-time priority", ("ulimit", "-S", "-r"), self.priority)
                self._judge(host, "hard limit of the real-time priority", ("ulimit", "-H", "-r"), self.priority)
                self._judge(
                    host, "largest receive buffer", ("cat", "/proc/sys/net/core/rmem_max"), self.receive_buffer, "B"
                )

    def _judge(self, host: str, name: str, command: tuple[str, ...], wanted: int, symbol: str = "") -> None:
        answer = self._answer(host, command)
        if answer == "unlimited":
            self.check(condition=True, text=f"{host}: the {name} is unlimited")
            return
        if not answer.isdigit():
            self.assert_error(f"{host} answers {' '.join(command)} with {answer[:60]!r}, which is no number")
        self.measure(name, int(answer), symbol, low=wanted)

    def _answer(self, host: str, command: tuple[str, ...]) -> str:
        """What a command prints there. Ends as an error when ssh cannot log in, or takes too long."""
        seconds = max(1, round(self.timeout_per_question))
        words = ["ssh", "-o", "BatchMode=yes", "-o", f"ConnectTimeout={seconds}", "--", host, *command]
        try:
            done = subprocess.run(
                words,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=self.timeout_per_question,
                check=False,
            )
        except FileNotFoundError:
            self.assert_error("there is no program ssh here; install the package openssh-client")
        except subprocess.TimeoutExpired:
            self.assert_error(f"{host} did not answer {' '.join(command)} within {self.timeout_per_question:g} s")
        if done.returncode != 0:
            why = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
            self.assert_error(f"{host}: {' '.join(command)} ended with {done.returncode}: {why[0]}")
        return done.stdout.strip()
