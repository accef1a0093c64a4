"""The codes and bits in messages of the boards: types of boards, control modes, faults."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class BoardType(IntEnum):
    """The type of a board, in its answers about its version."""

    DSP = 0
    PIC = 1
    MC_2DC = 2
    MC_4DC = 3
    BLL = 4
    SKIN = 5
    STRAIN = 6
    MAIS = 7
    FOC_2 = 8
    SG_6 = 9
    MTB4 = 11
    STRAIN2 = 12
    RFE = 13
    PSC = 15
    MTB4_W = 16
    PMC = 17
    AMCBLDC = 18
    BMS = 19
    BAT = 23
    UNKNOWN = 255


#: The types of boards that control joints, and that are drives of motors.
JOINT_BOARDS = frozenset({BoardType.DSP, BoardType.PIC, BoardType.MC_2DC, BoardType.MC_4DC, BoardType.BLL})
FOC_BOARDS = frozenset({BoardType.FOC_2, BoardType.AMCBLDC})


class BoardMode(IntEnum):
    """The control mode of an axis, as boards have it."""

    IDLE = 0x00
    POSITION = 0x01
    VELOCITY = 0x02
    TORQUE = 0x03
    IMPEDANCE_POSITION = 0x04
    IMPEDANCE_VELOCITY = 0x05
    CURRENT = 0x06
    MIXED = 0x07
    DIRECT = 0x08
    FORCE_IDLE = 0x09  # a command only
    SPEED_VOLTAGE = 0x0A
    SPEED_CURRENT = 0x0B
    OPEN_LOOP = 0x50
    CALIBRATING = 0x60
    HARDWARE_FAULT = 0xA0
    NOT_CONFIGURED = 0xB0
    CONFIGURED = 0xB1
    UNKNOWN = 0xFF


class BoardInteraction(IntEnum):
    """The interaction mode of an axis, as boards have it."""

    STIFF = 0
    COMPLIANT = 1


class CalibrationType(IntEnum):
    """How a joint board finds the zero of an axis; the meaning of the three parameters depends on it."""

    HARD_STOP = 0
    ANALOG_ABSOLUTE = 1
    HARD_STOP_LIMITED = 2
    DIGITAL_ABSOLUTE = 3
    ABSOLUTE_INCREMENTAL = 4
    MAIS = 6
    HALL = 7


class JointFault(IntFlag):
    """Faults of an axis, in the status of a joint board."""

    UNDERVOLTAGE = 0x01
    OVERLOAD = 0x02
    EXTERNAL = 0x04  # the fault button
    OVERCURRENT = 0x08
    HALL = 0x10
    ABSOLUTE_ENCODER = 0x20
    OPTICAL_ENCODER = 0x40


class CanState(IntFlag):
    """The state of the CAN controller of a joint board."""

    TX_OVERFLOW = 0x01
    BUS_OFF = 0x02
    TX_ERROR = 0x04
    RX_ERROR = 0x08
    TX_OVERRUN = 0x10
    RX_WARNING = 0x20
    RX_OVERRUN = 0x40


class BoardState(IntFlag):
    """The state of a joint board itself; the two channels are its axes."""

    LOOP_OVERRUN = 0x01
    TEMPERATURE_1 = 0x02
    TEMPERATURE_2 = 0x04
    TEMPERATURE_SENSOR_1 = 0x08
    TEMPERATURE_SENSOR_2 = 0x10


class QuadratureState(IntFlag):
    """The state of the quadrature encoder of a FOC board."""

    DIRTY = 0x01
    STUCK = 0x02
    INDEX_BROKEN = 0x04
    PHASE_BROKEN = 0x08
    NOT_CALIBRATED = 0x10


class FocFault(IntFlag):
    """Faults and warnings in the status of a FOC board, bit 0 first."""

    EXTERNAL = 1 << 0
    UNDERVOLTAGE = 1 << 1
    OVERVOLTAGE = 1 << 2
    OVERCURRENT = 1 << 3
    HALL_INVALID = 1 << 4
    ENCODER_CHECKSUM = 1 << 5
    HALL_SEQUENCE = 1 << 6
    PROTOCOL_MISMATCH = 1 << 7
    CAN_OVERRUN = 1 << 8
    SETPOINT_EXPIRED = 1 << 9
    TX_PASSIVE = 1 << 10
    RX_PASSIVE = 1 << 11
    TX_WARNING = 1 << 12
    RX_WARNING = 1 << 13
    OVERHEATING = 1 << 14
    I2C_FAILURE = 1 << 15
    CURRENT_SENSOR_CALIBRATION = 1 << 16
    I2T = 1 << 17
    EMULATED_ROM = 1 << 18
    EMULATED_ROM_CHECKSUM = 1 << 19
    ENCODER = 1 << 20
    SPI_TIMING = 1 << 21
    ENCODER_CALCULATION = 1 << 22
    PWM_FATAL = 1 << 23
    TX_WAS_PASSIVE = 1 << 24
    RX_WAS_PASSIVE = 1 << 25
    REMOTE_FRAME = 1 << 26
    WAS_WARNING = 1 << 27
    LENGTH_ERROR = 1 << 28
    SILICON_REVISION = 1 << 29
    UPPER_LIMIT = 1 << 30
    LOWER_LIMIT = 1 << 31


class MotorFlag(IntFlag):
    """What a motor of a FOC board has."""

    QUADRATURE_ENCODER = 0x01
    HALL = 0x02
    TEMPERATURE_SENSOR = 0x04
    INDEX = 0x08
    SPEED_ENCODER = 0x10
    VERBOSE = 0x20


class StrainMode(IntEnum):
    """What a strain board sends."""

    CALIBRATED = 0
    STOPPED = 1
    RAW = 3
    BOTH = 4


class InertialKind(IntEnum):
    """What a vector of an inertial unit is."""

    ACCELERATION = 0
    MAGNETIC_FIELD = 1
    ANGULAR_VELOCITY = 2
    ORIENTATION = 3
    LINEAR_ACCELERATION = 5
    GRAVITY = 6


class FocPidType(IntEnum):
    """The controller of a FOC board that a parameter in floating point belongs to."""

    CURRENT = 0
    VELOCITY = 1
    POSITION = 2


class FocPidParameter(IntEnum):
    """A parameter in floating point of a controller; a change is made between a lock and an unlock."""

    LOCK = 0
    UNLOCK = 1
    KP = 2
    KI = 3
    KD = 4
    INTEGRAL_LIMIT = 5
    OUTPUT_LIMIT = 6
    KFF = 7
    STICTION_UP = 8
    STICTION_DOWN = 9
