"""What can be asked of a device, as abstract classes. A test uses these, whatever stands behind them.

Units are the iCub's: degrees, seconds, newton-metres, amperes, volts, per cent of duty cycle, degrees Celsius.
Joints and motors are numbered from 0 within their device. Where a method takes ``joints`` (or ``motors``), None means
all of them in order, a number one, a sequence these in its order; values are given for as many, a single one for one.
What is read comes as an array of one value for each. Every method may raise :class:`~rtf.robot.errors.RefusedError`
(the device says no: also for a joint that it does not have), ``NotSupportedError`` (the device has not got this), and
through the network ``StaleStateError`` and ``NoAnswerError``. All may be called from any thread.
"""

from rtf.robot.interfaces.axes import AxisSelection, FloatArray, IAxisInfo, JointType, Values, selected, values_for
from rtf.robot.interfaces.calibration import CalibrationParameters, IControlCalibration, IRemoteCalibrator
from rtf.robot.interfaces.modes import IControlMode, IInteractionMode, IJointFault, modes_for
from rtf.robot.interfaces.motion import (
    IControlLimits,
    ICurrentControl,
    IImpedanceControl,
    IPositionControl,
    IPositionDirect,
    IPWMControl,
    ITorqueControl,
    IVelocityControl,
    MotorTorqueParameters,
)
from rtf.robot.interfaces.motors import IAmplifierControl, IEncoders, IMotor, IMotorEncoders
from rtf.robot.interfaces.pids import IPidControl, Pid, PidType
from rtf.robot.interfaces.sensors import (
    CameraFeature,
    IAnalogSensor,
    IBattery,
    IFrameGrabber,
    IFrameGrabberControls,
    IMultipleAnalogSensors,
    SensorCategory,
    SensorInfo,
    SensorReading,
    SensorStatus,
)
from rtf.robot.interfaces.variables import IRemoteVariables

__all__ = [
    "AxisSelection",
    "CalibrationParameters",
    "CameraFeature",
    "FloatArray",
    "IAmplifierControl",
    "IAnalogSensor",
    "IAxisInfo",
    "IBattery",
    "IControlCalibration",
    "IControlLimits",
    "IControlMode",
    "ICurrentControl",
    "IEncoders",
    "IFrameGrabber",
    "IFrameGrabberControls",
    "IImpedanceControl",
    "IInteractionMode",
    "IJointFault",
    "IMotor",
    "IMotorEncoders",
    "IMultipleAnalogSensors",
    "IPWMControl",
    "IPidControl",
    "IPositionControl",
    "IPositionDirect",
    "IRemoteCalibrator",
    "IRemoteVariables",
    "ITorqueControl",
    "IVelocityControl",
    "JointType",
    "MotorTorqueParameters",
    "Pid",
    "PidType",
    "SensorCategory",
    "SensorInfo",
    "SensorReading",
    "SensorStatus",
    "Values",
    "modes_for",
    "selected",
    "values_for",
]
