"""The backend that runs tasks on a cluster of Dask: of a scheduler, or of a cluster object that the file names.

Workers run :func:`rtf.campaigns.task_run.run_task` by its name, on bytes; a real robot is a resource of its one worker
(``dask worker --resources "icub01=1"``). Where the cluster is this campaign's own, a task whose worker died comes back
to the client, which counts; a scheduler of others tries it again by itself as often as it is configured to.

A peer with the cluster's key may run any code: that is how Dask works. So connections beyond this machine need TLS.
"""

from __future__ import annotations

import ipaddress
from concurrent.futures import CancelledError
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from rtf import clock
from rtf.campaigns.backends import worker_setup
from rtf.campaigns.backends.backend import Backend, BackendLostError
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.task_run import Status, TaskResult, run_task

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

    from rtf.campaigns.file import BackendTable

#: Of a cluster of our own: a death of a worker is reported at once, and a worker gets no task before it is free. What
#: Dask measures of its own threads a hundred times a second says nothing of runs, which are processes.
_CONFIGURATION = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
}
_CONNECT = 10.0  # seconds for the connection to a scheduler
_ASK = 1.0  # seconds between two questions for the number of workers
_LEAST = 4  # tasks that are offered to a cluster without workers, so that it starts some
_ENCRYPTED = "tls"


class DaskBackend(Backend):
    """A client of a scheduler. Raises CampaignError for what is not possible, BackendLostError without a scheduler.

    Without ``insecure`` a scheduler beyond this machine has to have an address with TLS.
    """

    def __init__(self, given: BackendTable, *, insecure: bool = False) -> None:
        try:
            import distributed
        except ImportError:
            raise CampaignError("a cluster needs Dask: pip install 'rtf[cluster]'") from None
        self._distributed: Any = distributed  # most of it has no types
        self._given = given
        if given.address:
            check_address(given.address, insecure=insecure)
        self._cluster = None if given.address else self._start_cluster()
        if self._cluster is not None:
            try:
                check_address(self._cluster.scheduler_address, insecure=insecure)
            except CampaignError:
                self._cluster.close()
                raise
        self._client = self._connect()
        self._dashboard = self._find_dashboard()
        self._executors: dict[str, Executor] = {}
        self._threads = 0
        self._asked = clock.Deadline.after(0.0)

    def _start_cluster(self) -> Any:  # Any: a class of the user's choice
        import dask

        given = self._given
        options: dict[str, Any] = dict(given.options)
        if (security := self._security()) is not None:
            options["security"] = security
        with dask.config.set(_CONFIGURATION):
            if not given.cluster:
                own: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": "127.0.0.1:0", "host": "127.0.0.1"}
                own["preload"] = worker_setup.__name__
                return self._distributed.LocalCluster(n_workers=given.workers or None, **(own | options))
            dask.config.set(_CONFIGURATION)  # for as long as its scheduler lives, which this process has started
            made = _class_of(given.cluster)(**options)
            if given.workers:
                made.scale(given.workers)
            return made

    def _security(self) -> Any:
        tls = self._given.tls
        if tls is None:
            return None  # that of Dask's own configuration
        files = {
            f"tls_{role}_{kind}": path
            for role in ("client", "scheduler", "worker")
            for kind, path in (("cert", tls.certificate), ("key", tls.key))
        }
        return self._distributed.Security(require_encryption=True, tls_ca_file=tls.authority, **files)

    def _connect(self) -> Any:
        try:
            return self._distributed.Client(
                self._given.address or self._cluster,
                security=self._security(),
                timeout=_CONNECT,
                set_as_default=False,
            )
        except (OSError, TypeError, ValueError) as error:
            place = self._given.address or "the cluster"
            raise BackendLostError(f"no connection to the scheduler of {place}: {error}") from None

    @property
    def slots(self) -> int:
        return max(_LEAST, 2 * self._known_threads())

    def _known_threads(self) -> int:
        if self._asked.expired:
            self._asked = clock.Deadline.after(_ASK)
            try:
                self._threads = sum(self._client.nthreads().values())
            except (OSError, ValueError, TypeError, self._distributed.TimeoutError):
                return self._threads  # if the scheduler is gone, the futures say so
        return self._threads

    @property
    def described(self) -> str:
        threads = self._known_threads()
        return f"{threads} worker{'s' if threads != 1 else ''} of Dask"

    @property
    def dashboard(self) -> str:
        return self._dashboard

    def _find_dashboard(self) -> str:
        """Return the address of the scheduler's page; empty without one, as where Bokeh is missing here."""
        if not self._given.address and find_spec("bokeh") is None:
            return ""
        try:
            return web_address(str(self._client.dashboard_link))
        except (KeyError, OSError, ValueError, self._distributed.TimeoutError):
            return ""

    def submit(self, job: bytes, robot: str) -> Future[bytes]:
        if robot not in self._executors:
            resources = {"resources": {robot: 1}} if robot else {}
            self._executors[robot] = self._client.get_executor(pure=False, retries=0, **resources)
        return self._executors[robot].submit(run_task, job)

    def result(self, future: Future[bytes]) -> TaskResult:
        try:
            return super().result(future)
        except self._distributed.KilledWorker as error:
            return TaskResult(Status.KILLED, f"its worker died: {error.last_worker.address}")
        except (CancelledError, OSError, self._distributed.TimeoutError) as error:
            raise BackendLostError(f"the scheduler was lost: {error}") from None
        except Exception as error:  # noqa: BLE001 - what a worker raised, which has no or another RTF
            return TaskResult(Status.BROKEN, f"the worker cannot run it: {type(error).__name__}: {error}")

    def drop(self) -> None:
        for executor in self._executors.values():
            executor.shutdown(wait=False)
        self._executors.clear()

    def close(self) -> None:
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()


def web_address(link: str) -> str:
    """Return an address that a scheduler has chosen, if a page may link to it; empty otherwise."""
    return link if link.startswith(("http://", "https://")) else ""


def check_address(address: str, *, insecure: bool) -> None:
    """Refuse an address beyond this machine without encryption. Raises CampaignError."""
    parts = urlsplit(address if "://" in address else f"tcp://{address}")
    if insecure or parts.scheme in (_ENCRYPTED, "inproc") or _is_loopback(parts.hostname or ""):
        return
    raise CampaignError(
        f"{address}: the connection would not be encrypted, and anyone who reaches it can run code on every worker; "
        "use tls:// with the files of 'rtf campaign certs', or --insecure on a network of your own"
    )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _class_of(name: str) -> Any:
    """Return a class by the path of its module and its name. Raises CampaignError."""
    module, _, attribute = name.rpartition(".")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise CampaignError(f"[backend] cluster: there is no class {name}: {error}") from None
