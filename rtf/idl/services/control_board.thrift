/** How a call ended: a list of [ok], or of the word of an error. In YARP 3.11 and 3.12 it is a number. */
struct ReturnValue {} (yarp.name = "yarp::dev::ReturnValue")
struct Bottle {} (yarp.name = "yarp::os::Bottle")
/** A list of ten numbers: kp, kd, ki, max_integral, scale, max_output, offset, stiction_up, stiction_down, feedforward. */
struct Pid {} (yarp.name = "yarp::dev::Pid")
/** A list of thirteen texts: three descriptions, and the units of the ten numbers of a PID. */
struct PidInformation {} (yarp.name = "yarp::dev::PidExtraInfo")
/** The letters of a mode, such as [pos], as a number. */
enum ControlMode {} (yarp.name = "yarp::dev::SelectableControlModeEnum")
/** [stif] or [comp], as a number. */
enum InteractionMode {} (yarp.name = "yarp::dev::InteractionModeEnum")
enum JointType {} (yarp.name = "yarp::dev::JointTypeEnum")
enum PidControlType {} (yarp.name = "yarp::dev::PidControlTypeEnum")

/** What the calibration of a joint needs; the meaning of the parameters is that of its kind. */
struct yCalibrationParameters {
  1: i32 type; 2: double param1; 3: double param2; 4: double param3; 5: double param4; 6: double param5; 7: double paramZero
}
/** The constants of a motor: back-EMF, torque, and friction in both directions. */
struct yMotorTorqueParameters {
  1: double bemf; 2: double bemf_scale; 3: double ktau; 4: double ktau_scale; 5: double viscousPos; 6: double viscousNeg;
  7: double coulombPos; 8: double coulombNeg; 9: double velocityThres
}

struct return_getDeviceInterfaces { 1: ReturnValue ret; 2: map<string, bool> interfaces }
struct return_getAvailableControlModes { 1: ReturnValue ret; 2: list<ControlMode> avail }
struct return_getImpedance { 1: ReturnValue ret; 2: double stiffness; 3: double damping }
struct return_getImpedanceOffset { 1: ReturnValue ret; 2: double offset }
struct return_getCurrentImpedanceLimit { 1: ReturnValue ret; 2: double min_stiffness; 3: double max_stiffness; 4: double min_damping; 5: double max_damping }
struct return_getLastJointFault { 1: ReturnValue ret; 2: i32 fault; 3: string message }
struct return_getRemoteVariable { 1: ReturnValue ret; 2: Bottle val }
struct return_getRemoteVariablesList { 1: ReturnValue ret; 2: list<Bottle> listOfKeys }
struct return_getInteractionModeOne { 1: ReturnValue ret; 2: InteractionMode mode }
struct return_getInteractionModeGroup { 1: ReturnValue ret; 2: list<InteractionMode> modes }
struct return_getInteractionModeAll { 1: ReturnValue ret; 2: list<InteractionMode> modes }
struct return_getRefCurrentAll { 1: ReturnValue ret; 2: list<double> refs }
struct return_getRefCurrentOne { 1: ReturnValue ret; 2: double ref }
struct return_getCurrentAll { 1: ReturnValue ret; 2: list<double> currs }
struct return_getCurrentOne { 1: ReturnValue ret; 2: double curr }
struct return_getCurrentRangeOne { 1: ReturnValue ret; 2: double min; 3: double max }
struct return_getCurrentRangeAll { 1: ReturnValue ret; 2: list<double> mins; 3: list<double> maxs }
struct return_getRefDutyCycleOne { 1: ReturnValue ret; 2: double val }
struct return_getRefDutyCycleAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getDutyCycleOne { 1: ReturnValue ret; 2: double val }
struct return_getDutyCycleAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getEncoderOne { 1: ReturnValue ret; 2: double val }
struct return_getEncoderTimedOne { 1: ReturnValue ret; 2: double val; 3: double time }
struct return_getEncoderAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getEncoderTimedAll { 1: ReturnValue ret; 2: list<double> val; 3: list<double> time }
struct return_getEncoderSpeedOne { 1: ReturnValue ret; 2: double val }
struct return_getEncoderSpeedAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getEncoderAccelerationOne { 1: ReturnValue ret; 2: double val }
struct return_getEncoderAccelerationAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getMotorEncoderCountsPerRevolution { 1: ReturnValue ret; 2: double cpr }
struct return_getMotorEncoderOne { 1: ReturnValue ret; 2: double val }
struct return_getMotorEncoderAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getMotorEncoderTimedOne { 1: ReturnValue ret; 2: double val; 3: double time }
struct return_getMotorEncoderTimedAll { 1: ReturnValue ret; 2: list<double> val; 3: list<double> time }
struct return_getMotorEncoderSpeedOne { 1: ReturnValue ret; 2: double val }
struct return_getMotorEncoderSpeedAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getMotorEncoderAccelerationOne { 1: ReturnValue ret; 2: double val }
struct return_getMotorEncoderAccelerationAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getNumberOfMotorEncoders { 1: ReturnValue ret; 2: i32 num }
struct return_isCalibratorDevicePresent { 1: ReturnValue ret; 2: bool isPresent }
struct return_isJointBraked { 1: ReturnValue ret; 2: bool isBraked }
struct return_getAutoBrakeEnabled { 1: ReturnValue ret; 2: bool enabled }
struct return_getAxes { 1: ReturnValue ret; 2: i32 axes }
struct return_getRefTorqueOne { 1: ReturnValue ret; 2: double val }
struct return_getRefTorqueAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getRefTorqueGroup { 1: ReturnValue ret; 2: list<double> val }
struct return_getRefPositionOne { 1: ReturnValue ret; 2: double val }
struct return_getRefPositionAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getRefPositionGroup { 1: ReturnValue ret; 2: list<double> val }
struct return_getAxisName { 1: ReturnValue ret; 2: string name }
struct return_getJointType { 1: ReturnValue ret; 2: JointType joint }
struct return_getPosLimits { 1: ReturnValue ret; 2: double min; 3: double max }
struct return_getVelLimits { 1: ReturnValue ret; 2: double min; 3: double max }
struct return_getNumberOfMotors { 1: ReturnValue ret; 2: i32 val }
struct return_getTemperatureOne { 1: ReturnValue ret; 2: double val }
struct return_getTemperatureAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getTemperatureLimit { 1: ReturnValue ret; 2: double val }
struct return_getGearboxRatio { 1: ReturnValue ret; 2: double val }
struct return_getAvailablePids { 1: ReturnValue ret; 2: list<PidControlType> avail }
struct return_isPidEnabled { 1: ReturnValue ret; 2: bool isEnabled }
struct return_getPidError { 1: ReturnValue ret; 2: double err }
struct return_getPidErrors { 1: ReturnValue ret; 2: list<double> errs }
struct return_getPidReference { 1: ReturnValue ret; 2: double ref }
struct return_getPidReferences { 1: ReturnValue ret; 2: list<double> refs }
struct return_getPidErrorLimit { 1: ReturnValue ret; 2: double lim }
struct return_getPidErrorLimits { 1: ReturnValue ret; 2: list<double> lims }
struct return_getPidOutput { 1: ReturnValue ret; 2: double out }
struct return_getPidOutputs { 1: ReturnValue ret; 2: list<double> outs }
struct return_getPid { 1: ReturnValue ret; 2: Pid pid }
struct return_getPids { 1: ReturnValue ret; 2: list<Pid> pids }
struct return_getPidExtraInfo { 1: ReturnValue ret; 2: PidInformation info }
struct return_getPidExtraInfos { 1: ReturnValue ret; 2: list<PidInformation> info }
struct return_getPidOffset { 1: ReturnValue ret; 2: double offset }
struct return_getPidFeedforward { 1: ReturnValue ret; 2: double feedforward }
struct return_getTargetPositionOne { 1: ReturnValue ret; 2: double val }
struct return_getTargetPositionGroup { 1: ReturnValue ret; 2: list<double> val }
struct return_getTargetPositionAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getTrajSpeedOne { 1: ReturnValue ret; 2: double val }
struct return_getTrajSpeedsGroup { 1: ReturnValue ret; 2: list<double> val }
struct return_getTrajSpeedsAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getTrajAccelerationOne { 1: ReturnValue ret; 2: double val }
struct return_getTrajAccelerationGroup { 1: ReturnValue ret; 2: list<double> val }
struct return_getTrajAccelerationAll { 1: ReturnValue ret; 2: list<double> val }
struct return_checkMotionDoneOne { 1: ReturnValue ret; 2: bool flag }
struct return_checkMotionDoneGroup { 1: ReturnValue ret; 2: bool flag }
struct return_checkMotionDoneAll { 1: ReturnValue ret; 2: bool flag }
struct return_getTargetVelocityOne { 1: ReturnValue ret; 2: double val }
struct return_getTargetVelocityGroup { 1: ReturnValue ret; 2: list<double> val }
struct return_getTargetVelocityAll { 1: ReturnValue ret; 2: list<double> val }
struct return_getRefVelocityOne { 1: ReturnValue ret; 2: double vel }
struct return_getRefVelocityAll { 1: ReturnValue ret; 2: list<double> vel }
struct return_getRefVelocityGroup { 1: ReturnValue ret; 2: list<double> vel }
struct return_getTorqueRangeOne { 1: ReturnValue ret; 2: double min; 3: double max }
struct return_getTorqueRangeAll { 1: ReturnValue ret; 2: list<double> mins; 3: list<double> maxs }
struct return_getMotorTorqueParams { 1: ReturnValue ret; 2: yMotorTorqueParameters params }
struct return_getAmpStatusAll { 1: ReturnValue ret; 2: list<i32> val }
struct return_getAmpStatusOne { 1: ReturnValue ret; 2: i32 val }
struct return_getMaxCurrent { 1: ReturnValue ret; 2: double val }
struct return_getNominalCurrent { 1: ReturnValue ret; 2: double val }
struct return_getPeakCurrent { 1: ReturnValue ret; 2: double val }
struct return_getPWM { 1: ReturnValue ret; 2: double val }
struct return_getPWMLimit { 1: ReturnValue ret; 2: double val }
struct return_getPowerSupplyVoltage { 1: ReturnValue ret; 2: double val }

/**
 * The functions of a control board of YARP 4.0, at the port NAME/nws/rpc:i of a board NAME. Angles are in degrees; the
 * number of a joint or motor begins at 0. Each answer begins with a ReturnValue; where that is not [ok], the rest has no meaning.
 * A function for one axis, for some of them and for all of them is three functions.
 */
service ControlBoardMsgs {
  /** Return which of the interfaces the device has. */
  return_getDeviceInterfaces getDeviceInterfacesRPC() (yarp.qualifier = "const");
  /** Return the modes that may be set. */
  return_getAvailableControlModes getAvailableControlModesRPC(1: i16 j) (yarp.qualifier = "const");
  /** Return the stiffness and the damping. */
  return_getImpedance getImpedanceRPC(1: i32 j) (yarp.qualifier = "const");
  /** Set the stiffness and the damping; values beyond the limits are refused. */
  ReturnValue setImpedanceRPC(1: i32 j, 2: double stiffness, 3: double damping);
  /** Set the torque offset. */
  ReturnValue setImpedanceOffsetRPC(1: i32 j, 2: double offset);
  /** Return the torque offset. */
  return_getImpedanceOffset getImpedanceOffsetRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the minimum and maximum stiffness, and the minimum and maximum damping. */
  return_getCurrentImpedanceLimit getCurrentImpedanceLimitRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the code and the text of the last fault of a joint; 0 and an empty text if there was none. */
  return_getLastJointFault getLastJointFaultRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the value of a variable; refused for an unknown one. */
  return_getRemoteVariable getRemoteVariableRPC(1: string key) (yarp.qualifier = "const");
  /** Set a variable; most refuse it. */
  ReturnValue setRemoteVariableRPC(1: string key, 2: Bottle val);
  /** Return the names of the variables, each in a list. */
  return_getRemoteVariablesList getRemoteVariablesListRPC() (yarp.qualifier = "const");
  /** Return the interaction modes of the joints. One axis. */
  return_getInteractionModeOne getInteractionModeOneRPC(1: i32 axis) (yarp.qualifier = "const");
  /** Return the interaction modes of the joints. Some axes. */
  return_getInteractionModeGroup getInteractionModesGroupRPC(1: list<i32> joints) (yarp.qualifier = "const");
  /** Return the interaction modes of the joints. All axes. */
  return_getInteractionModeAll getInteractionModesAllRPC() (yarp.qualifier = "const");
  /** Set interaction modes, one for all the joints or one for each. A joint that cannot be compliant refuses. One axis. */
  ReturnValue setInteractionModeOneRPC(1: i32 axis, 2: InteractionMode mode);
  /** Set interaction modes, one for all the joints or one for each. A joint that cannot be compliant refuses. Some axes. */
  ReturnValue setInteractionModesGroupRPC(1: list<i32> joints, 2: list<InteractionMode> modes);
  /** Set interaction modes, one for all the joints or one for each. A joint that cannot be compliant refuses. All axes. */
  ReturnValue setInteractionModesAllRPC(1: list<InteractionMode> modes);
  /** Return the last setpoints. All axes. */
  return_getRefCurrentAll getRefCurrentAllRPC() (yarp.qualifier = "const");
  /** Return the last setpoints. One axis. */
  return_getRefCurrentOne getRefCurrentOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Set the current setpoints. Ignored by joints that are not in current mode. All axes. */
  ReturnValue setRefCurrentAllRPC(1: list<double> refs);
  /** Set the current setpoints. Ignored by joints that are not in current mode. One axis. */
  ReturnValue setRefCurrentOneRPC(1: i32 j, 2: double ref);
  /** Set the current setpoints. Ignored by joints that are not in current mode. Some axes. */
  ReturnValue setRefCurrentGroupRPC(1: list<i32> j, 2: list<double> refs);
  /** Return the measured currents. All axes. */
  return_getCurrentAll getCurrentAllRPC() (yarp.qualifier = "const");
  /** Return the measured currents. One axis. */
  return_getCurrentOne getCurrentOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the range of currents. */
  return_getCurrentRangeOne getCurrentRangeOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the least and greatest currents of all motors. */
  return_getCurrentRangeAll getCurrentRangeAllRPC() (yarp.qualifier = "const");
  /** Set the duty cycle setpoints. Ignored by joints that are not in PWM mode. One axis. */
  ReturnValue setRefDutyCycleOneRPC(1: i32 j, 2: double v);
  /** Set the duty cycle setpoints. Ignored by joints that are not in PWM mode. All axes. */
  ReturnValue setRefDutyCycleAllRPC(1: list<double> v);
  /** Set the duty cycle setpoints. Ignored by joints that are not in PWM mode. Some axes. */
  ReturnValue setRefDutyCycleGroupRPC(1: list<i32> j, 2: list<double> v);
  /** Return the last setpoints. One axis. */
  return_getRefDutyCycleOne getRefDutyCycleOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the last setpoints. All axes. */
  return_getRefDutyCycleAll getRefDutyCycleAllRPC() (yarp.qualifier = "const");
  /** Return the present duty cycles of the motors, in any mode. One axis. */
  return_getDutyCycleOne getDutyCycleOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the present duty cycles of the motors, in any mode. All axes. */
  return_getDutyCycleAll getDutyCycleAllRPC() (yarp.qualifier = "const");
  /** Declare that the joints are at zero. One axis. */
  ReturnValue resetEncoderOneRPC(1: i32 j);
  /** Declare that the joints are at zero. All axes. */
  ReturnValue resetEncoderAllRPC();
  /** Declare that the joints are at these positions: shifts their zeros. One axis. */
  ReturnValue setEncoderOneRPC(1: i32 j, 2: i32 val);
  /** Declare that the joints are at these positions: shifts their zeros. All axes. */
  ReturnValue setEncoderAllRPC(1: list<double> vals);
  /** Return the positions. One axis. */
  return_getEncoderOne getEncoderOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return a position and the time of its measurement. */
  return_getEncoderTimedOne getEncoderTimedOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the positions. All axes. */
  return_getEncoderAll getEncoderAllRPC() (yarp.qualifier = "const");
  /** Return all positions and the times of their measurement. */
  return_getEncoderTimedAll getEncoderTimedAllRPC() (yarp.qualifier = "const");
  /** Return the speeds. One axis. */
  return_getEncoderSpeedOne getEncoderSpeedOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the speeds. All axes. */
  return_getEncoderSpeedAll getEncoderSpeedAllRPC() (yarp.qualifier = "const");
  /** Return the accelerations. One axis. */
  return_getEncoderAccelerationOne getEncoderAccelerationOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the accelerations. All axes. */
  return_getEncoderAccelerationAll getEncoderAccelerationAllRPC() (yarp.qualifier = "const");
  /** Declare that the rotors are at zero. One axis. */
  ReturnValue resetMotorEncoderRPC(1: i32 j);
  /** Declare that the rotors are at zero. All axes. */
  ReturnValue resetMotorEncodersRPC();
  /** Declare that the rotors are at these positions. One axis. */
  ReturnValue setMotorEncoderRPC(1: i32 j, 2: double val);
  /** Set the encoder counts per revolution of the rotor. */
  ReturnValue setMotorEncoderCountsPerRevolutionRPC(1: i32 j, 2: double val);
  /** Return the encoder counts per revolution of the rotor. */
  return_getMotorEncoderCountsPerRevolution getMotorEncoderCountsPerRevolutionRPC(1: i32 m) (yarp.qualifier = "const");
  /** Declare that the rotors are at these positions. All axes. */
  ReturnValue setMotorEncodersAllRPC(1: list<double> vals);
  /** Return the positions. One axis. */
  return_getMotorEncoderOne getMotorEncoderOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the positions. All axes. */
  return_getMotorEncoderAll getMotorEncoderAllRPC() (yarp.qualifier = "const");
  /** Return a motor's position and the time of its measurement. */
  return_getMotorEncoderTimedOne getMotorEncoderTimedOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return all motors' positions and the times of their measurement. */
  return_getMotorEncoderTimedAll getMotorEncodersTimedAllRPC() (yarp.qualifier = "const");
  /** Return the speeds. One axis. */
  return_getMotorEncoderSpeedOne getMotorEncoderSpeedOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the speeds. All axes. */
  return_getMotorEncoderSpeedAll getMotorEncoderSpeedAllRPC() (yarp.qualifier = "const");
  /** Return the accelerations. One axis. */
  return_getMotorEncoderAccelerationOne getMotorEncoderAccelerationOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the accelerations. All axes. */
  return_getMotorEncoderAccelerationAll getMotorEncoderAccelerationAllRPC() (yarp.qualifier = "const");
  /** Return the number of motor encoders. */
  return_getNumberOfMotorEncoders getNumberOfMotorEncodersRPC() (yarp.qualifier = "const");
  /** Return whether the board has a calibrator. */
  return_isCalibratorDevicePresent isCalibratorDevicePresentRPC() (yarp.qualifier = "const");
  /** Calibrate one joint. */
  ReturnValue calibrateSingleJointRPC(1: i32 j);
  /** Calibrate all joints. */
  ReturnValue calibrateWholePartRPC();
  /** Move one joint to its home pose. */
  ReturnValue homingSingleJointRPC(1: i32 j);
  /** Move all joints to their home pose. */
  ReturnValue homingWholePartRPC();
  /** Park a joint, and wait for the end or not. */
  ReturnValue parkSingleJointRPC(1: i32 j, 2: bool wait);
  /** Move all joints to their parking pose. */
  ReturnValue parkWholePartRPC();
  /** Abort the calibration in progress. */
  ReturnValue quitCalibrateRPC();
  /** Abort the parking in progress. */
  ReturnValue quitParkRPC();
  ReturnValue setManualBrakeActiveRPC(1: i32 j, 2: bool active);
  ReturnValue setAutoBrakeEnabledRPC(1: i32 j, 2: bool enabled);
  return_isJointBraked isJointBrakedRPC(1: i32 j) (yarp.qualifier = "const");
  return_getAutoBrakeEnabled getAutoBrakeEnabledRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the number of joints. */
  return_getAxes getAxesRPC() (yarp.qualifier = "const");
  /** Return the last setpoints. One axis. */
  return_getRefTorqueOne getRefTorqueOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the last setpoints. All axes. */
  return_getRefTorqueAll getRefTorqueAllRPC() (yarp.qualifier = "const");
  /** Return the last setpoints. Some axes. */
  return_getRefTorqueGroup getRefTorqueGroupRPC(1: list<i32> j) (yarp.qualifier = "const");
  /** Set the torque setpoints. Ignored by joints that are not in torque mode. One axis. */
  ReturnValue setRefTorqueOneRPC(1: i32 j, 2: double val);
  /** Set the torque setpoints. Ignored by joints that are not in torque mode. All axes. */
  ReturnValue setRefTorqueAllRPC(1: list<double> val);
  /** Set the torque setpoints. Ignored by joints that are not in torque mode. Some axes. */
  ReturnValue setRefTorqueGroupRPC(1: list<i32> j, 2: list<double> val);
  /** Set the position setpoints. Ignored by joints that are not in this mode. One axis. */
  ReturnValue setRefPositionOneRPC(1: i32 j, 2: double value);
  /** Set the position setpoints. Ignored by joints that are not in this mode. All axes. */
  ReturnValue setRefPositionAllRPC(1: list<double> value);
  /** Set the position setpoints. Ignored by joints that are not in this mode. Some axes. */
  ReturnValue setRefPositionGroupRPC(1: list<i32> j, 2: list<double> value);
  /** Return the last setpoints. One axis. */
  return_getRefPositionOne getRefPositionOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the last setpoints. All axes. */
  return_getRefPositionAll getRefPositionAllRPC() (yarp.qualifier = "const");
  /** Return the last setpoints. Some axes. */
  return_getRefPositionGroup getRefPositionGroupRPC(1: list<i32> j) (yarp.qualifier = "const");
  /** Request control modes, one for all the joints or one for each. One axis. */
  ReturnValue setControlModeOneRPC(1: i32 j, 2: ControlMode mod);
  /** Request control modes, one for all the joints or one for each. All axes. */
  ReturnValue setControlModeAllRPC(1: list<ControlMode> modes);
  /** Request control modes, one for all the joints or one for each. Some axes. */
  ReturnValue setControlModeGroupRPC(1: list<i32> j, 2: list<ControlMode> modes);
  /** Return the name of a joint, such as l_elbow. */
  return_getAxisName getAxisNameRPC(1: i32 j);
  /** Return whether a joint is revolute or prismatic. */
  return_getJointType getJointTypeRPC(1: i32 j);
  /** Calibrate all joints. */
  ReturnValue calibrateRobotRPC();
  /** Abort the calibration in progress. */
  ReturnValue abortCalibrationRPC();
  /** Abort the parking in progress. */
  ReturnValue abortParkRPC();
  /** Park the part, and wait for the end or not. */
  ReturnValue parkRPC(1: bool wait);
  /** Calibrate a joint with three parameters. */
  ReturnValue calibrateAxisWithParamsRPC(1: i32 j, 2: i32 ui, 3: double v1, 4: double v2, 5: double v3);
  /** Store the parameters of a later calibration. */
  ReturnValue setCalibrationParametersRPC(1: i32 j, 2: yCalibrationParameters params);
  /** Succeeds if the calibration of a joint is done. */
  ReturnValue calibrationDoneRPC(1: i32 j);
  /** Set the minimum and maximum position. */
  ReturnValue setPosLimitsRPC(1: i16 j, 2: double min, 3: double max);
  /** Set the minimum and maximum speed. */
  ReturnValue setVelLimitsRPC(1: i16 j, 2: double min, 3: double max);
  /** Return the minimum and maximum position. */
  return_getPosLimits getPosLimitsRPC(1: i16 j) (yarp.qualifier = "const");
  /** Return the minimum and maximum speed. */
  return_getVelLimits getVelLimitsRPC(1: i16 j) (yarp.qualifier = "const");
  /** Return the number of motors. */
  return_getNumberOfMotors getNumberOfMotorsRPC() (yarp.qualifier = "const");
  /** Return the temperatures. One axis. */
  return_getTemperatureOne getTemperatureOneRPC(1: i32 m) (yarp.qualifier = "const");
  /** Return the temperatures. All axes. */
  return_getTemperatureAll getTemperatureAllRPC() (yarp.qualifier = "const");
  /** Return the temperature at which a motor is switched off. */
  return_getTemperatureLimit getTemperatureLimitRPC(1: i32 m) (yarp.qualifier = "const");
  /** Set the temperature at which a motor is switched off. */
  ReturnValue setTemperatureLimitRPC(1: i32 m, 2: double val);
  /** Return the turns of the rotor per turn of the joint; negative if the directions are opposite. */
  return_getGearboxRatio getGearboxRatioRPC(1: i32 m) (yarp.qualifier = "const");
  /** Set the gearbox ratio that the board calculates with. */
  ReturnValue setGearboxRatioRPC(1: i32 m, 2: double val);
  /** Switch a controller on. */
  ReturnValue enablePidRPC(1: PidControlType pidtype, 2: i16 j);
  /** Switch a controller off. */
  ReturnValue disablePidRPC(1: PidControlType pidtype, 2: i16 j);
  /** Reset the integral; the setpoint becomes the measured value. */
  ReturnValue resetPidRPC(1: PidControlType pidtype, 2: i16 j);
  /** Set the gains of a joint, effective at once. */
  ReturnValue setPidRPC(1: PidControlType pidtype, 2: i16 j, 3: Pid pid);
  /** Set the gains of all joints. Raises RefusedError, before any change, for a wrong number of them. */
  ReturnValue setPidsRPC(1: PidControlType pidtype, 2: list<Pid> pids);
  /** Set the constant offset of the output. */
  ReturnValue setPidOffsetOneRPC(1: PidControlType pidtype, 2: i16 j, 3: double off);
  /** Set the feedforward of a PID. */
  ReturnValue setPidFeedforwardOneRPC(1: PidControlType pidtype, 2: i16 j, 3: double off);
  /** Set the setpoints of the controllers directly. One axis. */
  ReturnValue setPidReferenceRPC(1: PidControlType pidtype, 2: i16 j, 3: double ref);
  /** Set the setpoints of the controllers directly. All axes. */
  ReturnValue setPidReferencesRPC(1: PidControlType pidtype, 2: list<double> refs);
  /** Set the errors at which a joint enters fault; 0 means never. One axis. */
  ReturnValue setPidErrorLimitRPC(1: PidControlType pidtype, 2: i16 j, 3: double limit);
  /** Set the errors at which a joint enters fault; 0 means never. All axes. */
  ReturnValue setPidErrorLimitsRPC(1: PidControlType pidtype, 2: list<double> limits);
  /** Return the kinds of PIDs that a joint has. */
  return_getAvailablePids getAvailablePidsRPC(1: i16 j) (yarp.qualifier = "const");
  /** Return whether a controller is on. */
  return_isPidEnabled isPidEnabledRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the control errors: setpoint minus measurement. One axis. */
  return_getPidError getPidErrorRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the control errors: setpoint minus measurement. All axes. */
  return_getPidErrors getPidErrorsRPC(1: PidControlType pidtype) (yarp.qualifier = "const");
  /** Return the present setpoints of the controllers. One axis. */
  return_getPidReference getPidReferenceRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the present setpoints of the controllers. All axes. */
  return_getPidReferences getPidReferencesRPC(1: PidControlType pidtype) (yarp.qualifier = "const");
  /** Return the errors at which a joint enters fault; 0 means never. One axis. */
  return_getPidErrorLimit getPidErrorLimitRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the errors at which a joint enters fault; 0 means never. All axes. */
  return_getPidErrorLimits getPidErrorLimitsRPC(1: PidControlType pidtype) (yarp.qualifier = "const");
  /** Return the present outputs, in per cent of duty cycle. One axis. */
  return_getPidOutput getPidOutputRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the present outputs, in per cent of duty cycle. All axes. */
  return_getPidOutputs getPidOutputsRPC(1: PidControlType pidtype) (yarp.qualifier = "const");
  /** Return the gains of a joint. */
  return_getPid getPidRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the gains of all joints. */
  return_getPids getPidsRPC(1: PidControlType pidtype) (yarp.qualifier = "const");
  return_getPidExtraInfo getPidExtraInfoRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  return_getPidExtraInfos getPidExtraInfosRPC(1: PidControlType pidtype) (yarp.qualifier = "const");
  /** Return the offset of a PID. */
  return_getPidOffset getPidOffsetRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Return the feedforward of a PID. */
  return_getPidFeedforward getPidFeedforwardRPC(1: PidControlType pidtype, 2: i16 j) (yarp.qualifier = "const");
  /** Start moves to positions; targets beyond the limits are clipped. Returns at once. One axis. */
  ReturnValue positionMoveOneRPC(1: i32 j, 2: double ref);
  /** Start moves to positions; targets beyond the limits are clipped. Returns at once. Some axes. */
  ReturnValue positionMoveGroupRPC(1: list<i32> joints, 2: list<double> refs);
  /** Start moves to positions; targets beyond the limits are clipped. Returns at once. All axes. */
  ReturnValue positionMoveAllRPC(1: list<double> refs);
  /** Start moves by distances from the present setpoints. Otherwise like position_move. One axis. */
  ReturnValue relativeMoveOneRPC(1: i32 j, 2: double delta);
  /** Start moves by distances from the present setpoints. Otherwise like position_move. Some axes. */
  ReturnValue relativeMoveGroupRPC(1: list<i32> joints, 2: list<double> refs);
  /** Start moves by distances from the present setpoints. Otherwise like position_move. All axes. */
  ReturnValue relativeMoveAllRPC(1: list<double> deltas);
  /** Set the speeds of later moves. One axis. */
  ReturnValue setTrajSpeedOneRPC(1: i32 j, 2: double sp);
  /** Set the speeds of later moves. Some axes. */
  ReturnValue setTrajSpeedGroupRPC(1: list<i32> joints, 2: list<double> spds);
  /** Set the speeds of later moves. All axes. */
  ReturnValue setTrajSpeedAllRPC(1: list<double> spds);
  /** Set the accelerations of later velocity moves. One axis. */
  ReturnValue setTrajAccelerationOneRPC(1: i32 j, 2: double acc);
  /** Set the accelerations of later velocity moves. Some axes. */
  ReturnValue setTrajAccelerationsGroupRPC(1: list<i32> joints, 2: list<double> accs);
  /** Set the accelerations of later velocity moves. All axes. */
  ReturnValue setTrajAccelerationsAllRPC(1: list<double> accs);
  /** Stop trajectories and velocities; the joints hold their positions. One axis. */
  ReturnValue stopOneRPC(1: i32 j);
  /** Stop trajectories and velocities; the joints hold their positions. Some axes. */
  ReturnValue stopGroupRPC(1: list<i32> joints);
  /** Stop trajectories and velocities; the joints hold their positions. All axes. */
  ReturnValue stopAllRPC();
  /** Return the targets of the last moves. One axis. */
  return_getTargetPositionOne getTargetPositionOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the targets of the last moves. Some axes. */
  return_getTargetPositionGroup getTargetPositionGroupRPC(1: list<i32> joints) (yarp.qualifier = "const");
  /** Return the targets of the last moves. All axes. */
  return_getTargetPositionAll getTargetPositionAllRPC() (yarp.qualifier = "const");
  /** Return the speeds of moves. One axis. */
  return_getTrajSpeedOne getTrajSpeedOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the speeds of moves. Some axes. */
  return_getTrajSpeedsGroup getTrajSpeedsGroupRPC(1: list<i32> joints) (yarp.qualifier = "const");
  /** Return the speeds of moves. All axes. */
  return_getTrajSpeedsAll getTrajSpeedsAllRPC() (yarp.qualifier = "const");
  /** Return the accelerations of velocity moves. One axis. */
  return_getTrajAccelerationOne getTrajAccelerationOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the accelerations of velocity moves. Some axes. */
  return_getTrajAccelerationGroup getTrajAccelerationGroupRPC(1: list<i32> joints) (yarp.qualifier = "const");
  /** Return the accelerations of velocity moves. All axes. */
  return_getTrajAccelerationAll getTrajAccelerationAllRPC() (yarp.qualifier = "const");
  /** Return whether the trajectories of all these joints have ended. One axis. */
  return_checkMotionDoneOne checkMotionDoneOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return whether the trajectories of all these joints have ended. Some axes. */
  return_checkMotionDoneGroup checkMotionDoneGroupRPC(1: list<i32> joints) (yarp.qualifier = "const");
  /** Return whether the trajectories of all these joints have ended. All axes. */
  return_checkMotionDoneAll checkMotionDoneAllRPC() (yarp.qualifier = "const");
  /** Move at speeds, reached with the reference accelerations. Ignored in modes without velocity control. One axis. */
  ReturnValue velocityMoveOneRPC(1: i32 j, 2: double ref);
  /** Move at speeds, reached with the reference accelerations. Ignored in modes without velocity control. Some axes. */
  ReturnValue velocityMoveGroupRPC(1: list<i32> joints, 2: list<double> refs);
  /** Move at speeds, reached with the reference accelerations. Ignored in modes without velocity control. All axes. */
  ReturnValue velocityMoveAllRPC(1: list<double> refs);
  /** Return the last commanded speeds. One axis. */
  return_getTargetVelocityOne getTargetVelocityOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the last commanded speeds. Some axes. */
  return_getTargetVelocityGroup getTargetVelocityGroupRPC(1: list<i32> joints) (yarp.qualifier = "const");
  /** Return the last commanded speeds. All axes. */
  return_getTargetVelocityAll getTargetVelocityAllRPC() (yarp.qualifier = "const");
  ReturnValue setRefVelocityOneRPC(1: i32 j, 2: double ref);
  ReturnValue setRefVelocityAllRPC(1: list<double> ref);
  ReturnValue setRefVelocityGroupRPC(1: list<i32> j, 2: list<double> ref);
  return_getRefVelocityOne getRefVelocityOneRPC(1: i32 j) (yarp.qualifier = "const");
  return_getRefVelocityAll getRefVelocityAllRPC() (yarp.qualifier = "const");
  return_getRefVelocityGroup getRefVelocityGroupRPC(1: list<i32> j) (yarp.qualifier = "const");
  /** Return the range of torques that can be measured. */
  return_getTorqueRangeOne getTorqueRangeOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the least and greatest torques of all joints. */
  return_getTorqueRangeAll getTorqueRangeAllRPC() (yarp.qualifier = "const");
  /** Set the parameters of the motor model. */
  ReturnValue setMotorTorqueParamsRPC(1: i32 j, 2: yMotorTorqueParameters params);
  /** Return the parameters of the motor model. */
  return_getMotorTorqueParams getMotorTorqueParamsRPC(1: i32 j);
  /** Switch the amplifier on. */
  ReturnValue enableAmpRPC(1: i32 j);
  /** Switch the amplifier off: the joint becomes idle. */
  ReturnValue disableAmpRPC(1: i32 j);
  /** Return the status of the amplifiers; 0 is no fault. All axes. */
  return_getAmpStatusAll getAmpStatusAllRPC() (yarp.qualifier = "const");
  /** Return the status of the amplifiers; 0 is no fault. One axis. */
  return_getAmpStatusOne getAmpStatusOneRPC(1: i32 j) (yarp.qualifier = "const");
  /** Set the current at which the joint enters hardware fault; 0 causes the fault at once. */
  ReturnValue setMaxCurrentRPC(1: i32 j, 2: double v);
  /** Return the current at which the joint enters hardware fault. */
  return_getMaxCurrent getMaxCurrentRPC(1: i32 j) (yarp.qualifier = "const");
  /** Return the nominal current, which a motor can carry continuously. */
  return_getNominalCurrent getNominalCurrentRPC(1: i32 m) (yarp.qualifier = "const");
  /** Set the nominal current. */
  ReturnValue setNominalCurrentRPC(1: i32 m, 2: double val);
  /** Return the peak current, which a motor can carry for a moment. */
  return_getPeakCurrent getPeakCurrentRPC(1: i32 m) (yarp.qualifier = "const");
  /** Set the peak current. */
  ReturnValue setPeakCurrentRPC(1: i32 m, 2: double val);
  /** Return the present duty cycle. */
  return_getPWM getPWMRPC(1: i32 m) (yarp.qualifier = "const");
  /** Return the maximum duty cycle. */
  return_getPWMLimit getPWMLimitRPC(1: i32 m) (yarp.qualifier = "const");
  /** Set the maximum duty cycle. */
  ReturnValue setPWMLimitRPC(1: i32 m, 2: double val);
  /** Return the supply voltage. */
  return_getPowerSupplyVoltage getPowerSupplyVoltageRPC(1: i32 m) (yarp.qualifier = "const");
}
