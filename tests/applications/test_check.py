"""What is found in an application before it is started."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab import application, module, needs
from rtf.applications.check import check_application
from rtf.applications.connections import read_qos
from rtf.applications.ports import Order, ports_of
from rtf.applications.run.server import RunServer
from rtf.applications.xml.model import Application, Module, Text
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.qos import Qos, QosError
from rtf.testing.suite.diagnostics import DiagnosticLog

if TYPE_CHECKING:
    from pathlib import Path

DESCRIPTIONS = {
    "cat": """<module><name>cat</name>
      <arguments><param required="yes" desc="the camera">device</param><param default="/cam">name</param></arguments>
      <data><output><type>yarp::sig::Image</type><port>/cam/out</port></output></data></module>""",
    "tee": """<module><name>tee</name><data>
      <input><type>Bottle</type><port>/tee/in</port></input>
      <input><type>Image</type><port>/tee/image</port><required>yes</required></input></data></module>""",
}
CAT = module("cat", "--device 0")
TEE = module("tee")
FEED = "<connection><from>/cam/out</from><to>/tee/image</to></connection>"


def connection(source: str, target: str, carrier: str = "tcp", more: str = "") -> str:
    """Write a connection."""
    return f"<connection {more}><from>{source}</from><to>{target}</to><protocol>{carrier}</protocol></connection>"


def problems(folder: Path, content: str, network: Network | None = None) -> list[str]:
    """Return what is found in an application of described programs."""
    (folder / "modules").mkdir(exist_ok=True)
    for name, text in DESCRIPTIONS.items():
        (folder / "modules" / f"{name}.xml").write_text(text)
    log = DiagnosticLog()
    check_application(application(folder, content), log, network)
    return [str(one) for one in log]


def test_sound_application(tmp_path: Path):
    """Two programs whose ports fit have no problem."""
    assert problems(tmp_path, CAT + TEE + FEED) == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (CAT + CAT, "error: cat --device 0 opens the port /cam/out, and so does cat --device 0 (give one of them"),
        (module("sleep", "5 --name /x") + module("sh", "--name x"), "sh --name x opens the port /x, and so does sleep"),
        (module("cat"), "error: cat needs the argument --device (the camera)"),
        (TEE, "error: nothing is connected to /tee/image, which tee requires"),
        (CAT + TEE + FEED + connection("/cam/out", "/tee/in"), "yarp::sig::Image is sent, and Bottle is read"),
        (CAT + TEE + FEED + connection("/tee/in", "/cam/out"), "is the wrong way round: /tee/in is an input"),
        (CAT + TEE + FEED + FEED, "warning: /cam/out -> /tee/image is there more than once"),
        (CAT + connection("/cam/out", "/gone"), "error: no program opens the port /gone"),
        (module("sh", "/mine") + connection("/mine", "/gone"), "warning: no program opens the port /gone"),
        (CAT.replace("</module>", f"{needs('/cam/out')}</module>"), "modules wait for each other: cat -> cat"),
        (module("sleep") + connection("/a", "/b", "fast_tpc"), "there is no carrier 'fast_tpc' (did you mean 'fast_tc"),
        (module("sleep") + connection("/a", "/b", "h264"), "warning: /a -> /b: only programs of YARP have the carrier"),
        (module("sleep") + connection("/a", "/b", more='qos="level:top"'), "'top' is not a packet priority"),
        (module("no-such-program"), "error: there is no program 'no-such-program' (install it)"),
        (module("yarpdev"), "error: yarpdev is not there: devices are started from a robot"),
        (module("gzclient"), "warning: gzclient is not there: it is the window of a simulator"),
        (module("sleep", inside="<deployer>boat</deployer>"), "there is no deployer 'boat'; there are local, node"),
        (
            module("sleep", inside="<deployer>ssh</deployer><stdio>pc</stdio>", node="pc1"),
            "warning: sleep on pc1: no terminal is opened for a program that is started by ssh",
        ),
        (
            CAT + "<arbitrator><port>/cam/out</port><rule connection='c9'>x</rule></arbitrator>",
            "error: there is no connection with the id 'c9'",
        ),
    ],
)
def test_what_is_wrong_is_found(tmp_path: Path, content: str, message: str):
    """Each problem has its place."""
    found = problems(tmp_path, content)
    (line,) = [line for line in found if message in line] or [found]
    assert message in line
    assert f"{tmp_path}/" in line
    assert all("arbitrator" in content or one is line for one in found)


def test_network_is_asked(tmp_path: Path):
    """A node that does not answer and an external port that is not open are errors; those that are there are none."""
    network = Network(LocalNames())
    content = module("sleep", "5", node="node1") + (
        "<connection><from external='true'>/robot</from><to external='true'>/viewer</to></connection>"
    )
    with RunServer("/node1", network=network), Port("/robot", network=network), Port("/viewer", network=network):
        assert problems(tmp_path, content, network) == []
    found = problems(tmp_path, content, network)
    assert [line.partition("error: ")[2] for line in found] == [
        "there is no node /node1; 'rtf name runners' lists them (start it there: rtf run --server /node1)",
        "the external port /robot is not open (start its program)",
        "the external port /viewer is not open (start its program)",
    ]


def test_machines_are_compared_with_what_programs_need(tmp_path: Path):
    """A disabled machine is refused, and one with too little; numbers are at least, words the same."""
    (tmp_path / "resources").mkdir()
    computer = "<computer><name>{}</name><disable>{}</disable><memory><free>{}</free></memory><os>Linux</os></computer>"
    rows = [computer.format(*row) for row in (("big", "no", 8), ("small", "no", 2), ("off", "yes", 8))]
    (tmp_path / "resources" / "lab.xml").write_text(f"<resources>{''.join(rows)}</resources>")
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "sleep.xml").write_text(
        "<module><name>sleep</name><dependencies><computer><memory><free>4</free></memory><os>linux</os></computer>"
        "</dependencies></module>"
    )
    content = "".join(module("sleep", "5", node=node) for node in ("big", "small", "off"))
    assert [line.partition("error: ")[2] for line in problems(tmp_path, content)] == [
        "sleep cannot run on small: memory.free of 4 is needed, 2 is there (choose another node)",
        f"the machine off is disabled, by {tmp_path}/resources/lab.xml:1:230 (choose another node)",
    ]


@pytest.mark.parametrize(
    ("module_", "port", "opens"),
    [
        (Module(Text("x"), Text("--name /a")), "/a", True),
        (Module(Text("x"), Text("--name /a")), "/a/b", True),
        (Module(Text("x"), Text("--name /a")), "/ab", False),
        (Module(Text("x"), Text("--name a"), prefix="/p"), "/p/a/b", True),
        (Module(Text("yarp"), Text("read /rd")), "/rd", True),
        (Module(Text("x"), Text("--remote /other")), "/other", False),
        (Module(Text("x"), Text("--name")), "/x", False),
    ],
)
def test_ports_that_a_command_line_names(module_: Module, port: str, opens: bool):
    """The value of --name, or a first word that is a port, is the begin of a module's ports; other words are not."""
    assert ports_of(module_, None).opens(port) is opens


@given(st.sets(st.tuples(st.integers(0, 7), st.integers(0, 7)), max_size=12))
def test_order_is_that_of_dependencies(pairs: set[tuple[int, int]]):
    """Every module is in a later group than those for which it waits, or there is a circle."""
    modules = tuple(
        Module(
            Text(f"m{one}"),
            Text(f"--name /m{one}"),
            dependencies=tuple(needed(f"/m{other}/out") for first, other in sorted(pairs) if first == one),
        )
        for one in range(8)
    )
    order = Order(Application(Text("a"), "a.xml", modules=modules), [ports_of(one, None) for one in modules])
    if order.circle:
        steps = [*zip(order.circle, order.circle[1:], strict=False)]
        assert all((later, earlier) in pairs for earlier, later in steps)
        return
    level = {index: number for number, group in enumerate(order.levels()) for index in group}
    assert sorted(level) == [*range(8)]
    assert all(level[other] < level[one] for one, other in pairs)


def needed(port: str) -> object:
    """Make a dependency."""
    from rtf.applications.xml.model import PortDependency

    return PortDependency(Text(port))


@pytest.mark.parametrize(
    ("text", "qos"),
    [
        ("", Qos()),
        ("level:high", Qos(tos=144)),
        ("dscp:AF11; priority:30; policy:1", Qos(tos=40, policy=1, priority=30)),
        ("TOS:8", Qos(tos=8)),
    ],
)
def test_quality_of_service(text: str, qos: Qos):
    """The forms of yarpmanager are read."""
    assert read_qos(text) == qos


@pytest.mark.parametrize("text", ["high", "level:", "tos:300", "priority:-1", "colour:red"])
def test_quality_of_service_that_is_none(text: str):
    """Anything else is refused."""
    with pytest.raises(QosError):
        read_qos(text)
