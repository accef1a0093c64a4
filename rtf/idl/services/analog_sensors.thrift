/** What describes a sensor. */
struct SensorMetadata {
  1: string name;
  /** the frame on the robot that the sensor is fixed to */
  2: string frameName;
  3: string additionalMetadata
}

/** The sensors of a device by category, in the order in which their readings are streamed. */
struct SensorRPCData {
  1: list<SensorMetadata> ThreeAxisGyroscopes; 2: list<SensorMetadata> ThreeAxisLinearAccelerometers;
  3: list<SensorMetadata> ThreeAxisMagnetometers; 4: list<SensorMetadata> OrientationSensors;
  5: list<SensorMetadata> TemperatureSensors; 6: list<SensorMetadata> SixAxisForceTorqueSensors;
  7: list<SensorMetadata> ContactLoadCellArrays; 8: list<SensorMetadata> EncoderArrays;
  9: list<SensorMetadata> SkinPatches; 10: list<SensorMetadata> PositionSensors;
  11: list<SensorMetadata> LinearVelocitySensors; 12: list<SensorMetadata> ThreeAxisAngularAccelerometers
}

/** The sensors of a device, at its port NAME/rpc:o. Up to YARP 3.10 the answer has ten categories. */
service MultipleAnalogSensorsMetadata {
  /** Return the names of all sensors. */
  SensorRPCData getMetadata()
}
