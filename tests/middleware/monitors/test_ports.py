"""Monitors at connections and ports, in Python and Lua, over real sockets: messages pass, change, are dropped."""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.errors import ConnectError
from rtf.middleware.monitors import attached
from rtf.middleware.monitors.events import EVENTS
from rtf.middleware.monitors.script import ScriptName
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.outputs import send_to_all
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.types import IMAGE, Image
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.outgoing_message import OutgoingMessage
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PYTHON = """
from rtf.bottle import Bottle, Property
from rtf.middleware.monitors import PortMonitor

class Monitor(PortMonitor):
    limit = 3
    def accept(self, message):
        return message.bottle[0] < self.limit
    def update(self, message):
        return Bottle([*message.bottle, "seen"])
    def update_reply(self, reply):
        return Bottle([*reply.bottle, "answered"])
    def setparam(self, settings):
        self.limit = settings.find("limit")
    def getparam(self):
        return Property({"limit": self.limit})
"""
LUA = """
local limit = 3
PortMonitor.create = function(info) return info:find("destination"):asString() == "/reader" or true end
PortMonitor.accept = function(thing) return thing:asBottle():get(0):asInt32() < limit end
PortMonitor.update = function(thing)
  local bottle = thing:asBottle()
  bottle:addString("seen")
  thing:setPortWriter(bottle)
  return thing
end
PortMonitor.update_reply = function(thing)
  local reply = yarp.Bottle()
  reply:append(thing:asBottle())
  reply:addString("answered")
  thing:setPortWriter(reply)
  return thing
end
PortMonitor.setparam = function(p) limit = p:find("limit"):asInt32() end
PortMonitor.getparam = function() local p = yarp.Property(); p:put("limit", limit); return p end
"""
SCRIPTS = {"py": PYTHON, "lua": LUA}


@pytest.fixture(params=["py", "lua"])
def kind(request: pytest.FixtureRequest, folder: Path) -> str:
    """The language of the script ``limit``."""
    (folder / f"limit.{request.param}").write_text(SCRIPTS[request.param])
    return str(request.param)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where scripts are found."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def said() -> list[str]:
    """What the network reports."""
    return []


@pytest.fixture
def network(said: list[str]) -> Network:
    """A network of this process, with real sockets."""
    made = Network(LocalNames())
    made.report = said.append
    return made


@pytest.fixture
def got() -> list[str]:
    """What the reader has got."""
    return []


@pytest.fixture
def reader(network: Network, got: list[str]) -> Iterator[Port]:
    """A port that keeps what arrives."""
    with Port("/reader", lambda message: got.append(message.read().to_text()), network=network) as port:
        yield port


def write(network: Network, carrier: str, *messages: Bottle, name: str = "/writer") -> None:
    """Send messages by a carrier, and wait until each has been handled."""
    with Port(name, network=network, inputs=False) as writer:
        writer.add_output("/reader", carrier)
        for message in messages:
            writer.write(message)


NUMBERS = [Bottle([number]) for number in (1, 5, 2)]


@pytest.mark.parametrize("side", ["recv", "send"])
@pytest.mark.parametrize("carrier", ["tcp", "text_ack"])
def test_messages_are_dropped_and_changed(
    network: Network, reader: Port, got: list[str], kind: str, side: str, carrier: str
):
    """At either end, by binary and by text carriers."""
    write(network, f"{carrier}+{side}.portmonitor+type.{kind}+file.limit", *NUMBERS)
    assert got == ["1 seen", "2 seen"]


@pytest.mark.parametrize("side", ["recv", "send"])
def test_replies_are_changed_and_dropped_requests_are_answered(network: Network, kind: str, side: str):
    """A client does not wait for what is not delivered."""
    with (
        RpcServer("/server", lambda request: request, network=network),
        RpcClient("/client", network=network) as client,
    ):
        client.add_output("/server", f"tcp+{side}.portmonitor+type.{kind}+file.limit")
        assert client.call(Bottle([1])).to_text() == "1 seen answered"  # type: ignore[union-attr]
        assert client.call(Bottle([5]), timeout=5.0) in (None, Bottle())
        assert client.call(Bottle([2])).to_text() == "2 seen answered"  # type: ignore[union-attr]


def test_settings_are_asked_for_and_changed(network: Network, reader: Port, got: list[str], kind: str):
    """By the commands of administration, for a connection and for a whole port."""
    with Port("/writer", network=network) as writer, RpcClient("/admin", "/reader", network=network) as admin:
        writer.add_output("/reader", f"tcp+recv.portmonitor+type.{kind}+file.limit")
        ask = admin_of(admin)
        assert ask("[get] [in] /writer") == "((limit 3))"
        assert ask("[set] [in] /writer (limit 9)").startswith("0 ")
        writer.write(Bottle([5]))
        assert ask("[get] [in] /writer") == "((limit 9))"
    assert got == ["5 seen"]


def admin_of(client: RpcClient):
    """Ask a port itself."""
    from rtf.middleware.types.codecs import BOTTLE
    from rtf.middleware.wire.outgoing_message import OutgoingMessage

    output = client.outputs[0]
    return lambda text: output.call(  # type: ignore[union-attr]
        OutgoingMessage("a", Bottle.parse(text), BOTTLE, client.network.dialect), BOTTLE, 5.0
    ).to_text()


@pytest.mark.parametrize("way", ["in", "out"])
def test_a_whole_port_has_a_monitor(network: Network, reader: Port, got: list[str], kind: str, way: str):
    """Attached and detached while it is used; connections that come later have it, too."""
    with Port("/writer", network=network) as writer:
        writer.add_output("/reader")
        port = writer if way == "out" else reader
        with RpcClient("/admin", port.name, network=network) as admin:
            ask = admin_of(admin)
            assert ask(f"[get] [{way}] {port.name}").startswith("[fail]")
            assert ask(f'[atch] [{way}] "(type {kind}) (file limit)"') == "[ok]"
            writer.write(Bottle([5]))
            writer.write(Bottle([1]))
            assert ask(f"[get] [{way}] {port.name}") == "((limit 3))"
            writer.remove_output("/reader")
            writer.add_output("/reader")
            writer.write(Bottle([2]))
            assert ask(f"[dtch] [{way}]") == "[ok]"
            assert ask(f"[dtch] [{way}]") == "[fail]"
            writer.write(Bottle([5]))
    assert got == ["1 seen", "2 seen", "5"]


NOTHING = """
from rtf.middleware.monitors import PortMonitor
class Monitor(PortMonitor):
    def accept(self, message):
        return False
"""


def test_no_message_passes_a_monitor_when_its_connection_ends(
    network: Network, reader: Port, got: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch
):
    """A message that another thread sends meanwhile is looked at by the monitor, or is not sent any more."""
    (folder / "nothing.py").write_text(NOTHING)
    with Port("/writer", network=network) as writer:
        writer.add_output("/reader", "tcp+send.portmonitor+type.py+file.nothing")
        output, ended = writer.outputs[0], threading.Event()
        message = OutgoingMessage("D", Bottle(["unseen"]), BOTTLE, network.dialect)

        def end(monitor: attached.Attached, reason: str = "", end=attached.Attached.end) -> None:
            end(monitor, reason)
            send_to_all([output], message, lambda *_: None)
            ended.set()

        monkeypatch.setattr(attached.Attached, "end", end)
        writer.remove_output("/reader")
        assert ended.is_set()
        writer.add_output("/reader")
        writer.write(Bottle(["last"]))
    assert got == ["last"]


def test_no_message_passes_while_a_monitor_is_replaced(
    network: Network, reader: Port, got: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch
):
    """A message that is written when the old one ends is looked at by the new one."""
    (folder / "nothing.py").write_text(NOTHING)
    with Port("/writer", network=network) as writer:
        writer.add_output("/reader")
        writer.attach_monitor("out", ScriptName("py", "nothing"))
        written: list[int] = []

        def end(monitor: attached.Attached, reason: str = "", end=attached.Attached.end) -> None:
            end(monitor, reason)
            written.append(writer.write(Bottle(["unseen"])))

        with monkeypatch.context() as patch:
            patch.setattr(attached.Attached, "end", end)
            writer.attach_monitor("out", ScriptName("py", "nothing"))
        assert written == [0]
    assert got == []


HANGING = {
    "raises.py": ("raise ValueError('no')", "ValueError: no"),
    "loops.py": ("while True: pass", "took more than 1 s"),
    "catches.py": (
        "while True:\n            try:\n                x = 1\n            except Exception: pass",
        "took more than 1 s",
    ),
    "answers.py": ("return object()", "no codec for the type object"),
    "raises.lua": ("error('no')", "raises.lua:2: no"),
    "loops.lua": ("while true do end", "loops.lua:2: more than"),
    "catches.lua": ("while true do pcall(function() while true do end end) end", "more than"),
    "eats.lua": ("local t = {} while true do t[#t + 1] = string.rep('x', 100000) .. #t end", "not enough memory"),
    "fills.lua": ("local b = yarp.Bottle() while true do b:addInt32(1) end", "no list of more than"),
    "opens.lua": ("io.open('/etc/passwd')", "attempt to index a nil value"),
    "digs.lua": ("return thing._message", "_message is closed to scripts"),
}
#: Those that only the time ends.
ENDLESS = {"loops.py", "catches.py", "catches.lua"}


@pytest.mark.parametrize("name", HANGING)
def test_a_script_that_fails_ends_its_monitoring_and_nothing_else(
    network: Network,
    reader: Port,
    got: list[str],
    said: list[str],
    folder: Path,
    name: str,
    monkeypatch: pytest.MonkeyPatch,
):
    """It is told why, and the messages pass as they are."""
    body, reason = HANGING[name]
    if name not in ENDLESS:  # these fail by themselves, however slow this machine is
        monkeypatch.setattr(attached, "LIMIT", 60.0)
    file, kind = name.split(".")
    if kind == "py":
        head = "from rtf.middleware.monitors import PortMonitor\nclass Monitor(PortMonitor):\n"
        text = f"{head}    def update(self, message):\n        {body}\n"
    else:
        text = f"PortMonitor.update = function(thing)\n{body}\nend\n"
    (folder / name).write_text(text)
    write(network, f"tcp+recv.portmonitor+type.{kind}+file.{file}", *NUMBERS)
    assert got == ["1", "5", "2"]
    (line,) = [line for line in said if "port monitor" in line]
    assert reason in line
    assert "messages pass as they are" in line


@pytest.mark.parametrize(
    ("modifiers", "words"),
    [
        ("type.lua+file.absent", "absent.lua is neither in the contexts nor among the shipped ones"),
        ("type.dll+file.x", "has the type lua or py, not 'dll'"),
        ("type.lua", "has a file"),
        ("type.py+file./etc/passwd", "is not the name of a script"),
        ("type.py+context.x/y+file.a", "is not the name of a script"),
        ("type.py+file.empty", "defines no class Monitor"),
        ("type.py+file.wrong", "SyntaxError"),
        ("type.lua+file.wrong", r"wrong.lua:1: .*expected"),
        ("type.lua+file.refuses", "did not begin"),
        ("type.py+file.limit+constraint.(a", "cannot be read"),
    ],
)
def test_what_cannot_be_used_is_refused(network: Network, reader: Port, folder: Path, modifiers: str, words: str):
    """By the sender for its own side; the connection is not made."""
    (folder / "empty.py").write_text("")
    (folder / "wrong.py").write_text("(")
    (folder / "wrong.lua").write_text("(")
    (folder / "refuses.lua").write_text("PortMonitor.create = function() return false end")
    (folder / "limit.py").write_text(PYTHON)
    with Port("/writer", network=network) as writer:
        with pytest.raises(ConnectError, match=words):
            writer.add_output("/reader", f"tcp+send.portmonitor+{modifiers}")
        assert writer.outputs == ()


def test_a_receiver_cuts_off_who_names_no_script_of_its_own(network: Network, reader: Port, said: list[str]):
    """And goes on."""
    with Port("/writer", network=network) as writer:
        with pytest.raises(ConnectError):
            writer.add_output("/reader", "tcp+recv.portmonitor+type.lua+file.absent")
        eventually(lambda: any("absent.lua is neither" in line for line in said), "nothing is reported")
        writer.add_output("/reader")
        assert writer.write(Bottle([1])) == 1


def test_a_reflex_wins_over_a_reach(network: Network, reader: Port, got: list[str], folder: Path):
    """Two connections into one port, exclusive by an event with a lifetime."""
    (folder / "reflex.lua").write_text(
        "PortMonitor.accept = function(t) PortMonitor.setEvent('e_reflex', 0.3) return true end"
    )
    (folder / "reach.lua").write_text(
        "PortMonitor.create = function() PortMonitor.setConstraint('not e_reflex') return true end"
    )
    with Port("/reach", network=network) as reach, Port("/reflex", network=network) as reflex:
        reach.add_output("/reader", "tcp+recv.portmonitor+type.lua+file.reach")
        reflex.add_output("/reader", "tcp+recv.portmonitor+type.lua+file.reflex")
        reach.write(Bottle(["reach", 1]))
        reflex.write(Bottle(["reflex"]))
        reach.write(Bottle(["reach", 2]))
        assert got == ["reach 1", "reflex"]
        eventually(lambda: not EVENTS.active(clock.current().now()), "the reflex does not end")
        reach.write(Bottle(["reach", 3]))
    assert got[2:] == ["reach 3"]
    eventually(lambda: not EVENTS.active(clock.current().now()), "events outlive their connections")


def test_monitors_are_triggered(network: Network, reader: Port, got: list[str], folder: Path):
    """Before others decide, and at an interval."""
    (folder / "tells.lua").write_text(
        "PortMonitor.trig = function() PortMonitor.setEvent('e_open') end\nPortMonitor.setTrigInterval(0.01)"
    )
    with Port("/quiet", network=network) as quiet:
        quiet.add_output("/reader", "tcp+recv.portmonitor+type.lua+file.tells")
        eventually(lambda: "e_open" in EVENTS.active(0.0), "it was not triggered")
    eventually(lambda: "e_open" not in EVENTS.active(0.0), "its event did not end with it")


def test_calls_of_a_monitor_are_one_after_the_other(network: Network, reader: Port, folder: Path, got: list[str]):
    """Also where a port has one for many connections."""
    (folder / "counts.py").write_text(
        "from rtf.bottle import Bottle\nfrom rtf.middleware.monitors import PortMonitor\n"
        "class Monitor(PortMonitor):\n    n = 0\n    def update(self, message):\n"
        "        n = self.n + 1\n        self.n = n\n        return Bottle([n])\n"
    )
    from rtf.middleware.monitors.script import ScriptName

    reader.attach_monitor("in", ScriptName("py", "counts"))
    threads = [
        threading.Thread(
            target=write, args=(network, "tcp", *([Bottle([0])] * 50)), kwargs={"name": f"/writer{number}"}
        )
        for number in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(map(int, got)) == [*range(1, 201)]


@pytest.mark.parametrize(
    ("settings", "sent", "expected"),
    [
        ("deadband+milli.100", [[1.0], [1.0625], [1.25], [[1.25]], [[1.3125]]], ["1.0", "1.25", "(1.25)"]),
        ("scale+milli.2500", [[2, "a", [4.0]]], ["5.0 a (10.0)"]),
        ("scale+unit.m_to_mm", [[2.0]], ["2000.0"]),
        ("loss+percent.100", [[1]], []),
        ("loss+percent.0", [[1]], ["1"]),
        ("latency+ms.1", [[1]], ["1"]),
        ("rate_limit+rate.1", [[1], [2]], ["1"]),
    ],
)
def test_shipped_monitors(
    network: Network,
    reader: Port,
    got: list[str],
    folder: Path,
    settings: str,
    sent: list[list[object]],
    expected: list[str],
):
    """Each does what it says."""
    write(network, f"tcp+send.portmonitor+type.py+file.{settings}", *map(Bottle, sent))
    assert got == expected


def test_pictures_are_made_smaller(network: Network, folder: Path):
    """Every other pixel of every other row."""
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    seen: list[Image] = []
    with (
        Port("/viewer", lambda message: seen.append(message.read(IMAGE)), network=network),
        Port("/camera", network=network) as camera,
    ):
        camera.add_output("/viewer", "tcp+recv.portmonitor+type.py+file.shrink+by.2")
        camera.write(Image(pixels))
        np.testing.assert_array_equal(seen[0].pixels, pixels[::2, ::2])


def test_a_profiler_runs_after_a_call_that_took_too_long(network: Network, reader: Port, folder: Path, said: list[str]):
    """No exception is left on its way, and none is looked for: Python would look for it for ever."""
    (folder / "loops.py").write_text(
        "from rtf.middleware.monitors import PortMonitor\nclass Monitor(PortMonitor):\n    def accept(self, message):\n"
        "        while True: pass\n"
    )
    write(network, "tcp+recv.portmonitor+type.py+file.loops", Bottle([1]))
    assert any("took more than 1 s" in line for line in said)
    calls = []
    profiled = threading.Thread(target=lambda: (sys.setprofile(lambda *_: calls.append(1)), sorted([2, 1]), str(1)))
    profiled.start()
    profiled.join(20)
    assert not profiled.is_alive()
    assert calls


def test_the_watchdog_ends_with_the_monitors():
    """No thread is left."""
    eventually(lambda: not attached._WATCHDOG._watched, "a monitor is still watched")


def test_a_script_may_make_the_messages_that_go_on(network: Network, reader: Port, got: list[str], folder: Path):
    """As scripts for YARP do: a new Things with a vector, and nil for a message that is no vector."""
    (folder / "doubles.lua").write_text(
        """
        require("yarp")
        PortMonitor.create = function(info)
          return info:find("carrier"):asString() == "tcp+recv.portmonitor+type.lua+file.doubles"
        end
        PortMonitor.accept = function(thing) return thing:asVector() ~= nil end
        PortMonitor.update = function(thing)
          local numbers, twice = thing:asVector(), yarp.Vector(2)
          for i = 0, 1 do twice:set(i, numbers:get(i) * 2) end
          local made = yarp.Things()
          made:setPortWriter(twice)
          return made
        end
        """
    )
    carrier = "tcp+recv.portmonitor+type.lua+file.doubles"
    write(network, carrier, Bottle([1, 2]), Bottle([1.0, 2.5]), Bottle(["a", 2.0]))
    assert got == ["2.0 5.0"]
