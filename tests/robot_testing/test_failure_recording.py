"""The recording of the last seconds before a failure."""

from __future__ import annotations

import json
from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np
import pytest
from mcap.reader import make_reader

from rtf.robot.control_modes import ControlMode
from rtf.robot.extended_state import Field
from rtf.robot_testing.failure_recording import FailureRecording
from rtf.robot_testing.guard.limits import GuardError
from rtf.robot_testing.robot_test import RobotTest
from rtf.testing.events import Attached, Event, Message, SeriesRecorded
from rtf.testing.session import Session

from .part_bench import PartBench

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.robot.extended_state import ExtendedState


def test_all_quantities_of_the_board_are_recorded_for_each_joint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """With its mode, and the legend of the modes; states after the failure are not recorded."""
    events: list[Event] = []
    test = RobotTest()
    test.attach_to(Session("t", events.append, folder=tmp_path, run_folder=tmp_path), "")
    test.check(condition=False, text="it fails")
    with ExitStack() as stack:
        bench = PartBench(stack)
        fill = bench.device.fill_state

        def without_torques(state: ExtendedState) -> float:
            time = fill(state)
            state.valid[Field.TORQUES] = False
            return time

        monkeypatch.setattr(bench.device, "fill_state", without_torques)
        bench.time.sleep(0.1)
        bench.part.set_mode(ControlMode.PWM, [1])
        bench.time.sleep(0.1)
        last = FailureRecording(test, bench.part, None)
        last.take()
        rows = len(bench.part.history)
        bench.part.set_mode(ControlMode.IDLE)
        bench.time.sleep(0.1)
        last.write()
    series = {one.name: one for one in events if isinstance(one, SeriesRecorded)}
    assert [*series] == ["before the end: joint0", "before the end: joint1", "before the end: joint2"]
    with np.load(tmp_path / series["before the end: joint1"].path) as data:
        assert [*data] == ["time", "position", "current", "duty", "mode"]
        assert len(data["time"]) == rows
        assert (data["mode"][0], data["mode"][-1]) == (0.0, 6.0)
    (attached,) = [one for one in events if isinstance(one, Attached)]
    assert (attached.name, attached.media_type) == ("before the end - fake.mcap", "application/vnd.mcap")
    with (
        np.load(tmp_path / series["before the end: joint1"].path) as data,
        (tmp_path / attached.path).open("rb") as file,
    ):
        messages = [*make_reader(file).iter_messages()]
        assert {(channel.topic, schema.encoding) for schema, channel, _ in messages} == {("/fake", "jsonschema")}
        decoded = [json.loads(message.data) for _, _, message in messages]
        assert [[*one] for one in decoded] == [["joint0", "joint1", "joint2"]] * rows
        assert [message.log_time / 1e9 for _, _, message in messages] == pytest.approx(data["time"])
        for column in ("position", "current", "duty", "mode"):
            assert [one["joint1"][column] for one in decoded] == data[column].tolist()
    assert any("0 pos" in one.detail and "6 ipwm" in one.detail for one in events if isinstance(one, Message))


def test_the_states_before_the_first_stop_are_recorded(tmp_path: Path):
    """Whether the test fails or goes on, even if a thousand states follow."""
    events: list[Event] = []
    test = RobotTest()
    test.attach_to(Session("t", events.append, folder=tmp_path, run_folder=tmp_path), "")
    with ExitStack() as stack:
        bench = PartBench(stack)
        last = FailureRecording(test, bench.part, None)
        bench.guard.on_stop = last.take_stop
        bench.time.sleep(0.1)
        for joint, where in ((1, 200.0), (0, -200.0)):
            bench.device.shown = {joint: where}
            bench.publish()
            with pytest.raises(GuardError, match=f"joint{joint} .* beyond its limits"):
                bench.guard.watch()
            bench.guard.exclude(joint, "it is elsewhere")
        bench.device.shown = {}
        for _ in range(1100):
            bench.publish()
        last.take()
        last.write()
    names = [one.name for one in events if isinstance(one, SeriesRecorded)]
    assert names == [f"before joint1 was stopped: joint{joint}" for joint in range(3)]
    path = next(one.path for one in events if isinstance(one, SeriesRecorded) and one.name == names[1])
    with np.load(tmp_path / path) as data:
        assert data["position"][-1] == 200.0
