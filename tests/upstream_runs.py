"""Suites of icub-tests as they are, run through their fixture ``yarpmanager`` in lockstep."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from harness import Outcome, run_command
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer

if TYPE_CHECKING:
    import pytest

SUITES = Path(__file__).parent / "data" / "upstream" / "suites"


def run_upstream(folder: Path, patch: pytest.MonkeyPatch, suite: str, table: str, limit: float = 120.0) -> Outcome:
    """Run a suite with a name server and a ``substitutions.toml`` beside its fixtures."""
    shutil.copytree(SUITES / "fixtures", folder / "fixtures")
    shutil.copy(SUITES / suite, folder)
    (folder / "fixtures" / "substitutions.toml").write_text(table)
    patch.setenv("YARP_CONFIG_HOME", str(folder / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_ROBOT_NAME", "RTF_CLOCK", "YARP_CLOCK"):
        patch.delenv(name, raising=False)
    with NameServer() as server:
        configuration.write_place(server.contact)
        return run_command(folder, "--suite", suite, "--allow-motion", limit=limit)
