"""The certificate of a cluster: one key with a certificate of its own, which all its machines have."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rtf.campaigns.errors import CampaignError

if TYPE_CHECKING:
    from pathlib import Path


def write_certificates(folder: Path) -> tuple[Path, Path]:
    """Write ``campaign.crt`` and ``campaign.key``, which only the user can read; return their paths.

    Raises CampaignError if they are there already, or without Dask.
    """
    try:
        from distributed import Security
    except ImportError:
        raise CampaignError("certificates need Dask: pip install 'rtf[cluster]'") from None
    certificate, key = folder.absolute() / "campaign.crt", folder.absolute() / "campaign.key"
    made = Security.temporary()  # type: ignore[no-untyped-call]  # a key and a certificate, for all roles
    folder.mkdir(parents=True, exist_ok=True)
    for path, text, mode in ((key, made.tls_client_key, 0o600), (certificate, made.tls_ca_file, 0o644)):
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        except FileExistsError:
            raise CampaignError(f"{path} exists; name another folder, or remove it") from None
        with os.fdopen(descriptor, "w", encoding="ascii") as stream:
            stream.write(text)
    return certificate, key
