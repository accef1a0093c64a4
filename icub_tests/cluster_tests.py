"""Cluster tests: the machines of a robot are configured for real-time programs and large messages."""

from __future__ import annotations

import re
import subprocess

from rtf.testing import Parameter, TestCase

#: Valid host names, with an optional user; never an option of ssh.
_HOST = re.compile(r"(?:[\w.-]+@)?\w[\w.:-]*", re.ASCII)


class ClusterTests(TestCase):
    """Reads from each machine, through ssh, the limits of real-time priorities and the size of network buffers.

    ssh has to log in without interaction: a machine that asks for a password is an error.
    """

    aliases = ("cluster-tests", "clusterTests", "cluster-tests.lua")
    tags = ("machine",)
    words_key = "hosts"  # plain words are host names, as for the original script

    hosts = Parameter(list[str], "names of the machines, user@host allowed", default=[])
    timeout_per_question = Parameter(float, "time-out of an answer", unit="s", default=10.0, low=0.1)
    priority = Parameter(int, "real-time priority that a process may have", default=99, low=0, high=99)
    receive_buffer = Parameter(int, "largest receive buffer of a socket", unit="B", default=8_388_608, low=0)

    def setup(self) -> None:
        """Refuse invalid host names."""
        wrong = [host for host in self.hosts if not _HOST.fullmatch(host)]
        self.assert_error_if_true(wrong, f"{', '.join(map(repr, wrong))}: write a host as pc104 or icub@pc104")

    def run(self) -> None:
        """Check machine by machine."""
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
            self.assert_error(f"{host} answers {' '.join(command)} with {answer[:60]!r}, which is not a number")
        self.measure(name, int(answer), symbol, low=wanted)

    def _answer(self, host: str, command: tuple[str, ...]) -> str:
        """Return the output of a command on a host. The test ends with an error if ssh cannot log in, or times out."""
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
            self.assert_error("the program ssh was not found; install the package openssh-client")
        except subprocess.TimeoutExpired:
            self.assert_error(f"{host} did not answer {' '.join(command)} within {self.timeout_per_question:g} s")
        if done.returncode != 0:
            why = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
            self.assert_error(f"{host}: {' '.join(command)} ended with {done.returncode}: {why[0]}")
        return done.stdout.strip()
