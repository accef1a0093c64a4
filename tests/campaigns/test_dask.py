"""The backend of Dask: encryption beyond this machine, certificates, and what a worker sends."""

from __future__ import annotations

import stat
from concurrent.futures import CancelledError, Future
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest

from rtf.campaigns.backends.backend import BackendLostError
from rtf.campaigns.backends.certificates import write_certificates
from rtf.campaigns.backends.dask import DaskBackend, check_address
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.file import BackendTable
from rtf.campaigns.task_run import Status

if TYPE_CHECKING:
    from pathlib import Path


pytestmark = pytest.mark.skipif(not find_spec("distributed"), reason="needs pip install 'rtf[cluster]'")


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:8786", "localhost:8786", "tls://10.0.0.1:8786", "tcp://[::1]:8786"]
)
def test_addresses_that_are_safe(address: str):
    """This machine, and encrypted connections to others."""
    check_address(address, insecure=False)


@pytest.mark.parametrize("address", ["tcp://10.0.0.1:8786", "node7:8786", "ws://node7:8786", "tcp://[fe80::1]:8786"])
def test_addresses_that_are_refused(address: str):
    """Connections over a network without encryption are refused, with a hint; --insecure allows them."""
    with pytest.raises(CampaignError, match="rtf campaign certs"):
        check_address(address, insecure=False)
    check_address(address, insecure=True)


def test_an_address_is_checked_before_anything_is_connected():
    """A backend with such an address is refused without a connection."""
    with pytest.raises(CampaignError, match="would not be encrypted"):
        DaskBackend(BackendTable(kind="dask", address="tcp://10.255.255.1:8786"))


def test_a_cluster_that_is_none():
    """A cluster that cannot be imported is an error with its name."""
    with pytest.raises(CampaignError, match=r"there is no class nothing\.Cluster"):
        DaskBackend(BackendTable(kind="dask", cluster="nothing.Cluster"))


def test_certificates_are_written_once_and_the_key_is_secret(tmp_path: Path):
    """Dask takes the files for all roles; a second call replaces nothing."""
    from distributed import Security

    certificate, key = write_certificates(tmp_path / "keys")
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    files = {
        f"tls_{role}_{kind}": str(path)
        for role in ("client", "scheduler", "worker")
        for kind, path in (("cert", certificate), ("key", key))
    }
    security = Security(require_encryption=True, tls_ca_file=str(certificate), **files)
    assert security.get_connection_args("client")["ssl_context"] is not None
    before = key.read_bytes()
    with pytest.raises(CampaignError, match="exists; name another folder"):
        write_certificates(tmp_path / "keys")
    assert key.read_bytes() == before


class _Answer(Future):
    """A future that is done."""

    def __init__(self, *, value: object = None, error: BaseException | None = None) -> None:
        super().__init__()
        self.set_result(value) if error is None else self.set_exception(error)


@pytest.mark.parametrize(
    ("answer", "status"),
    [
        (_Answer(value=b"\x00no result"), Status.KILLED),
        (_Answer(error=ModuleNotFoundError("No module named 'rtf'")), Status.BROKEN),
        (_Answer(error=CancelledError()), None),
        (_Answer(error=ConnectionResetError()), None),
    ],
)
def test_what_a_worker_sends_is_a_result_or_reported(answer: Future, status: Status | None):
    """What is no result counts as a death of the worker, what it raises is reported; a lost scheduler is not that."""
    import distributed

    backend = DaskBackend.__new__(DaskBackend)
    backend._distributed = distributed
    if status is None:
        with pytest.raises(BackendLostError):
            backend.result(answer)
    else:
        assert backend.result(answer).status is status
