"""Kill workers, the scheduler and the client of a campaign at random, and see that every run has one result.

``python tests/torture/run_campaign_kills.py --runs 500 --workers 50 --schedulers 10 --clients 10``

With ``--backend dask`` a scheduler with TLS and two workers run beside the client; what is killed of them is started
again, as a service manager would. With ``--backend local`` the workers are the runners of the client.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

from rtf import clock
from rtf.campaigns.backends.certificates import write_certificates
from rtf.campaigns.store import CampaignStore, State

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

RTF = (sys.executable, "-m", "rtf", "campaign")
DASK = (sys.executable, "-m", "distributed.cli.dask_scheduler"), (sys.executable, "-m", "distributed.cli.dask_worker")
TRIVIAL = """
from rtf.testing import TestCase

class Trivial(TestCase):
    def run(self):
        self.check(True, "holds")
"""
#: A run is hit by chance several times; only one that kills its worker each time is a finding.
CAMPAIGN = """
schema = 1
name = "kills"
seeds = {runs}
attempts = 20
[[tests]]
name = "trivial.py"
"""
CLUSTER = """
[backend]
kind = "dask"
address = "tls://127.0.0.1:{port}"
[backend.tls]
authority = "{certificate}"
certificate = "{certificate}"
key = "{key}"
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign; 0 if every run has one result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--backend", choices=("local", "dask"), default="dask")
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--workers", type=int, default=50, help="how many workers are killed")
    parser.add_argument("--schedulers", type=int, default=10, help="likewise")
    parser.add_argument("--clients", type=int, default=10, help="likewise")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    kills = ["worker"] * options.workers + ["client"] * options.clients
    kills += ["scheduler"] * (options.schedulers if options.backend == "dask" else 0)
    random.Random(options.seed).shuffle(kills)
    with tempfile.TemporaryDirectory(prefix="rtf-kills-") as folder:
        bench = Bench(Path(folder), options.runs, cluster=options.backend == "dask")
        try:
            result = bench.torture(kills)
        finally:
            bench.close()
    print(result)
    print(", ".join(f"{count} of a {what}" for what, count in bench.killed.items()))
    return int("each once, after" not in result)


class Bench:
    """The processes of a campaign, which are started again when they end."""

    def __init__(self, folder: Path, runs: int, *, cluster: bool) -> None:
        self._folder, self._runs, self._cluster = folder, runs, cluster
        (folder / "trivial.py").write_text(TRIVIAL)
        text = CAMPAIGN.format(runs=runs)
        self._tls: list[str] = []
        if cluster:
            certificate, key = write_certificates(folder / "keys")
            with closing(socket.socket()) as probe:
                probe.bind(("127.0.0.1", 0))
                self._port = probe.getsockname()[1]
            text += CLUSTER.format(port=self._port, certificate=certificate, key=key)
            self._tls = ["--tls-ca-file", str(certificate), "--tls-cert", str(certificate), "--tls-key", str(key)]
        (folder / "campaign.toml").write_text(text)
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self.killed: Counter[str] = Counter()

    def torture(self, kills: Sequence[str]) -> str:
        """Run the campaign with these kills, spread over it; return what came of it."""
        left = [*kills]
        while True:
            self._keep_running()
            client = self._processes["client"]
            done = self._done()
            due = len(kills) - len(left) < len(kills) * done / self._runs
            if left and due and self._kill(left[-1]):
                left.pop()
            if client.poll() == 0:  # the campaign is done; what is left of the kills came too late
                return self._result()
            clock.sleep(0.05)

    def _keep_running(self) -> None:
        for name, words in self._commands().items():
            process = self._processes.get(name)
            if process is None or (process.poll() is not None and not (name == "client" and process.returncode == 0)):
                with (self._folder / f"{name}.log").open("ab") as log:
                    self._processes[name] = subprocess.Popen(
                        words, cwd=self._folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log
                    )

    def _commands(self) -> dict[str, list[str]]:
        commands = {"client": [*RTF, "campaign.toml"]}
        if self._cluster:
            place = f"tls://127.0.0.1:{self._port}"
            scheduler = [*DASK[0], "--host", place, "--no-dashboard", *self._tls]
            worker = [*DASK[1], place, "--nworkers", "2", "--nthreads", "1", "--no-dashboard", *self._tls]
            worker += ["--local-directory", str(self._folder / "work"), "--death-timeout", "20"]
            commands = {"scheduler": scheduler, "workers": worker} | commands
        return commands

    def _kill(self, what: str) -> bool:
        """Kill one process of this kind with SIGKILL; return whether there was one."""
        found = [*self._victims(what)]
        if not found:
            return False
        victim = random.choice(found)
        try:
            victim.send_signal(signal.SIGKILL)
        except psutil.NoSuchProcess:
            return False
        self.killed[what] += 1
        return True

    def _victims(self, what: str) -> Iterator[psutil.Process]:
        owners = {"worker": "workers" if self._cluster else "client"}
        owner = self._processes[owners.get(what, what)]
        if owner.poll() is not None:
            return
        process = psutil.Process(owner.pid)
        if what != "worker":
            yield process
            return
        try:
            yield from (child for child in process.children() if not self._cluster or _is_worker(child))
        except psutil.NoSuchProcess:
            return

    def _done(self) -> int:
        path = self._folder / "campaign.sqlite"
        if not path.exists():
            return 0
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=10.0)) as connection:
            try:
                return int(connection.execute("SELECT count(*) FROM tasks WHERE state = 'done'").fetchone()[0])
            except sqlite3.OperationalError:  # it is being made
                return 0

    def _result(self) -> str:
        with CampaignStore(self._folder / "campaign.sqlite") as store:
            counts, seeds = store.counts(), [one.seed for one in store.outcomes()]
            runs = len(store.runs())
        once = sorted(seeds) == [*range(self._runs)] and counts == {State.DONE: self._runs} and runs == self._runs
        how = "each once" if once else f"NOT each once: {dict(counts)}, {runs} runs in the history"
        return f"{self._runs} runs, {len(seeds)} results, {how}, after {self.killed.total()} kills"

    def close(self) -> None:
        """End everything that was started here."""
        for process in reversed(self._processes.values()):
            process.terminate()
        for process in self._processes.values():
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if os.environ.get("RTF_KEEP_LOGS"):
            for log in self._folder.glob("*.log"):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-4000:]}")


def _is_worker(process: psutil.Process) -> bool:
    """Return whether a child of the command that starts workers is one: it has a helper that keeps its semaphores."""
    return "spawn_main" in " ".join(process.cmdline())


if __name__ == "__main__":
    sys.exit(main())
