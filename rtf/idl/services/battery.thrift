/** How a call ended: a list of [ok], or of the word of an error. In YARP 3.11 and 3.12 it is a number. */
struct ReturnValue {} (yarp.name = "yarp::dev::ReturnValue")

/** A message of the stream. */
struct BatteryData {
  /** in per cent */
  1: double charge;
  /** in V */
  2: double voltage;
  /** in A, positive while the battery is discharged */
  3: double current;
  /** in degrees Celsius */
  4: double temperature;
  /** in use, charging, low and others, as a number */
  5: i32 status = 3
}

struct return_get_BatteryInfo { 1: ReturnValue ret; 2: string info }

/**
 * A battery: the messages of its stream NAME/data:o, and its function at the port NAME/rpc:i.
 */
service IBatteryMsgs {
  /** Return a text about the battery. */
  return_get_BatteryInfo getBatteryInfoRPC()
}
