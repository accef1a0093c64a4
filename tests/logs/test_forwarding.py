"""Forwarding of the standard library's logging: what YARP's programs would send, and nothing ever waits for it."""

from __future__ import annotations

import logging
import os
import platform
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from rtf import clock
from rtf.logs import forwarding
from rtf.logs.collector import Collector
from rtf.logs.forwarding import ForwardingHandler, Options
from rtf.logs.record import Level, LogRecord, from_bottle
from rtf.logs.store import LogStore
from rtf.middleware.ports.port import Port
from waiting import eventually

from .conftest import stored

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine the last records may take longer than a program should wait at its end."""
    monkeypatch.setattr(forwarding, "_CLOSING", 30.0)


@pytest.fixture
def logger(request: pytest.FixtureRequest) -> logging.Logger:
    """A logger of this test alone."""
    made = logging.getLogger(f"lab.{request.node.name}")
    made.setLevel(1)
    return made


@contextmanager
def forwarded(logger: logging.Logger, network: Network, **options: object) -> Iterator[ForwardingHandler]:
    """Forward what is logged in the block, up to the last record."""
    handler = ForwardingHandler(options=Options(**options), network=network)
    logger.addHandler(handler)
    try:
        yield handler
    finally:
        logger.removeHandler(handler)
        handler.close()


def test_records_arrive_with_their_levels_and_a_last_one(network: Network, file: Path, logger: logging.Logger):
    """Each level of logging is one of YARP's, the logger's name is the component, and the end is reported."""
    with LogStore(file) as store, Collector(store, network=network), forwarded(logger, network):
        for level in (5, 10, 20, 30, 40, 50):
            logger.log(level, "level %d", level)
        logger.info("arm", extra={"id": "left_arm"})
    found = stored(file)
    assert [(one.level, one.message) for one in found] == [
        *[(Level(number), f"level {level}") for number, level in enumerate((5, 10, 20, 30, 40, 50), 1)],
        (Level.INFO, "arm"),
        (Level.INFO, "Execution terminated"),
    ]
    assert found[6].to_console() == f"[INFO] |{logger.name}|left_arm| arm"
    sender = found[0].sender.split("/")
    assert (sender[:3], sender[4]) == (["", "log", platform.node()], str(os.getpid()))
    assert {(one.sender, one.details) for one in found} == {(found[0].sender, "")}
    assert abs(found[0].time - clock.now()) < 60


def test_details_are_those_of_yarp_in_their_order(network: Network, file: Path, logger: logging.Logger):
    """With all options a record has the groups of YARP's, in YARP's order; an exception is its backtrace."""
    options = {"code": True, "host": True, "process": True, "backtrace": True, "label": "2"}
    with LogStore(file) as store, Collector(store, network=network), forwarded(logger, network, **options):
        try:
            int("odd")
        except ValueError:
            logger.exception("it failed")
    one = stored(file)[0]
    assert one.sender.split("/")[3].endswith("[2]")
    keys = [group.split(" ")[0] for group in one.to_text()[1:].split(") (")]
    assert keys[:10] == [
        *("level", "systemtime", "filename", "line", "function", "hostname", "pid", "cmd", "args", "thread_id")
    ]
    assert keys[10:13] == ["component", "message", "backtrace"]
    assert one.detail("filename") == __file__
    assert one.detail("function") == "test_details_are_those_of_yarp_in_their_order"
    assert one.detail("thread_id") == threading.get_ident() & 0xFFFFFFFF
    assert one.message == "it failed"
    assert one.backtrace.endswith("ValueError: invalid literal for int() with base 10: 'odd'")


def test_an_exception_is_part_of_the_message_otherwise(network: Network, file: Path, logger: logging.Logger):
    """Without the option for backtraces, an exception is not lost."""
    with LogStore(file) as store, Collector(store, network=network), forwarded(logger, network):
        try:
            int("odd")
        except ValueError:
            logger.exception("it failed")
    assert stored(file)[0].message.startswith("it failed\nTraceback")


def test_the_time_of_a_simulation_is_the_network_time(network: Network, file: Path, logger: logging.Logger):
    """In a process whose robot has a clock of its own, a record has that time, too."""

    class Simulated(clock.Clock):
        def now(self) -> float:
            return 2.5

        def sleep(self, seconds: float) -> None:
            raise NotImplementedError

    with (
        LogStore(file) as store,
        Collector(store, network=network),
        forwarded(logger, network),
        clock.use(Simulated()),
    ):
        logger.info("then")
    assert stored(file)[0].detail("networktime") == 2.5


def test_variables_choose_the_details():
    """YARP's variables, and nothing else, choose what a record has."""
    assert Options.of({}) == Options()
    given = {"YARP_FORWARD_CODEINFO_ENABLE": "1", "YARP_FORWARD_PROCESSINFO_ENABLE": "0", "YARP_LOG_PROCESS_LABEL": "a"}
    assert Options.of(given) == Options(code=True, label="a")


def test_programs_forward_if_the_variable_says_so(monkeypatch):
    """A program forwards with YARP's variable only, and once however often it asks for it."""
    root = logging.getLogger()
    monkeypatch.setattr(root, "handlers", [])
    monkeypatch.setattr(root, "level", root.level)
    framework = logging.getLogger("rtf")
    monkeypatch.setattr(framework, "level", framework.level)
    monkeypatch.setenv("YARP_FORWARD_LOG_ENABLE", "0")
    assert forwarding.forward_if_enabled() is None
    monkeypatch.setenv("YARP_FORWARD_LOG_ENABLE", "1")
    made = forwarding.forward_if_enabled("rtf simulator")
    assert made is not None
    assert forwarding.forward_if_enabled() is made
    assert root.handlers == [made]
    assert made._program == "rtf-simulator"


def test_without_a_logger_the_program_goes_on(network: Network, logger: logging.Logger, capsys):
    """Without a collector one line says so, records are dropped, and a collector that comes later connects."""
    with forwarded(logger, network):
        logger.info("nobody hears this")
        eventually(lambda: network.names.list("/log"), "the port is not open")
    assert capsys.readouterr().err.count("no logger gets the records of this program yet") == 1
    assert not network.names.list("/log")


def test_a_late_logger_gets_what_comes_then(network: Network, file: Path, logger: logging.Logger, capsys):
    """The port of a program without a logger can be connected, as YARP's loggers do."""
    with forwarded(logger, network), LogStore(file) as store:
        logger.info("too early")
        eventually(lambda: "no logger" in capsys.readouterr().err, "the port is not open")
        with Collector(store, network=network) as collector:
            collector.connect_running()
            logger.info("heard")
            eventually(lambda: collector.written, "it was not stored")
    assert [one.message for one in stored(file)] == ["heard"]


def test_no_name_server_costs_nothing_but_a_line(logger: logging.Logger, network: Network, monkeypatch, capsys):
    """Without a name server the program goes on as if nothing were forwarded."""
    from rtf.middleware.errors import ConnectError

    def away(*_: object, **__: object) -> None:
        raise ConnectError("no name server answers")

    monkeypatch.setattr(network.names, "register", away)
    with forwarded(logger, network):
        logger.info("nobody hears this")
        eventually(lambda: "are not forwarded: no name server answers" in capsys.readouterr().err, "it was not said")
        logger.info("nor this")


def test_a_logger_that_stands_still_makes_no_one_wait(network: Network, logger: logging.Logger, monkeypatch):
    """Records beyond the limit are dropped, and counted by a warning when the logger goes on."""
    monkeypatch.setattr(forwarding, "LIMIT", 100)
    stopped, going = threading.Event(), threading.Event()
    heard: list[LogRecord] = []

    def take(message: IncomingMessage) -> None:
        stopped.set()
        going.wait(30)
        heard.append(from_bottle(message.read()))

    sent = 1
    with Port("/yarplogger", take, network=network), forwarded(logger, network) as handler:
        logger.info("first")
        assert stopped.wait(30)
        while handler.dropped < 10:  # the buffers of the kernel are full, then the queue
            logger.info("x" * 100_000)
            sent += 1
        going.set()
        handler.close()
        eventually(lambda: heard[-1].message == "Execution terminated", "the last record is missing")
    warnings = [one for one in heard if one.component == "rtf.logs" and one.level is Level.WARNING]
    lost = sum(int(one.message.split()[0]) for one in warnings)
    assert lost == handler.dropped
    assert len(heard) - len(warnings) - 1 == sent - lost


def test_a_fork_has_a_port_of_its_own(network: Network, file: Path, logger: logging.Logger):
    """A forked process opens its own port with its own process number, and sends nothing of its parent's."""
    with (
        LogStore(file) as store,
        Collector(store, network=network) as collector,
        forwarded(logger, network) as handler,
    ):
        logger.info("parent")
        eventually(lambda: collector.written, "it was not stored")
        pid = os.fork()
        if pid == 0:
            logger.info("child")
            handler.close()
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        logger.info("parent again")
    found = stored(file)
    mine, childs = ([one.message for one in found if one.sender.endswith(f"/{of}")] for of in (os.getpid(), pid))
    assert mine == ["parent", "parent again", "Execution terminated"]
    assert childs == ["child", "Execution terminated"]
