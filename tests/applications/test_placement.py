"""Modules that leave the choice of their node: where they are placed, and how that is explained."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from lab import application, lab
from rtf.applications.check import check_application
from rtf.applications.errors import ApplicationError
from rtf.applications.events import Kind, State
from rtf.applications.placement import lacking, measured
from rtf.applications.run.server import RunServer
from rtf.applications.run.sysinfo import SystemInfo
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.testing.suite.diagnostics import DiagnosticLog
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

GIB = 1 << 20
BUSY = SystemInfo(memory_total=8192, memory_free=6144, siblings=4, load_1=3.0)
IDLE = SystemInfo(memory_total=8192, memory_free=3174, siblings=4, load_1=0.3)
SMALL = SystemInfo(memory_total=2048, memory_free=410, siblings=8, load_1=0.0)
BUSY_SAYS = "busy: load 3.0 on 4 processors, 6.0 GB free"
IDLE_SAYS = "idle: load 0.3 on 4 processors, 3.1 GB free"


class NodeWithFigures(RunServer):
    """A node that says figures of its own, instead of those of this machine."""

    def __init__(self, name: str, network: Network, figures: SystemInfo) -> None:
        self.figures = figures
        super().__init__(name, network=network)
        self._answers["sysinfo"] = lambda _: self.figures


@pytest.fixture
def network() -> Iterator[Network]:
    """A network with three nodes: one has work to do, one has little, one has little memory."""
    network = Network(LocalNames())
    with (
        NodeWithFigures("/busy", network, BUSY),
        NodeWithFigures("/idle", network, IDLE),
        NodeWithFigures("/small", network, SMALL),
    ):
        yield network


def anywhere(command: str, node: str = "") -> str:
    """Write a module without a node, or with several."""
    name, _, parameters = command.partition(" ")
    place = f"<node>{node}</node>" if node else ""
    return f"<module><name>{name}</name><parameters>{parameters}</parameters>{place}</module>"


def describe(folder: Path, computers: str, needs: str = "") -> None:
    """Write the machines of a lab, each as ``name`` or ``name:FIGURES``, and what the program ``sleep`` needs."""
    (folder / "resources").mkdir()
    rows = (one.partition(":") for one in computers.split())
    content = "".join(f"<computer><name>{name}</name>{figures}</computer>" for name, _, figures in rows)
    (folder / "resources" / "lab.xml").write_text(f"<resources>{content}</resources>")
    if needs:
        (folder / "modules").mkdir()
        (folder / "modules" / "sleep.xml").write_text(
            f"<module><name>sleep</name><dependencies><computer>{needs}</computer></dependencies></module>"
        )


def test_least_loaded_node_that_has_enough_is_chosen(tmp_path: Path, network: Network):
    """The event says what was compared and who was refused; the next module counts those that were placed before."""
    describe(tmp_path, "busy idle small gone", f"<memory><free_space>{GIB}</free_space></memory>")
    app = application(tmp_path, anywhere("sleep 60") + anywhere("sleep 61") * 3)
    with lab(app, network) as run:
        assert run.manager.start()
        refused = (
            "small refused: memory.free_space of 1.0 GB is needed, 0.4 GB is there;"
            " gone refused: there is no node /gone; 'rtf name runners' lists them"
        )
        assert run.texts(Kind.PLACED)[0] == f"sleep 60 is placed on idle: {BUSY_SAYS}; {IDLE_SAYS}; {refused}"
        assert [unit.module.node for unit in run.manager.units] == ["idle", "idle", "idle", "busy"]
        assert "idle: load 0.3 and 3 of these modules on 4 processors" in run.manager.units[3].placed
        assert run.states() == [State.RUNNING] * 4
        assert run.manager.stop()


def test_module_is_found_again_where_it_was_placed(tmp_path: Path, network: Network):
    """A later manager does not choose again, though another node has less to do now."""
    app = application(tmp_path, anywhere("sleep 60", "busy, idle"))
    with lab(app, network) as first:
        assert first.manager.start()
        assert first.manager.units[0].module.node == "idle"
        for _ in range(2):
            with lab(app, network) as second:
                second.manager.look()
                (unit,) = second.manager.units
                assert (unit.module.node, unit.state, unit.placed) == ("idle", State.RUNNING, "")
                assert second.manager.stop()
            assert first.manager.start()


def test_module_that_fits_nowhere_is_not_started(tmp_path: Path, network: Network):
    """The reason has those of all nodes; others are started."""
    describe(tmp_path, "busy:<disable>yes</disable> small", f"<memory><free_space>{GIB}</free_space></memory>")
    own = "<dependencies><computer><processor><siblings>8</siblings></processor></computer></dependencies></module>"
    small = anywhere("tail -f /dev/null", "small busy idle").replace("</module>", own)
    app = application(tmp_path, anywhere("sleep 60") + small)
    with lab(app, network) as run:
        assert not run.manager.start()
        assert run.states() == [State.MISSING, State.RUNNING]
        refused = "small refused: memory.free_space of 1.0 GB is needed, 0.4 GB is there"
        assert run.texts(Kind.FAILED) == [f"sleep 60 is not there: no node is left for it: {refused}"]
        assert "idle refused: processor.siblings of 8 is needed, 4 is there" in run.manager.units[1].placed
        assert f"busy refused: it is disabled by {tmp_path}/resources/lab.xml:1:22" in run.manager.units[1].placed


def test_module_without_a_node_runs_here_if_no_machines_are_described(tmp_path: Path):
    """So it does with a description of this machine alone; its own load is measured."""
    with lab(application(tmp_path, anywhere("sleep 60"))) as run:
        assert (run.manager.units[0].module.node, run.manager.units[0].placed) == ("localhost", "")
    describe(tmp_path, "localhost")
    with lab(application(tmp_path, anywhere("sleep 60"))) as run:
        assert run.manager.start()
        assert run.texts(Kind.PLACED)[0].startswith("sleep 60 is placed on localhost: localhost: load ")


def test_check_says_what_would_be_chosen(tmp_path: Path, network: Network):
    """Nothing is started; a module that fits nowhere is an error, and so is a program that is not there."""
    describe(tmp_path, "busy idle")
    app = application(tmp_path, anywhere("sleep 60") + anywhere("sleep 61", "gone away") + anywhere("nothing", "busy"))
    problems = DiagnosticLog()
    assert check_application(app, problems, network) == [f"sleep 60 is placed on idle: {BUSY_SAYS}; {IDLE_SAYS}"]
    second, first = map(str, problems)
    assert f"{tmp_path}/lab.xml:1:" in first
    assert "there is no program 'nothing' on busy" in first
    assert "sleep 61 on gone away: no node is left for it: gone refused: there is no node /gone" in second
    assert check_application(app, DiagnosticLog()) == []


def test_module_that_found_no_node_finds_one_later(tmp_path: Path):
    """A module that is started alone, as by the page, is placed then, if it could not be before."""
    network = Network(LocalNames())
    with lab(application(tmp_path, anywhere("sleep 60", "idle gone")), network) as run:
        run.manager.begin(run.manager.units)
        assert run.states() == [State.MISSING]
        assert "idle refused: there is no node /idle" in run.texts(Kind.FAILED)[0]
        with NodeWithFigures("/idle", network, IDLE):
            run.manager.begin(run.manager.units)
            eventually(lambda: run.states() == [State.RUNNING], "it is not started")
            assert run.manager.stop()


def test_machines_that_cannot_be_read_are_no_reason_to_run_here(tmp_path: Path):
    """The error has its place; an application whose modules all have nodes is not concerned."""
    (tmp_path / "resources").mkdir()
    (tmp_path / "resources" / "lab.xml").write_text("<resources><computer>")
    app = application(tmp_path, anywhere("sleep 60"))
    with pytest.raises(ApplicationError, match=r"a node is to be chosen .*/resources/lab.xml:1:"), lab(app):
        pass
    with lab(application(tmp_path, anywhere("sleep 60", "localhost"))) as run:
        assert run.states() == [State.STOPPED]


@pytest.mark.parametrize(
    ("wanted", "has", "lacks"),
    [
        ({"processor.cores": "4"}, {"processor.cores": "4"}, []),
        ({"processor.cores": "4"}, {"processor.cores": "2"}, ["processor.cores of 4 is needed, 2 is there"]),
        ({"platform.name": "linux"}, {"platform.name": "Linux"}, []),
        ({"gpu.name": "big"}, {}, ["gpu.name of big is needed, it is not known"]),
        ({"memory.free_space": "much"}, {"memory.free_space": "1"}, ["memory.free_space of much is needed, 0.0 GB"]),
    ],
)
def test_figures_are_compared(wanted: dict[str, str], has: dict[str, str], lacks: list[str]):
    """Numbers are at least, words the same, and what is not known is lacking."""
    found = lacking(has, [wanted])
    assert len(found) == len(lacks)
    assert all(one.startswith(text) for one, text in zip(found, lacks, strict=True))


def test_measured_figures_have_the_names_and_units_of_files():
    """Spaces are KiB, and what a node does not say is left out."""
    assert measured(SystemInfo(memory_free=2, cores=4, name="Linux")) == {
        "memory.free_space": "2048",
        "processor.cores": "4",
        "platform.name": "Linux",
    }
