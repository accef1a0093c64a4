"""The modules that a small tool loads before it can ask the name server."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

_PROGRAM = """
import sys
from rtf.middleware.naming.configuration import find_network
find_network({"YARP_CONFIG_HOME": sys.argv[1]})
print(*sys.modules)
"""
#: Modules whose import takes long, and which only some programs need: interfaces, keys, names, ports, types.
_LATER = {
    "hmac",
    "numpy",
    "psutil",
    "sqlite3",
    "rtf.middleware.naming.local",
    "rtf.middleware.naming.multi_server",
    "rtf.middleware.naming.table",
    "rtf.middleware.ports.port",
}


def test_nothing_is_loaded_in_advance(tmp_path: Path):
    """Finding the network does not load addresses, keys, tables or ports."""
    program = [sys.executable, "-c", _PROGRAM, str(tmp_path)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, check=True)
    loaded = set(done.stdout.split())
    assert "rtf.middleware.naming.client" in loaded
    assert loaded & _LATER == set()
