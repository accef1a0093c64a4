"""The phases of a robot whose devices work, fail, raise and hang at each step."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from rtf.robot.interface.device_thread import Patience
from rtf.robot.interface.model import Phase
from scripted_devices import action_xml as action
from scripted_devices import device_xml as device
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Bench, Running

    from rtf.robot.interface.robot_interface import RobotInterface

    Start = Callable[[RobotInterface], Running]

#: The scripted failures of a device, and the message about each.
BROKEN = {
    "fail": "as it was told to",
    "throw": "ValueError: as it was told to",
    "exit": "SystemExit: 7",
    "hang": "hangs",
}


def robot(**parameters: str) -> str:
    """A board, its server, a calibrator with these parameters, and a last device, with actions in all phases."""
    # What works may take longer.
    short = {name: {"timeout": "0.5"} for name, how in parameters.items() if how in ("hang", "wait")}
    stub = action("attach", level=5, device="board") + action("detach", "shutdown", 5)
    calibrator = (
        action("attach", level=7, device="board")
        + action("custom", level=8, name="tune")
        + action("calibrate", level=10, target="board", **short.get("calibrate", {}))
        + action("abort", "interrupt1", 1)
        + action("park", "shutdown", 2, target="board", **short.get("park", {}))
        + action("detach", "shutdown", 6)
    )
    last = action("attach", level=20, device="board") + action("detach", "shutdown", 20)
    return (
        device("board")
        + device("stub", inside=stub)
        + device("cal", "scriptedCalibrator", calibrator, **parameters)
        + device("last", inside=last)
    )


ORDERLY = [
    *("board open", "stub open", "cal open", "last open"),
    *("stub attach board=board", "cal attach board=board", "cal custom (name tune)", "cal calibrate board"),
    "last attach board=board",
    *("cal abort", "cal park board", "stub detach", "cal detach", "last detach"),
    *("last close", "cal close", "stub close", "board close"),
]


def test_a_run_keeps_its_order(bench: Bench):
    """Devices open in the order of the file, actions run by level, closing is in reverse; no error is logged."""
    outcome = bench.run(robot())
    assert outcome.good
    assert bench.calls == ORDERLY
    assert bench.errors() == []
    done = [re.sub(r" in [0-9.]+ m?s.*", "", sentence) for level, sentence in bench.logged if level == "INFO"]
    assert "opened cal (scriptedCalibrator)" in done
    assert "calibrate of cal (startup, level 10) done" in done
    assert "closed board (scripted)" in done


@pytest.mark.parametrize("how", BROKEN)
@pytest.mark.parametrize("where", ["attach", "custom", "calibrate", "abort", "park", "detach"])
def test_an_action_that_does_not_work(bench: Bench, where: str, how: str):
    """The error names device, action and place; all other devices run all their actions."""
    outcome = bench.run(robot(**{where: how}))
    assert not outcome.good
    (error, *_) = [one for one in bench.errors() if BROKEN[how] in one]
    assert re.search(rf"robot\.xml:\d+:\d+: {where} of cal \(\w+, level \d+\) \[scriptedCalibrator\] ", error), error
    for call in ORDERLY:
        if not call.startswith("cal"):
            assert call in bench.calls
    assert bench.calls[-4:] == ORDERLY[-4:]
    assert outcome.ready is (where in ("park", "detach", "abort"))
    assert bool(outcome.hanging) is (how == "hang")


@pytest.mark.parametrize("how", BROKEN)
def test_a_device_that_cannot_be_opened(bench: Bench, how: str):
    """The other devices are opened and closed, without actions, and the robot is not ready."""
    outcome = bench.run(robot(open=how))
    assert not outcome.ready
    assert any("cal (scriptedCalibrator)" in one and BROKEN[how] in one for one in bench.errors())
    others = [call for call in bench.calls if not call.startswith("cal")]
    opened = ["board open", "stub open", "last open"]
    assert others == [*opened, "last close", "stub close", "board close"]
    assert ("cal close" in bench.calls) is (how == "hang")  # one whose opening failed holds nothing


@pytest.mark.parametrize("how", BROKEN)
def test_a_device_that_cannot_be_closed(bench: Bench, how: str):
    """The other devices are closed, and the outcome is not good."""
    outcome = bench.run(robot(close=how))
    assert outcome.ready
    assert not outcome.good
    assert bench.calls == ORDERLY
    assert any("cal (scriptedCalibrator)" in one and BROKEN[how] in one for one in bench.errors())


@pytest.mark.parametrize("kind", ["unheardOf", "notADevice", "notThere"])
def test_an_unknown_type(bench: Bench, kind: str):
    """A device of an unknown or unusable type counts as a device that cannot be opened."""
    outcome = bench.run(device("board") + device("odd", kind))
    assert not outcome.ready
    assert kind in outcome.failures[0]
    assert bench.calls == ["board open", "board close"]


def test_what_a_device_does_not_offer(bench: Bench):
    """Calibrate, park, custom and attach of a device without that interface fail; abort and configure do nothing."""
    actions = (
        action("abort", level=1)
        + action("configure", level=1)
        + action("custom", level=2, name="x")
        + action("calibrate", level=3, target="board")
        + action("park", level=3, target="board")
        + action("attach", level=4, device="board")
    )
    outcome = bench.run(device("board") + device("plain", "plain", actions))
    assert [one.partition("] failed: ")[2] for one in outcome.failures] == [
        "plain (Plain) has no custom actions",
        "plain (Plain) is not a calibrator",
        "plain (Plain) is not a calibrator",
        "plain (Plain) cannot be attached to board",
    ]


def test_calibrations_of_a_level_go_on_together_and_the_next_level_waits(bench: Bench, started: Start):
    """All calibrations of a level run at the same time; the next level begins when all have ended."""
    both = "".join(
        device(f"cal{n}", "scriptedCalibrator", action("calibrate", level=2, target=f"board{n}"), calibrate="hang")
        for n in (1, 2)
    )
    running = started(
        bench.make(device("board1") + device("board2") + both + device("late", inside=action("custom", level=3)))
    )
    eventually(lambda: {"cal1 calibrate board1", "cal2 calibrate board2"} <= {*bench.calls}, "they do not begin")
    assert (running.interface.phase, running.interface.level) == (Phase.STARTUP, 2)
    assert not running.interface.ready
    assert "late custom " not in bench.calls
    from scripted_devices import let_go

    let_go()
    eventually(lambda: running.interface.ready, "it does not become ready")
    assert "late custom " in bench.calls
    running.interface.quit()
    assert running.end().good


def test_a_calibration_that_takes_too_long_is_aborted(bench: Bench):
    """After its timeout the calibrator is aborted, the rest of the startup runs, and the robot is not ready."""
    outcome = bench.run(robot(calibrate="wait"))
    assert "cal abort" in bench.calls[bench.calls.index("cal calibrate board") :]
    assert not outcome.ready
    assert outcome.hanging == ()
    assert "last attach board=board" in bench.calls


def test_a_board_gets_its_calibrator(bench: Bench):
    """The interface hands a board its calibrator before the calibration, for later requests of clients."""
    calibrator = device("cal", "scriptedCalibrator", action("calibrate", target="board"))
    assert bench.run(device("board", "scriptedBoard") + calibrator).good
    assert bench.calls[2:4] == ["board set_calibrator cal", "cal calibrate board"]


def test_a_describing_device_gets_all_devices(bench: Bench):
    """A robotDescription device is attached to the list of all devices, whatever its attach names."""
    describing = device("all", "robotDescription_nws_yarp", action("attach", device="nobody"))
    assert bench.run(device("a") + describing).good
    assert "all attach robotDescription ('a', 'scripted') ('all', 'robotDescription_nws_yarp')" in bench.calls


def test_devices_are_attached_under_the_names_that_the_file_has_for_them(bench: Bench):
    """A device is attached under its own name or that of its network; ``all`` attaches all others."""
    attaches = (
        action("attach", level=1, device="a")
        + action("attach", level=2, device="a", network="left")
        + action("attach", level=3, networks="(left right)", left="a", right="b")
        + action("attach", level=4, all="1")
    )
    assert bench.run(device("a") + device("b") + device("c", inside=attaches)).good
    assert [call for call in bench.calls if "attach" in call] == [
        "c attach a=a",
        "c attach left=a",
        "c attach left=a right=b",
        "c attach a=a b=b",
    ]


@pytest.mark.parametrize("reverse", [True, False])
def test_levels_of_the_shutdown_may_be_reversed(bench: Bench, reverse: bool):
    """The attribute reverses the levels of interrupts and shutdown, not those of the startup."""
    inside = "".join(
        action("custom", phase, level, name=f"{phase}{level}")
        for phase in ("startup", "interrupt1", "shutdown")
        for level in (2, 1)
    )
    bench.run(device("one", inside=inside), f'build="1" reverse-shutdown-action-order="{str(reverse).lower()}"')
    order = (2, 1) if reverse else (1, 2)
    assert [call for call in bench.calls if "custom" in call] == [
        *(f"one custom (name startup{level})" for level in (1, 2)),
        *(f"one custom (name interrupt1{level})" for level in order),
        *(f"one custom (name shutdown{level})" for level in order),
    ]


class TestStopRequests:
    """Requests to end the robot, one or several, at different moments."""

    def test_during_a_calibration(self, bench: Bench, started: Start):
        """A request aborts the calibrator, leaves out the rest of the startup, and shuts down in order."""
        running = started(bench.make(robot(calibrate="wait").replace('"timeout">0.5', '"timeout">60')))
        eventually(lambda: "cal calibrate board" in bench.calls, "it does not begin")
        running.interface.interrupt()
        outcome = running.end()
        assert not outcome.ready
        expected = [call for call in ORDERLY if call != "last attach board=board"]
        at = expected.index("cal calibrate board") + 1
        assert bench.calls == [*expected[:at], "cal abort", *expected[at:]]

    def test_while_a_device_is_opened(self, bench: Bench, started: Start):
        """A request lets the opening end, opens no further device, and closes those that are open."""
        bench.patience = Patience(open=30.0)
        running = started(bench.make(device("a") + device("b", open="hang") + device("c")))
        eventually(lambda: "b open" in bench.calls, "it does not begin")
        running.interface.interrupt()
        assert running.interface.phase is Phase.STARTUP  # the first request lets it be opened whole
        from scripted_devices import let_go

        let_go()
        assert not running.end().ready
        assert bench.calls == ["a open", "b open", "b close", "a close"]

    def test_a_second_request_does_not_wait_for_a_device_that_hangs(self, bench: Bench, started: Start):
        """The second request abandons a device that hangs while it opens; the others are closed."""
        bench.patience = Patience(open=30.0, close=1.0, hurry=0.5)
        running = started(bench.make(device("a") + device("b", open="hang") + device("c")))
        eventually(lambda: "b open" in bench.calls, "it does not begin")
        running.interface.interrupt()
        running.interface.interrupt()
        outcome = running.end()
        assert "a close" in bench.calls
        assert "was not waited for" in outcome.failures[0]
        assert outcome.hanging == ("the opening of b (scripted)",)

    def test_three_stop_requests(self, bench: Bench, started: Start):
        """The second and third request run their phase's actions at once, and abort a calibrator that parks."""
        actions = "".join(
            action("custom", phase, level, name=f"{phase}{level}")
            for phase, level in (("interrupt1", 2), ("interrupt2", 1), ("interrupt3", 1), ("shutdown", 1))
        )
        parking = action("park", "interrupt1", 1, target="one") + action("park", "interrupt2", 0, target="one")
        inside = device("one", inside=actions) + device("cal", "scriptedCalibrator", parking, park="deaf")
        running = started(bench.make(inside))
        eventually(lambda: running.interface.ready, "it does not become ready")
        running.interface.interrupt()
        eventually(lambda: "cal park one" in bench.calls, "it does not park")
        assert running.interface.phase is Phase.INTERRUPT1
        running.interface.interrupt()
        running.interface.interrupt()
        outcome = running.end()
        calls = [call for call in bench.calls if not call.endswith((" open", " close"))]
        assert [call for call in calls if "custom" in call] == [
            "one custom (name interrupt31)" if phase == "interrupt3" else f"one custom (name {phase}1)"
            for phase in (["interrupt2"] if "one custom (name interrupt21)" in calls else [])
            + ["interrupt3", "shutdown"]
        ]
        assert "cal abort" in calls
        assert any("park" in name for name in outcome.hanging)
        assert bench.calls[-2:] == ["cal close", "one close"]

    def test_during_the_shutdown(self, bench: Bench, started: Start):
        """An interrupt during the shutdown runs its own actions first, then the rest of the shutdown."""
        late = action("custom", "shutdown", 2, name="late") + action("custom", "interrupt2", 1, name="second")
        parking = action("park", "shutdown", 1, target="one")
        running = started(
            bench.make(device("one", inside=late) + device("cal", "scriptedCalibrator", parking, park="wait"))
        )
        eventually(lambda: running.interface.ready, "it does not become ready")
        running.interface.quit()
        eventually(lambda: "cal park one" in bench.calls, "it does not park")
        assert (running.interface.phase, running.interface.level) == (Phase.SHUTDOWN, 1)
        running.interface.quit()  # a request is no second signal
        running.interface.interrupt()
        outcome = running.end()
        assert outcome.ready
        assert outcome.hanging == ()
        assert bench.calls[3:] == [
            "cal abort",
            "one custom (name second)",
            "one custom (name late)",
            "cal close",
            "one close",
        ]

    def test_before_it_begins(self, bench: Bench):
        """A robot that is interrupted before it runs opens no device."""
        interface = bench.make(robot())
        interface.interrupt()
        assert not interface.run().ready
        assert bench.calls == []
