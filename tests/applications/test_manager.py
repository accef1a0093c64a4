"""Running applications: programs on this machine and on nodes, what they wait for, and what happens when they end."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import threading
from contextlib import ExitStack, closing
from itertools import chain, repeat
from typing import TYPE_CHECKING

import pytest

from lab import application, lab, module, needs, shell
from rtf import clock
from rtf.applications import connections
from rtf.applications.connections import Link
from rtf.applications.errors import ApplicationError
from rtf.applications.events import Kind, State
from rtf.applications.manager import LOOK
from rtf.applications.run.server import RunServer
from rtf.bottle import Bottle
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcServer
from rtf.middleware.wire.contact import Contact
from waiting import alive, eventually

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.applications.xml.model import Connection

ONE_CONNECTION = "<connection><from>/a</from><to>/b</to></connection>"


def test_modules_run_here_and_on_a_node_and_are_stopped(tmp_path: Path):
    """Variables, folder and prefix reach the program; nothing is left when the application is stopped."""
    out = tmp_path / "out"
    content = shell(
        tmp_path,
        "one",
        f'echo "$A|$YARP_PORT_PREFIX|$YARP_RENAME_old|$PWD" > {out}; exec sleep 60',
        "<environment>A=1</environment><prefix>/p</prefix><portmap><old>/old</old><new>/new</new></portmap>",
    ) + module("sleep", "60", node="node1")
    network = Network(LocalNames())
    with RunServer("/node1", network=network) as node, lab(application(tmp_path, content), network) as run:
        assert run.manager.start()
        assert run.states() == [State.RUNNING, State.RUNNING]
        eventually(out.exists, "the program has not begun")
        eventually(out.read_text, "the program has written nothing")
        assert out.read_text() == f"1|/p|/new|{tmp_path}\n"
        pids = [unit.pid for unit in run.manager.units]
        assert pids[1] == node._children.running()[0].pid
        assert run.manager.stop()
        assert not any(map(alive, pids))
        assert run.states() == [State.STOPPED, State.STOPPED]


def test_names_of_this_machine_are_one_place(tmp_path: Path):
    """They share one node, whatever the file calls it."""
    nodes = ("localhost", "127.0.0.1", socket.gethostname())
    with lab(application(tmp_path, "".join(module("sleep", "60", node=node) for node in nodes))) as run:
        assert run.manager.start()
        assert len({unit.deployer for unit in run.manager.units}) == 1


def test_modules_wait_for_ports_and_their_replies(tmp_path: Path):
    """A module starts when the port is open and answers as it should; the manager says what it waits for."""
    content = module("sleep", "60", needs("/server", request="[get] state", reply="ready"))
    answers = iter(["booting", "ready"])
    with lab(application(tmp_path, content)) as run:
        thread = threading.Thread(target=run.manager.start)
        thread.start()
        eventually(lambda: run.texts(Kind.WAITING) == ["sleep 60 waits: /server is not open"], "it does not wait")
        with RpcServer("/server", lambda _: Bottle([next(answers)]), network=run.network):
            thread.join()
        assert run.states() == [State.RUNNING]
        assert [*answers] == []


def test_wait_for_a_port_ends(tmp_path: Path):
    """After its timeout, at once when its program has failed, and when the application is stopped."""
    late = module("sleep", "60", needs("/never", timeout="0.3"))
    broken = shell(tmp_path, "broken --name /broken", "exit 3", needs("/here"))
    broken += module("sleep", "61", needs("/broken/out"))
    forever = module("sleep", "62", needs("/never"))
    with lab(application(tmp_path, late + broken + forever)) as run, BufferedPort("/here", network=run.network):
        done: list[bool] = []
        thread = threading.Thread(target=lambda: done.append(run.manager.start()))
        thread.start()
        eventually(lambda: len(run.texts(Kind.FAILED)) == 3, "too few have failed")
        assert set(run.texts(Kind.FAILED)) == {
            "sleep 60 is not up: after 0.3 s, /never is not open",
            "sh broken.sh --name /broken ended: exit status 3",
            "sleep 61 is not up: it waits for a port of sh broken.sh --name /broken, which is not up",
        }
        run.manager.interrupt()
        thread.join()
        assert done == [False]
        assert "sleep 62 is not up: it was waiting when the application was stopped" in run.texts(Kind.FAILED)


def test_application_needs_its_ports(tmp_path: Path):
    """Without them nothing is started."""
    content = needs("/robot") + module("sleep", "60")
    with lab(application(tmp_path, content)) as run:
        assert not run.manager.start()
        assert run.texts(Kind.FAILED) == ["lab needs a port: /robot is not open"]
        assert run.states() == [State.STOPPED]


def test_rules_of_arbitrators_are_reported(tmp_path: Path):
    """They are not applied, so every connection to their port delivers: a run says so."""
    rule = "<arbitrator><port>/b</port><rule connection='/a'>e_quiet</rule></arbitrator>"
    with lab(application(tmp_path, module("sleep", "60") + rule)) as run:
        assert run.manager.start()
        assert run.texts(Kind.IGNORED) == ["the rules of /b are drawn, and not applied, by yarpmanager as well"]


def test_modules_in_a_circle_are_refused(tmp_path: Path):
    """The error names the modules."""
    content = module("a", "--name /a", needs("/b/out")) + module("b", "--name /b", needs("/a/out"))
    app = application(tmp_path, content)
    with pytest.raises(ApplicationError, match=r"modules wait for each other: . -> . -> ."), lab(app):
        pass


def test_module_that_dies_is_reported_with_its_last_output(tmp_path: Path):
    """So is how it ended; on nodes of RTF as well as here. What steers a terminal is left out."""
    content = "".join(
        shell(tmp_path, name, "printf 'no \\033camera\\n'; kill -9 $$", node=node)
        for name, node in (("here", "localhost"), ("there", "node1"))
    )
    network = Network(LocalNames())
    with RunServer("/node1", network=network), lab(application(tmp_path, content), network) as run:
        run.manager.start()
        assert not run.manager.watch()
        ended = [one for one in run.said if one.kind is Kind.FAILED]
        assert sorted(one.text for one in ended) == [
            "sh here.sh ended: killed by SIGKILL\n    no ?camera",
            "sh there.sh on node1 ended: killed by SIGKILL\n    no ?camera",
        ]
        assert [one.ending.how for one in ended if one.ending] == ["killed by SIGKILL"] * 2


@pytest.mark.parametrize(
    ("policy", "script", "starts", "good"),
    [
        ("never", "exit 1", 1, False),
        ("on-failure", "exit 0", 1, True),
        ("on-failure", "exit 1", 3, False),
        ("always", "exit 0", 3, False),
    ],
)
def test_restart_policies(tmp_path: Path, policy: str, script: str, starts: int, good: bool):
    """A module is started again as its policy says, and not for ever."""
    restart = f'<restart attempts="2" backoff="0.05">{policy}</restart>'
    content = shell(tmp_path, "one", f"echo x >> {tmp_path}/starts; {script}", restart)
    with lab(application(tmp_path, content)) as run:
        run.manager.start()
        assert run.manager.watch() is good
    assert (tmp_path / "starts").read_text() == "x\n" * starts
    assert len(run.texts(Kind.RESTARTED)) == starts - 1


def test_program_that_forks_and_exits_still_runs(tmp_path: Path):
    """A module runs as long as any process of it does, and all are stopped."""
    content = shell(tmp_path, "one", f"sleep 60 & echo $! > {tmp_path}/pid; exit 0")
    with lab(application(tmp_path, content)) as run:
        assert run.manager.start()
        eventually(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text(), "it has not begun")
        run.manager.watch_once()
        assert run.states() == [State.RUNNING]
        run.manager.stop()
        assert not alive(int((tmp_path / "pid").read_text()))


def test_a_module_that_ignores_sigterm_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """That is reported."""
    monkeypatch.setattr("rtf.applications.manager._STOP", 0.2)
    content = shell(tmp_path, "one", f"trap '' TERM; touch {tmp_path}/deaf; while :; do sleep 0.1; done")
    with lab(application(tmp_path, content)) as run:
        assert run.manager.start()
        eventually((tmp_path / "deaf").exists, "it has not begun")
        assert run.manager.stop()
        assert run.texts(Kind.STOPPED) == ["sh one.sh is killed, as it ran 0.2 s after SIGTERM"]


def test_modules_are_stopped_in_reverse(tmp_path: Path):
    """A module stops before the one for whose port it waits."""
    content = module("sleep", "60", needs("/x/out")) + shell(tmp_path, "x --name /x", "exec sleep 61")
    with lab(application(tmp_path, content)) as run, BufferedPort("/x/out", network=run.network):
        assert run.manager.start()
        assert run.manager.stop()
        assert run.texts(Kind.STOPPED) == ["sleep 60 is stopped", "sh x.sh --name /x is stopped"]


def test_many_modules_are_stopped_together(tmp_path: Path):
    """Those that do not wait for each other end at the same time, each after its own delay."""
    slow = "<ensure><wait when='stop'>0.3</wait></ensure>"
    content = "".join(module("sleep", "60", slow if number == 0 else "") for number in range(40))
    with lab(application(tmp_path, content)) as run:
        assert run.manager.start()
        began = clock.monotonic()
        assert run.manager.stop()
        assert clock.monotonic() - began < 5.0
        assert len(run.texts(Kind.STOPPED)) == 40
        assert run.said[-1].module == run.manager.units[0].module.tag


def test_running_modules_are_found_by_their_tag(tmp_path: Path):
    """A second manager, as after a restart, starts nothing again, and stops what the first has started."""
    app = application(tmp_path, module("sleep", "60", node="node1"))
    network = Network(LocalNames())
    with RunServer("/node1", network=network) as node, lab(app, network) as first:
        assert first.manager.start()
        with lab(app, network) as second:
            assert second.manager.start()
            assert second.texts(Kind.FOUND) == [f"sleep 60 on node1 runs already ({first.manager.units[0].pid})"]
            assert len(node._children.running()) == 1
            assert second.manager.stop()
        assert node._children.running() == []


def test_nodes_of_yarp_list_what_has_ended(tmp_path: Path):
    """A zombie in the list of ``yarprun`` does not run; how it ended is not known, as such a node does not say."""
    app = application(tmp_path, module("sleep", "60", node="node1"))
    rows = chain(["running"], repeat("zombie"))
    tag = app.modules[0].tag

    def answer(message: Bottle) -> Bottle:
        if not message.check("ps"):
            return Bottle(["not running"])
        return Bottle([[["pid", 7], ["tag", tag], ["status", next(rows)], ["cmd", "sleep 60"], ["env", ""]]])

    network = Network(LocalNames())
    with RpcServer("/node1", answer, network=network), lab(app, network) as run:
        run.manager.look()
        assert run.states() == [State.RUNNING]
        run.manager.look()
        assert run.states() == [State.STOPPED]


def test_port_that_is_open_already_is_refused(tmp_path: Path):
    """Ports of one name on two nodes: the second program is not started."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "sleep.xml").write_text(
        "<module><name>sleep</name><data><output><port>/cam</port></output></data></module>"
    )
    with lab(application(tmp_path, module("sleep", "60"))) as run, Port("/cam", network=run.network):
        assert not run.manager.start()
        assert "its port /cam is open already, by another program at 127.0.0.1:" in run.texts(Kind.FAILED)[0]


def test_node_that_is_not_there(tmp_path: Path):
    """Its module has failed; what runs elsewhere can be stopped all the same."""
    with lab(application(tmp_path, module("sleep", "60", node="gone") + module("sleep", "61"))) as run:
        assert not run.manager.start()
        assert run.texts(Kind.FAILED) == [
            "sleep 60 on gone is not up: there is no node /gone; 'rtf name runners' lists them"
        ]
        assert run.manager.stop()


def test_node_that_hangs_keeps_nobody_from_watching_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its modules are in an unknown state until it answers again; they are neither restarted nor reported as ended."""
    monkeypatch.setattr("rtf.applications.deployers._LISTING", 0.3)
    free = threading.Event()
    free.set()
    network = Network(LocalNames())
    content = module("sleep", "60", node="node1") + shell(tmp_path, "short", "exec sleep 0.5")
    with RunServer("/node1", network=network) as node, lab(application(tmp_path, content), network) as run:
        answer = node._port._handle
        node._port._handle = lambda message: free.wait() and answer(message)
        assert run.manager.start()
        free.clear()

        def watched(*states: State) -> bool:
            run.manager.watch_once()
            return run.states() == [*states]

        eventually(lambda: watched(State.UNKNOWN, State.ENDED), "the other module is not watched")
        assert run.texts(Kind.LOST)[0].startswith("/node1 is not watched: the node /node1 did not answer")
        free.set()
        eventually(lambda: watched(State.RUNNING, State.ENDED), "it is not found again")
        assert run.texts(Kind.BACK) == ["/node1 answers again"]


def test_node_that_vanishes_in_mid_start(tmp_path: Path):
    """The module has failed, with the reason; the start does not hang."""
    network = Network(LocalNames())
    content = module("sleep", "60", "<ensure><wait>30</wait></ensure>", node="node1")
    with lab(application(tmp_path, content), network) as run:
        with RunServer("/node1", network=network):
            thread = threading.Thread(target=run.manager.start)
            thread.start()
            eventually(lambda: run.texts(Kind.STARTED), "it is not started")
        thread.join(10.0)
        assert not thread.is_alive()
        assert run.states() == [State.FAILED]
        # Its name is gone, its port does not answer any more, or it has ended the program, whatever comes first.
        reasons = ("there is no node /node1", "the node /node1 did not answer", "ended")
        assert any(reason in run.texts(Kind.FAILED)[0] for reason in reasons)


def test_connections_are_made_and_made_again(tmp_path: Path):
    """A connection that is lost while its ports are there is made again; disconnecting ends all."""
    content = shell(tmp_path, "one", "exec sleep 60") + ONE_CONNECTION
    with lab(application(tmp_path, content)) as run:
        with BufferedPort("/b", network=run.network), Port("/a", network=run.network) as source:
            assert run.manager.start()
            assert [output.target.name for output in source.outputs] == ["/b"]
            source.remove_output("/b")
            run.manager.links.watch()
            assert run.texts(Kind.LOST) == ["/a -> /b is lost"]
            assert run.texts(Kind.CONNECTED) == ["/a -> /b is connected by tcp"] * 2
            assert [state for _, state in run.manager.links.states()] == [Link.CONNECTED]
            assert run.manager.links.disconnect()
            assert source.outputs == ()
            assert [state for _, state in run.manager.links.states()] == [Link.APART]
        assert not run.manager.links.connect()
        assert run.texts(Kind.FAILED) == ["/a -> /b is not connected: /a and /b are not open"]


def test_application_of_connections_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its connections are watched until it is interrupted; nothing is started any more after that."""
    monkeypatch.setattr("rtf.applications.manager._LOOK_AT_LINKS", 0.0)
    with (
        lab(application(tmp_path, ONE_CONNECTION)) as run,
        BufferedPort("/b", network=run.network),
        Port("/a", network=run.network) as source,
    ):
        assert run.manager.start()
        thread = threading.Thread(target=run.manager.watch)
        thread.start()
        source.remove_output("/b")
        eventually(lambda: source.outputs, "it is not connected again")
        run.manager.interrupt()
        thread.join()
    with lab(application(tmp_path, module("sleep", "60"))) as run:
        run.manager.interrupt()
        assert not run.manager.start()
        assert run.states() == [State.STOPPED]


def test_an_error_of_the_connections_is_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """They are looked at again after it."""
    monkeypatch.setattr("rtf.applications.manager._LOOK_AT_LINKS", 0.0)
    with lab(application(tmp_path, ONE_CONNECTION)) as run:
        looks, errors = [*"ab"], []

        def fail_first() -> None:
            if looks.pop() == "b":
                raise ApplicationError("the network is upset")

        def looked_again() -> bool:
            try:
                run.manager.watch_once()
            except ApplicationError as error:
                errors.append(str(error))
            return not looks

        monkeypatch.setattr(run.manager.links, "watch", fail_first)
        eventually(looked_again, "they are looked at no more", 2.0)
        assert errors == ["the network is upset"]


def test_connection_that_persists_is_kept_by_the_name_server(tmp_path: Path):
    """It is made again when a port is back, without the manager, until the application is disconnected."""
    content = ONE_CONNECTION.replace("<connection>", '<connection persist="true" qos="level:low">')
    with NameServer() as server, closing(RemoteNames(server.contact)) as names:
        network = Network(names)
        with lab(application(tmp_path, content), network) as run, Port("/a", network=network) as source:
            with BufferedPort("/b", network=network):
                assert run.manager.links.connect()
                assert remote.connection_qos(network, Contact("/a"), Contact("/b"))[0].tos == 40
            eventually(lambda: source.outputs == (), "the connection to a closed port stays")
            with BufferedPort("/b", network=network):
                eventually(lambda: source.outputs, "the name server does not connect")
                assert run.manager.links.disconnect()
                assert "/a" not in " ".join(names.command("subscribe"))


def test_name_server_that_is_restarted_in_the_middle(tmp_path: Path):
    """Modules here and connections go on; a node is out of sight until the server is back, and nothing is restarted."""
    content = module("sleep", "60", node="node1") + module("sleep", "61") + ONE_CONNECTION
    with NameServer() as first, closing(RemoteNames(first.contact, watch=0.05)) as names, ExitStack() as stack:
        network = Network(names)
        stack.enter_context(RunServer("/node1", network=network))
        stack.enter_context(BufferedPort("/b", network=network))
        source = stack.enter_context(Port("/a", network=network))
        run = stack.enter_context(lab(application(tmp_path, content), network))
        assert run.manager.start()
        first.close()
        run.manager.watch_once()
        run.manager.links.watch()
        assert run.states() == [State.UNKNOWN, State.RUNNING]
        with NameServer(port=first.contact.port) as second:
            eventually(lambda: second.names.query("/node1") and second.names.query("/a"), "the ports are not back")
            eventually(lambda: run.manager.watch_once() or run.states() == [State.RUNNING] * 2, "the node is not back")
            run.manager.links.watch()
            assert [output.target.name for output in source.outputs] == ["/b"]
            assert [one.kind for one in run.said].count(Kind.STARTED) == 2
            assert [one.kind for one in run.said if one.kind in (Kind.LOST, Kind.BACK)] == [Kind.LOST, Kind.BACK]
            stack.close()


def test_flood_of_output_is_read(tmp_path: Path):
    """A program that writes as fast as it can is not kept from it, and its last lines are there at its end."""
    content = shell(tmp_path, "one", "yes flood | head -c 60000000; echo over; exit 1")
    with lab(application(tmp_path, content)) as run:
        began = clock.monotonic()
        run.manager.start()
        assert not run.manager.watch()
        assert clock.monotonic() - began < 10.0
        assert run.said[-1].ending is not None
        assert run.said[-1].ending.lines[-1] == "over"


def test_signals_reach_what_the_manager_started(tmp_path: Path):
    """A module that is killed from outside is reported with the signal."""
    with lab(application(tmp_path, module("sleep", "60"))) as run:
        assert run.manager.start()
        os.kill(run.manager.units[0].pid, signal.SIGSEGV)
        assert not run.manager.watch()
        assert run.texts(Kind.FAILED) == ["sleep 60 ended: killed by SIGSEGV"]


def test_an_end_is_noticed_at_a_place_that_answers_slowly(tmp_path: Path):
    """Its answer comes after the manager has looked at the others; the module is restarted all the same."""
    (tmp_path / "slow.py").write_text(
        "import time\n"
        "from rtf.applications.deployers import LocalDeployer\n"
        "class Slow(LocalDeployer):\n"
        "    def running(self):\n"
        f"        time.sleep({2 * LOOK})\n"
        "        return super().running()\n"
    )
    inside = '<deployer>slow</deployer><restart attempts="1" backoff="0.05">on-failure</restart>'
    content = shell(tmp_path, "one", f"echo x >> {tmp_path}/starts; sleep 1; exit 1", inside)
    with lab(application(tmp_path, content)) as run:
        assert run.manager.start()
        assert not run.manager.watch()
    assert (tmp_path / "starts").read_text() == "x\n" * 2
    assert len(run.texts(Kind.RESTARTED)) == 1


def test_an_end_is_noticed_while_ports_are_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A module that ends before all is connected is restarted at once."""
    monkeypatch.setattr("rtf.applications.manager._CONNECTING", 4.0)
    inside = '<restart attempts="1" backoff="0.05">on-failure</restart>'
    content = shell(tmp_path, "one", f"echo x >> {tmp_path}/starts; sleep 0.5; exit 1", inside) + ONE_CONNECTION
    with lab(application(tmp_path, content)) as run:
        assert not run.manager.start()
        assert len(run.texts(Kind.RESTARTED)) == 1
        assert run.texts(Kind.FAILED)
    assert (tmp_path / "starts").read_text() == "x\n" * 2


def test_deployer_is_a_plug_in(tmp_path: Path):
    """A file beside the application with a class derived from Deployer runs the modules that name it."""
    (tmp_path / "boat.py").write_text(
        "from rtf.applications.deployer import Deployer\n"
        "class Boat(Deployer):\n"
        "    aboard = {}\n"
        "    def start(self, request):\n"
        "        self.aboard[request.tag] = 7\n"
        "        return 7\n"
        "    def running(self):\n"
        "        return dict(self.aboard)\n"
        "    def signal(self, tag, signum):\n"
        "        return self.aboard.pop(tag, None) is not None\n"
    )
    with lab(application(tmp_path, module("row", "fast", "<deployer>boat</deployer>", node="lake"))) as run:
        assert run.manager.start()
        assert run.texts(Kind.STARTED) == ["row fast on lake is started (7)"]
        assert run.manager.stop()
        assert run.texts(Kind.STOPPED) == ["row fast on lake is stopped"]


def test_modules_are_started_and_stopped_one_by_one(tmp_path: Path):
    """Connections of started ones are made, a waiting one stops waiting, and what was stopped is no failure."""
    content = module("sleep", "60") + module("sleep", "61") + module("sleep", "62", needs("/never"))
    with lab(application(tmp_path, content)) as run:
        first, second, waiting = run.manager.units
        run.manager.begin([first, waiting])
        eventually(lambda: run.states() == [State.RUNNING, State.STOPPED, State.WAITING], "it is not started")
        assert run.manager.halt([first, waiting])
        run.manager.watch_once()
        assert run.states() == [State.STOPPED] * 3
        assert run.texts(Kind.FAILED) == run.texts(Kind.ENDED) == []
        run.manager.begin([first, second])
        eventually(lambda: run.states() == [State.RUNNING, State.RUNNING, State.STOPPED], "it is not started again")
        assert run.manager.halt([first], kill=True)
        assert run.texts(Kind.STOPPED) == ["sleep 60 is stopped", "sleep 60 is killed"]
        assert not alive(first.pid)
        assert alive(second.pid)


def test_connections_are_made_one_by_one(tmp_path: Path):
    """Only wanted connections are made and kept; one that was ended is left alone."""
    both = ONE_CONNECTION + "<connection><from>/a</from><to>/c</to></connection>"
    with lab(application(tmp_path, both)) as run, contextlib.ExitStack() as ports:
        for name in ("/a", "/b", "/c"):
            ports.enter_context(BufferedPort(name, network=run.network))
        first, _ = run.manager.application.connections
        links = run.manager.links
        assert links.connect([first])
        links.watch()
        assert [state for _, state in links.states()] == [Link.CONNECTED, Link.APART]
        assert links.disconnect([first])
        links.watch()
        assert [state for _, state in links.states()] == [Link.APART, Link.APART]


def test_connections_that_are_being_made_can_be_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The one that is made at that moment is ended, and those that would follow are not made."""
    both = ONE_CONNECTION + "<connection><from>/a</from><to>/c</to></connection>"
    with lab(application(tmp_path, both)) as run, contextlib.ExitStack() as ports:
        for name in ("/a", "/b", "/c"):
            ports.enter_context(BufferedPort(name, network=run.network))
        links, connect = run.manager.links, connections.connect
        ending = threading.Thread(target=links.disconnect)

        def ended_meanwhile(network: Network, connection: Connection) -> None:
            if not ending.ident:
                ending.start()
                ending.join(0.3)  # unless it waits for the connection
            connect(network, connection)

        monkeypatch.setattr(connections, "connect", ended_meanwhile)
        links.connect()
        ending.join()
        assert [state for _, state in links.states()] == [Link.APART, Link.APART]
        assert run.texts(Kind.STOPPED) == ["/a -> /b is disconnected"]


def test_connections_of_windows_that_are_not_there_are_left_out(tmp_path: Path):
    """By the name of the program, and by the name that its command line gives to its ports; others are made."""
    content = (
        module("sleep", "60")
        + module("yarpview", "--name /picture")
        + module("iCubGui")
        + ONE_CONNECTION
        + "".join(
            f"<connection><from>/a</from><to>{port}</to></connection>" for port in ("/picture", "/iCubGui/objects")
        )
    )
    network = Network(LocalNames())
    with (
        Port("/a", network=network),
        Port("/b", network=network),
        lab(application(tmp_path, content), network) as run,
    ):
        assert run.manager.start()
        assert remote.connection(network, Contact("/a"), Contact("/b")) is not None
        assert len(run.texts(Kind.IGNORED)) == 2
