"""``rtf yarp-check`` with the ``yarp`` of this machine, or without one."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from .conftest import Net


def test_without_yarp(net: Net) -> None:
    """Without ``yarp`` on PATH the command ends with 4, and says so."""
    done = net.run("yarp-check", PATH=str(net.folder))
    assert done.process.returncode == 4
    assert "there is no 'yarp' on PATH" in done.stderr


@pytest.mark.skipif(shutil.which("yarp") is None, reason="no yarp on PATH")
def test_with_yarp(net: Net) -> None:
    """Every check of the installed version passes."""
    done = net.start("yarp-check")
    assert done.process.stdin is not None
    done.process.stdin.close()
    assert done.process.wait(300) == 0, done.stdout
    assert " 0 failed" in done.stdout
