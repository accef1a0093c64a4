"""The interfaces of devices, as abstract classes. Tests use only these.

Units are the iCub's: degrees, seconds, newton-metres, amperes, volts, per cent of duty cycle, degrees Celsius. Joints
and motors are numbered from 0 within their device. Where a method takes ``joints`` (or ``motors``), None means all of
them in order, a number one, a sequence these in its order; values are given for as many, a single number for one.
Results are arrays with one value for each. Every method may raise :class:`~rtf.robot.errors.RefusedError` (also for a
joint that the device does not have), ``NotSupportedError`` (the device does not implement it), and through the network
``StaleStateError`` and ``NoAnswerError``. All may be called from any thread.
"""

from rtf.robot.interfaces.axes import AxisSelection, FloatArray, IAxisInfo, JointType, Values, selected, values_for
from rtf.robot.interfaces.calibration import CalibrationParameters, IControlCalibration, IRemoteCalibrator
from rtf.robot.interfaces.cartesian import (
    CartesianPose,
    CartesianPriority,
    CartesianSolution,
    ICartesianControl,
)
from rtf.robot.interfaces.gaze import (
    Eye,
    FixationPoint,
    GazeAngles,
    GazeMeasurement,
    GazeTarget,
    IGazeControl,
    MonoPixel,
    MonoPixelWithVergence,
    NeckAxis,
    StereoPixels,
)
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
from rtf.robot.interfaces.rgbd import Intrinsics, IRgbdOptics, IRgbdSensor, RgbdImages, RgbdPart, RgbdStatus
from rtf.robot.interfaces.sensors import (
    BatteryStatus,
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
from rtf.robot.interfaces.task_control import ControllerEvent, EventObserver, ITaskControl
from rtf.robot.interfaces.variables import IRemoteVariables

__all__ = [
    "AxisSelection",
    "BatteryStatus",
    "CalibrationParameters",
    "CameraFeature",
    "CartesianPose",
    "CartesianPriority",
    "CartesianSolution",
    "ControllerEvent",
    "EventObserver",
    "Eye",
    "FixationPoint",
    "FloatArray",
    "GazeAngles",
    "GazeMeasurement",
    "GazeTarget",
    "IAmplifierControl",
    "IAnalogSensor",
    "IAxisInfo",
    "IBattery",
    "ICartesianControl",
    "IControlCalibration",
    "IControlLimits",
    "IControlMode",
    "ICurrentControl",
    "IEncoders",
    "IFrameGrabber",
    "IFrameGrabberControls",
    "IGazeControl",
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
    "IRgbdOptics",
    "IRgbdSensor",
    "ITaskControl",
    "ITorqueControl",
    "IVelocityControl",
    "Intrinsics",
    "JointType",
    "MonoPixel",
    "MonoPixelWithVergence",
    "MotorTorqueParameters",
    "NeckAxis",
    "Pid",
    "PidType",
    "RgbdImages",
    "RgbdPart",
    "RgbdStatus",
    "SensorCategory",
    "SensorInfo",
    "SensorReading",
    "SensorStatus",
    "StereoPixels",
    "Values",
    "modes_for",
    "selected",
    "values_for",
]
