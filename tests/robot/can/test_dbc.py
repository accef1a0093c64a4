"""The DBC file: cantools reads it, and decodes what the codec has encoded."""

from __future__ import annotations

import pytest
from cantools.database import Database, load_string

from rtf.robot.devices.can import motor_messages as motor
from rtf.robot.devices.can import sensor_messages as sensor
from rtf.robot.devices.can.codes import BoardType
from rtf.robot.devices.can.dbc import dbc_of
from rtf.robot.devices.can.messages import EVERYONE, HOST, Frame

BOARDS = {1: BoardType.MC_4DC, 2: BoardType.FOC_2, 8: BoardType.SKIN, 13: BoardType.STRAIN2}


@pytest.fixture(scope="module")
def database() -> Database:
    """The DBC file of four boards, as cantools reads it."""
    read = load_string(dbc_of(BOARDS), "dbc")
    assert isinstance(read, Database)
    return read


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (
            motor.POSITION_MOVE.frame(1, -70000, 30, axis=1),
            {"command": 155, "position_move_1_target": -70000, "position_move_1_speed": 300},
        ),
        (motor.BROADCAST_POSITION.frame(1, 5, -6), {"position_0": 5, "position_1": -6}),
        (motor.FOC_FEEDBACK.frame(2, 1500, 0, 65536), {"current": 1.5, "velocity": 0, "position": 360}),
        (
            motor.SETPOINTS[3].frame(HOST, 1, 2, 3, -4),
            {"setpoint_1": 1, "setpoint_2": 2, "setpoint_3": 3, "setpoint_4": -4},
        ),
        (
            motor.FOC_PID_PARAMETER.set.frame(2, 1, 2, 0.5, axis=0),
            {
                "command": 125,
                "set_foc_pid_parameter_0_controller": 1,
                "set_foc_pid_parameter_0_parameter": 2,
                "set_foc_pid_parameter_0_value": 0.5,
            },
        ),
        (sensor.FULL_SCALE.value.frame(13, 2, 500), {"command": 24, "full_scale_channel": 2, "full_scale_scale": 500}),
        (sensor.FORCE.frame(13, 1, 2, 3), {"x": 1, "y": 2, "z": 3}),
    ],
)
def test_cantools_decodes_our_frames(database: Database, frame: Frame, expected: dict[str, object]):
    """Frames have the same values for cantools, in their units."""
    got = database.decode_message(frame.identifier, frame.data, decode_choices=False, allow_truncated=True)
    assert {name: got[name] for name in expected} == pytest.approx(expected)


def test_each_board_has_its_own_messages(database: Database):
    """Identifiers are those of the boards, each once, and a status has a signal for each fault."""
    identifiers = [message.frame_id for message in database.messages]
    assert len(identifiers) == len(set(identifiers))
    assert {0x001, 0x010, 0x002, 0x020, 0x10F, 0x120, 0x113, 0x487, 0x3DA, 0x70D, 0x7D0} <= set(identifiers)
    assert not {0x003, 0x100 | EVERYONE << 4} & set(identifiers)
    status = database.get_message_by_frame_id(0x113).signal_tree
    assert "faults_0_overcurrent" in status
