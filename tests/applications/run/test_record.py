"""What a node leaves for the next one of its name."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from rtf.applications.run.client import RunClient
from rtf.applications.run.errors import RunError
from rtf.applications.run.protocol import Start
from rtf.applications.run.record import NodeRecord, record_path
from rtf.applications.run.server import RunServer
from rtf.middleware.errors import MiddlewareError
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from waiting import eventually


def test_held_program_is_found_again_with_its_output(tmp_path: Path):
    """What it writes while there is no node is logged by the next one, even if one in between could not open."""
    network, path, door = Network(LocalNames()), tmp_path / "nodes" / "node.json", tmp_path / "door"
    os.mkfifo(door)
    said: list[str] = []
    with BufferedPort("/yarplogger", strict=True, network=network) as logger:
        with RunServer("/node", network=network, record=NodeRecord(path), log="/yarplogger"):
            command = f'sh -c "echo one; read line < {door}; echo $line; exec sleep 60"'
            pid = RunClient("/node", network=network).start(Start("held", command, hold=True)).pid
            assert logger.read(10)[1] == "one\n"
        door.write_text("two\n")
        NodeRecord(path).close()
        with RunServer("/node", network=network, record=NodeRecord(path), said=said.append):
            assert said == [f"found held ({pid}) again: {command}"]
            assert logger.read(10)[1] == "two\n"
            client = RunClient("/node", network=network)
            assert [(row.pid, row.command) for row in client.running()] == [(pid, command)]
            assert client.kill("held", 9)
            os.waitpid(pid, 0)  # here it is still our child
            eventually(lambda: not client.running(), "it is still listed")
        with RunServer("/node", network=network, record=NodeRecord(path), said=said.append):
            assert len(said) == 3, said


def test_second_node(tmp_path: Path):
    """Its record is locked as long as the first one has it."""
    path = tmp_path / "node.json"
    first = NodeRecord(path)
    with pytest.raises(RunError, match="runs on this machine already"):
        NodeRecord(path)
    first.close()
    NodeRecord(path).close()


def test_node_that_cannot_open_releases_its_record(tmp_path: Path):
    """The next one of the name is not refused for it."""
    path = tmp_path / "node.json"
    network = Network(LocalNames())
    for _ in range(2):
        with pytest.raises(MiddlewareError, match="cannot be registered"):
            RunServer("/no name", network=network, record=NodeRecord(path))


def test_process_with_the_mark_of_an_earlier_node(tmp_path: Path):
    """It is ended; one with another mark is left alone."""
    path = tmp_path / "node.json"
    first = NodeRecord(path)
    programs = [
        subprocess.Popen(["sleep", "60"], env={**os.environ, "RTF_RUN_CHILD": f"{token}-1"})
        for token in (first.token, "other")
    ]
    try:
        first.close()
        ours, other = programs
        with RunServer("/node", network=Network(LocalNames()), record=NodeRecord(path), grace=2.0):
            assert ours.wait(10) == -15
            assert other.poll() is None
    finally:
        for program in programs:
            program.kill()
            program.wait()


@pytest.mark.parametrize("content", [b"", b"{", b'{"tokens": 1}', b'{"tokens": ["x"], "boot": "of last year"}'])
def test_record_that_says_nothing(tmp_path: Path, content: bytes):
    """One that was cut short, or is from before the machine was started, is that of no node."""
    path = tmp_path / "node.json"
    path.write_bytes(content)
    record = NodeRecord(path)
    assert (record.held_before(), record.end_left(0.0)) == ([], [])
    record.close()


def test_records_of_nodes_with_one_name():
    """Each network has its own."""
    one, other = (record_path(Path("x"), "/a/b c", network) for network in ("tcp://h:1", "tcp://h:2"))
    assert one != other
    assert one.name.startswith("a_b_c@")
