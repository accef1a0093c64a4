"""``rtf robotinterface`` as a process: its output, signals in each phase, and exit codes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from lxml import etree

from rtf.bottle import Bottle
from rtf.middleware.naming import configuration
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient
from scripted_devices import action_xml as action
from scripted_devices import device_xml as device
from scripted_devices import install, robot_xml
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Iterator

TESTS = Path(__file__).parents[1]
RECORDED = TESTS / "data" / "yarp_config" / "fakerobot.xml"
_LIMIT = 60.0


class Program:
    """A run of the program; its messages and the calls of its devices go to files."""

    def __init__(self, lab: Lab, words: tuple[str, ...], environment: dict[str, str]) -> None:
        self._lab = lab
        self._err = lab.folder / "stderr.txt"
        with self._err.open("wb") as err, (lab.folder / "stdout.txt").open("wb") as out:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "rtf", "robotinterface", *words],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                env=environment,
                cwd=lab.folder,
            )

    @property
    def stderr(self) -> str:
        """The messages up to now."""
        return self._err.read_text(encoding="utf-8")

    @property
    def calls(self) -> list[str]:
        """The calls of the devices up to now."""
        return self._lab.log.read_text(encoding="utf-8").splitlines() if self._lab.log.exists() else []

    def until(self, text: str) -> None:
        """Wait for a message, or a call of a device."""

        def there() -> bool:
            return text in self.stderr or text in self.calls

        eventually(lambda: there() or self.process.poll() is not None, f"{text!r} does not come", _LIMIT)
        assert there(), self.stderr

    def send(self, *signals: signal.Signals) -> None:
        """Send signals, each after the program has noticed the one before."""
        for number, one in enumerate(signals, 1):
            before = self.stderr.count(": stop requested")
            self.process.send_signal(one)
            eventually(
                lambda before=before: self.stderr.count(": stop requested") > before or self.process.poll() is not None,
                f"signal {number} is not heard",
            )

    def end(self) -> int:
        """Wait for the end, and return the exit code."""
        code = self.process.wait(_LIMIT)
        assert "Traceback" not in self.stderr, self.stderr
        return code


class Lab:
    """A folder with a robot, a name server, and the started programs."""

    def __init__(self, folder: Path, server: NameServer) -> None:
        self.folder = folder
        self.log = folder / "log.txt"
        self.server = server
        self._environment = {**os.environ, "NO_COLOR": "1"}
        self._environment["PYTHONPATH"] = os.pathsep.join([str(install(folder / "site")), str(TESTS)])
        self.programs: list[Program] = []

    def write(self, inside: str, attributes: str = 'build="1" portprefix="/bot"') -> None:
        """Write the robot's file, with devices that log their calls."""
        text = re.sub(r"(<device [^>]*>)", rf'\1<param name="log">{self.log}</param>', inside)
        (self.folder / "robot.xml").write_text(robot_xml(text, attributes), encoding="utf-8")

    def start(self, *words: str) -> Program:
        """Start the program."""
        self.programs.append(Program(self, words or ("--config", "robot.xml"), self._environment))
        return self.programs[-1]

    def run(self, *words: str) -> Program:
        """Run the program to its end."""
        program = self.start(*words)
        program.end()
        return program

    def ask(self, question: str) -> str:
        """Send a request to the program's port."""
        with RpcClient("/asks", "/bot/yarprobotinterface", network=Network(configuration.find_names())) as client:
            return client.call(Bottle.parse(question), timeout=10).to_text()


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    """A lab; the test must end its programs, and leave no registered name."""
    monkeypatch.setenv("YARP_CONFIG_HOME", str(tmp_path / "user"))
    monkeypatch.setenv("YARP_DATA_HOME", str(tmp_path / "user"))
    for name in ("YARP_NAMESPACE", "YARP_PORT_PREFIX", "YARP_ROBOT_NAME"):
        monkeypatch.delenv(name, raising=False)
    with NameServer() as server:
        configuration.write_place(server.contact)
        made = Lab(tmp_path, server)
        yield made
        left = [program for program in made.programs if program.process.poll() is None]
        for program in left:
            program.process.kill()
            program.process.wait()
        assert [program.stderr for program in left] == []


BOARD = device("board")
STUB = device("stub", inside=action("attach", level=5, device="board") + action("detach", "shutdown", 5))


def calibrator(inside: str = "", **parameters: str) -> str:
    """A calibrator with a calibration, a parking, and these actions."""
    actions = action("calibrate", level=10, target="board") + action("park", "shutdown", 2, target="board")
    return device("cal", "scriptedCalibrator", actions + inside, **parameters)


def custom(*places: tuple[str, int]) -> str:
    """Custom actions at these places, which log their phase and level."""
    return "".join(action("custom", phase, level, name=f"{phase}{level}") for phase, level in places)


class TestRunning:
    """Runs from start to end."""

    @pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, "quit"])
    def test_from_start_to_end(self, lab: Lab, how: signal.Signals | str):
        """The program logs each step with its duration, answers requests, ends with 0, and unregisters its names."""
        lab.write(BOARD + STUB + calibrator())
        program = lab.start()
        program.until("bot is ready")
        assert [lab.ask(one) for one in ("get_phase", "is_ready", "get_robot")] == ["run", "[ok]", "bot"]
        if how == "quit":
            assert lab.ask("quit") == "bye"
        else:
            program.send(how)
        assert program.end() == 0, program.stderr
        assert program.calls == [
            *("board open", "stub open", "cal open", "stub attach board=board", "cal calibrate board"),
            *("cal park board", "stub detach", "cal close", "stub close", "board close"),
        ]
        lines = program.stderr.splitlines()
        assert any(re.fullmatch(r"\[INFO\] opened stub \(scripted\) in \d+ ms \[2/3\]", line) for line in lines)
        assert any(re.fullmatch(r"\[INFO\] park of cal \(shutdown, level 2\) done in \d+ ms", line) for line in lines)
        assert re.fullmatch(r"\[INFO\] FINE: bot ran and was closed in order \(.*s\)", lines[-1])
        assert configuration.find_names().query("/bot/yarprobotinterface") is None

    def test_autoclose(self, lab: Lab):
        """With the option the program ends as soon as it is ready."""
        lab.write(BOARD)
        program = lab.run("--config", "robot.xml", "--autocloseAfterStart")
        assert program.process.returncode == 0
        assert program.calls == ["board open", "board close"]

    def test_values_from_the_command_line(self, lab: Lab):
        """An option sets a parameter with its extern-name; unused options are warnings; the prefix is used."""
        inside = '<action phase="startup" level="1" type="custom"><param name="n" extern-name="my">0</param></action>'
        lab.write(device("one", inside=inside, at="${portprefix}"))
        words = (
            "--config",
            "robot.xml",
            "--my",
            "7",
            "--yours",
            "8",
            "--portprefix",
            "/other",
            "--autocloseAfterStart",
        )
        program = lab.run(*words)
        assert program.process.returncode == 0
        assert "one custom (n 7)" in program.calls
        assert "[WARNING] --yours: no parameter of the robot asks for it by extern-name" in program.stderr
        assert "--my:" not in program.stderr
        assert "port /other/yarprobotinterface answers requests" in program.stderr

    def test_a_device_that_cannot_be_opened(self, lab: Lab):
        """The exit code is 1, the error has device and place, and the last line is the result."""
        lab.write(BOARD + device("odd", "unheardOf"))
        program = lab.run()
        assert program.process.returncode == 1
        assert re.search(
            r"\[ERROR\] robot\.xml:5:1: odd \(unheardOf\) cannot be opened: there is no device type", program.stderr
        )
        assert program.stderr.splitlines()[-1].startswith(
            "[ERROR] FAILED: bot was never ready; what was open is closed"
        )
        assert program.calls == ["board open", "board close"]

    def test_a_second_one_is_refused(self, lab: Lab):
        """A second program for the same robot is refused."""
        lab.write(BOARD)
        first = lab.start()
        first.until("bot is ready")
        said = lab.folder / "first.txt"
        (lab.folder / "stderr.txt").rename(said)
        second = lab.run()
        assert second.process.returncode == 1
        assert "the port /bot/yarprobotinterface exists already" in second.stderr
        first.process.send_signal(signal.SIGINT)
        assert first.process.wait(_LIMIT) == 0
        assert lab.log.read_text().splitlines() == ["board open", "board close"]

    def test_no_name_server(self, lab: Lab):
        """Without a name server no device is opened, and the message has a hint."""
        lab.write(BOARD)
        lab.server.close()
        program = lab.run()
        assert program.process.returncode == 1
        assert "rtf nameserver" in program.stderr
        assert program.calls == []


class TestSignals:
    """Signals in each phase."""

    @pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
    def test_during_a_calibration(self, lab: Lab, number: signal.Signals):
        """A signal aborts the calibration; then actions of the interrupt, parking and closing run."""
        lab.write(BOARD + STUB + calibrator(custom(("startup", 11), ("interrupt1", 1)), calibrate="wait"))
        program = lab.start()
        program.until("cal calibrate board")
        program.send(number)
        assert program.end() == 1
        assert program.calls[5:] == [
            "cal abort",
            "cal custom (name interrupt11)",
            *("cal park board", "stub detach", "cal close", "stub close", "board close"),
        ]
        assert "calibrate of cal (startup, level 10) [scriptedCalibrator] failed: aborted" in program.stderr

    def test_while_a_device_hangs_in_open(self, lab: Lab):
        """The first signal waits for the opening, the second one abandons it, and the others are closed."""
        lab.write(BOARD + device("slow", open="hang") + STUB)
        program = lab.start()
        program.until("slow open")
        program.send(signal.SIGINT, signal.SIGINT)
        assert program.end() == 1
        assert "board close" in program.calls
        assert "stub open" not in program.calls
        assert "the opening of slow (scripted) has not returned" in program.stderr

    @pytest.mark.parametrize("where", ["attach", "detach"])
    def test_while_a_device_hangs_in_an_action(self, lab: Lab, where: str):
        """A second signal abandons an action that hangs."""
        actions = action("attach", level=1, device="board") + action("detach", "shutdown", 1)
        lab.write(BOARD + device("slow", inside=actions, **{where: "hang"}) + STUB)
        program = lab.start()
        program.until("slow attach board=board" if where == "attach" else "bot is ready")
        program.send(signal.SIGINT)
        if where == "detach":
            program.until("slow detach")
        program.send(signal.SIGINT)
        assert program.end() == 1
        assert "board close" in program.calls
        assert f"{where} of slow" in program.stderr
        assert "was not waited for" in program.stderr

    def test_while_a_device_hangs_in_close(self, lab: Lab):
        """A second signal abandons a device that hangs while it closes."""
        lab.write(BOARD + device("slow", close="hang"))
        program = lab.start()
        program.until("bot is ready")
        program.send(signal.SIGTERM)
        program.until("slow close")
        program.send(signal.SIGTERM)
        assert program.end() == 1
        assert program.calls[-1] == "board close"

    def test_hanging_is_bounded_without_signals(self, lab: Lab):
        """``--patience`` limits the wait for a device that hangs."""
        lab.write(BOARD + device("slow", open="hang"))
        program = lab.run("--config", "robot.xml", "--patience", "200ms")
        assert program.process.returncode == 1
        assert "the opening of slow (scripted) hangs since 200 ms" in program.stderr
        assert "board close" in program.calls

    def test_during_the_shutdown(self, lab: Lab):
        """A second signal aborts the parking, runs its actions, and then the rest of the shutdown."""
        lab.write(BOARD + STUB + calibrator(custom(("interrupt2", 1), ("interrupt1", 1)), park="wait"))
        program = lab.start()
        program.until("bot is ready")
        program.send(signal.SIGTERM)
        program.until("cal park board")
        assert lab.ask("get_phase") == "shutdown"
        program.send(signal.SIGTERM)
        assert program.end() == 1
        assert program.calls[-7:] == [
            *("cal park board", "cal abort", "cal custom (name interrupt21)"),
            *("stub detach", "cal close", "stub close", "board close"),
        ]

    def test_three_of_them(self, lab: Lab):
        """Each signal runs its actions at once, also if a calibrator ignores the abort."""
        inside = custom(("interrupt2", 1), ("interrupt3", 1)) + action("park", "interrupt1", 1, target="board")
        last = action("calibrate", "interrupt2", 2, target="board")
        lab.write(BOARD + STUB + calibrator(inside + last, park="deaf"))
        program = lab.start()
        program.until("bot is ready")
        program.send(signal.SIGINT)
        program.until("cal park board")
        program.send(signal.SIGINT)
        program.until("cal calibrate board")
        program.until("cal custom (name interrupt21)")
        program.send(signal.SIGINT)
        program.until("cal custom (name interrupt31)")
        program.send(signal.SIGINT)
        assert program.end() == 1
        # Calibrators park and are aborted in threads of their own. An abort is awaited two seconds at most: of the
        # parking twice, and of the calibration of the second interrupt if it has not ended when the third one comes. A
        # parking of a shutdown that is aborted is not awaited: on a busy machine its thread may begin after the rest.
        assert program.calls.count("cal abort") in (2, 3)
        done = [call for call in program.calls if call not in {"cal abort", "cal park board"}]
        assert done[-4:] == ["stub detach", "cal close", "stub close", "board close"]
        assert "park of cal (interrupt1, level 1) has not returned" in program.stderr

    def test_a_device_that_takes_the_process_with_it(self, lab: Lab):
        """A device that kills the process ends it without closing the others."""
        lab.write(BOARD + device("bomb", open="crash"))
        program = lab.start()
        assert program.process.wait(_LIMIT) == -signal.SIGKILL
        assert "board close" not in program.calls


class TestUsage:
    """Wrong command lines and files, dry runs, and help."""

    def test_dry_run(self, lab: Lab):
        """A dry run prints and draws the plan, opens no device, and needs no name server."""
        lab.server.close()
        lab.write(BOARD + STUB + device("a&lt;&amp;&quot;b", "no-such-type"))
        program = lab.run("--config", "robot.xml", "--dryrun", "--svg", "plan.svg")
        assert program.process.returncode == 0
        assert program.calls == []
        assert "attach stub to board" in (lab.folder / "stdout.txt").read_text()
        texts = [*etree.parse(lab.folder / "plan.svg").getroot().itertext()]
        assert 'a<&"b (no-such-type)' in texts

    def test_dry_run_in_any_locale(self, lab: Lab):
        """The plan is printed in UTF-8 in any locale; a closed output causes no traceback."""
        lab.write(BOARD + calibrator())
        lab._environment |= {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
        program = lab.run("--config", "robot.xml", "--dry-run")
        assert program.process.returncode == 0
        assert "∥ calibrate board by cal" in (lab.folder / "stdout.txt").read_text(encoding="utf-8")
        reading, writing = os.pipe()
        os.close(reading)
        words = [sys.executable, "-m", "rtf", "robotinterface", "--config", "robot.xml", "--dry-run"]
        done = subprocess.run(
            words, stdout=writing, stderr=subprocess.PIPE, env=lab._environment, cwd=lab.folder, check=False
        )
        os.close(writing)
        assert (done.returncode, done.stderr) == (3, b"")

    def test_every_mistake_is_reported(self, lab: Lab):
        """All problems of the file are reported, with exit code 4, and no device is opened."""
        lab.write(BOARD + device("stub", inside=action("attach", device="bord")) + "<odd/>")
        program = lab.run()
        assert program.process.returncode == 4
        lines = program.stderr.splitlines()
        assert len(lines) == 2
        assert re.match(r"\[ERROR\] robot\.xml:6:1: <odd> is not allowed in <robot>", lines[0])
        assert re.match(
            r"\[ERROR\] robot\.xml:5:.*attach of stub .*there is no device 'bord'; is it 'board'\?", lines[1]
        )
        assert program.calls == []

    @pytest.mark.parametrize(
        ("words", "complaint"),
        [
            ((), "there is no --config"),
            (("--config",), "expected one argument"),
            (("--config", "nothing.xml"), "nothing.xml: not found"),
            (("robot.xml",), "'robot.xml' stands alone"),
            (("--config", "robot.xml", "--patience", "long"), "is no duration"),
            (("--config", "robot.xml", "--svg", "x.svg"), "it goes with --dry-run"),
            (("--config", "robot.xml", "--dry-run", "--svg", "no/x.svg"), "write to a folder that is there"),
        ],
    )
    def test_wrong_usage(self, lab: Lab, words: tuple[str, ...], complaint: str):
        """A wrong command line ends with 4, and a message."""
        lab.write(BOARD)
        program = Program(lab, words, lab._environment)
        assert program.end() == 4
        assert complaint in program.stderr

    def test_help_teaches(self, lab: Lab):
        """The help has phases, options, examples and exit codes."""
        program = lab.run("--help")
        assert program.process.returncode == 0
        text = (lab.folder / "stdout.txt").read_text()
        for word in ("interrupt2", "--dry-run", "examples:", "exit codes:", "extern-name", "--allow-deprecated-dtd"):
            assert word in text

    def test_a_configuration_is_found_where_yarp_looks(self, lab: Lab):
        """The configuration is found by the default file in the folder of YARP_ROBOT_NAME."""
        home = lab.folder / "user" / "robots" / "mine"
        home.mkdir(parents=True)
        lab.write(BOARD)
        (lab.folder / "robot.xml").rename(home / "mine.xml")
        (home / "yarprobotinterface.ini").write_text("config mine.xml\n")
        lab._environment["YARP_ROBOT_NAME"] = "mine"
        program = Program(lab, ("--dry-run",), lab._environment)
        assert program.end() == 0, program.stderr
        assert "board (scripted)" in (lab.folder / "stdout.txt").read_text()
