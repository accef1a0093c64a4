"""Who may ask a node for what."""

from __future__ import annotations

import ipaddress
import os
import shutil
from pathlib import Path

import pytest

from rtf.applications.run.access import RunAccess
from rtf.applications.run.errors import RunError, StartError
from rtf.middleware.errors import AddressError


def admits(access: RunAccess, address: str) -> bool:
    """Whether an address may ask."""
    return access.admits(ipaddress.ip_address(address))


def test_without_a_list_only_this_machine_may_ask():
    """Nobody else, and no connection without an address."""
    access = RunAccess()
    assert admits(access, "127.0.0.1")
    assert admits(access, "::1")
    assert not admits(access, "10.0.0.7")
    assert not access.admits(None)


def test_listed_addresses_may_ask():
    """They alone."""
    access = RunAccess.parse(["10.0.0.0/24"])
    assert admits(access, "10.0.0.7")
    assert not admits(access, "10.0.1.7")
    assert not admits(access, "127.0.0.1")


@pytest.mark.parametrize(("word", "error"), [("/manager", RunError), ("host", AddressError)])
def test_what_is_no_address(word: str, error: type[Exception]):
    """A port's name proves nothing, and a host's name may be anybody's."""
    with pytest.raises(error, match=word):
        RunAccess.parse([word])


def test_folder_that_is_none():
    """It is refused at the start, not at the first request."""
    with pytest.raises(RunError, match="no folder"):
        RunAccess.parse(programs=["/nowhere/at/all"])


def test_program_by_name_is_the_one_on_the_path_of_the_node(tmp_path: Path):
    """A file of the same name elsewhere is another program."""
    access = RunAccess.parse(programs=["sleep"])
    true_one, other = shutil.which("sleep"), tmp_path / "sleep"
    assert true_one is not None
    shutil.copy(true_one, other)
    access.check_program(true_one, (), os.environ)
    with pytest.raises(StartError, match="not among the allowed programs"):
        access.check_program(str(other), (), os.environ)


def test_programs_of_a_folder(tmp_path: Path):
    """Below it, and not by a link that leads out of it."""
    folder = tmp_path / "bin"
    (folder / "deep").mkdir(parents=True)
    access = RunAccess.parse(programs=[str(folder)])
    inside, link = folder / "deep" / "tool", folder / "sh"
    inside.touch()
    link.symlink_to("/bin/sh")
    access.check_program(str(inside), (), {})
    for path in (link, folder / ".." / "tool"):
        with pytest.raises(StartError):
            access.check_program(str(path), (), {})


def test_variables_of_restricted_programs(tmp_path: Path):
    """Only those that cannot turn a program into another one, and those that are named."""
    program = tmp_path / "tool"
    access = RunAccess.parse(programs=[str(tmp_path)], variables=["ROBOT_*"])
    access.check_program(str(program), ["YARP_PORT_PREFIX", "ROBOT_NAME"], {})
    for name in ("LD_PRELOAD", "PATH", "PYTHONPATH"):
        with pytest.raises(StartError, match=name):
            access.check_program(str(program), [name], {})
    RunAccess().check_program(str(program), ["LD_PRELOAD"], {})
