"""Programs that are not there, and what is started instead."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from rtf.applications.errors import ApplicationError
from rtf.applications.substitutions import read_table, substitute, table_of
from rtf.applications.xml.model import Module, Text

if TYPE_CHECKING:
    from pathlib import Path


def test_shipped_table_replaces_programs_of_the_icub():
    """A simulator is ours, with the rates of the original; parameters go on where they mean the same."""
    table = read_table()
    found = substitute(Module(Text("iCub_SIM")), table)
    assert found.module.command.startswith(f"{sys.executable} -P -m rtf simulator ")
    assert "--state-rate 50 --camera-rate 60" in found.module.command
    assert (found.module.ready, found.provides["YARP_ROBOT_NAME"]) == ("/icubSim/simulator/rpc:i", "icubSim")
    assert str(found.module) == "iCub_SIM"
    assert found.message.startswith("iCub_SIM is replaced by: rtf simulator --model icub")
    robot = substitute(Module(Text("/opt/bin/yarprobotinterface"), Text("--config a.xml")), table)
    assert robot.module.command == f"{sys.executable} -P -m rtf robotinterface --config a.xml"


def test_controllers_are_those_of_this_project():
    """They take the command line of the originals."""
    table = read_table()
    solver = substitute(Module(Text("iKinCartesianSolver"), Text("--context c --part left_arm")), table)
    assert solver.module.command.endswith("-m rtf cartesian solver --context c --part left_arm")
    gaze = substitute(Module(Text("iKinGazeCtrl"), Text("--from a.ini")), table)
    assert gaze.module.command.endswith("-m rtf gaze --from a.ini")
    assert gaze.module.ready == "/iKinGazeCtrl/rpc"


def test_program_that_is_not_there():
    """The reason is reported; an application goes without a window, and not without a device."""
    table = read_table()
    window = substitute(Module(Text("yarpview"), Text("--name /v")), table)
    device = substitute(Module(Text("test_grabber"), deployer=Text("yarpdev")), table)
    assert [(one.missing, one.optional) for one in (window, device)] == [(True, True), (True, False)]
    assert device.message.startswith("yarpdev is not there: devices are started from")


def test_program_on_path_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Nor is one in its working directory, nor one that runs on another machine."""
    program = tmp_path / "iCub_SIM"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    table = read_table()
    assert substitute(Module(Text("iCub_SIM"), workdir=Text(str(tmp_path))), table).message == ""
    assert substitute(Module(Text("iCub_SIM"), node=Text("pc104")), table).message == ""
    assert substitute(Module(Text("sleep")), table).message == ""
    monkeypatch.setenv("PATH", str(tmp_path))
    module = Module(Text("iCub_SIM"))
    assert substitute(module, table).module is module


def test_own_table_comes_first(tmp_path: Path):
    """A table beside the application replaces entries of the shipped one."""
    (tmp_path / "substitutions.toml").write_text('[iCub_SIM]\ncommand = "sleep 60"\n')
    table = table_of(tmp_path)
    assert substitute(Module(Text("iCub_SIM")), table).module.command == "sleep 60"
    assert "gzclient" in table


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[a]\ncommnd = 'x'", "unknown field `commnd`"),
        ("[a]\noptional = 3", "Expected `bool`, got `int`"),
        ("[a", "Expected"),
        ("a = 1", "Expected `object`, got `int`"),
    ],
)
def test_table_that_is_wrong(tmp_path: Path, text: str, message: str):
    """The error names the file."""
    path = tmp_path / "substitutions.toml"
    path.write_text(text)
    with pytest.raises(ApplicationError, match=message) as caught:
        read_table(path)
    assert str(path) in str(caught.value)
