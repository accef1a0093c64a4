/** A running robot interface, at the port ROBOT/yarprobotinterface. */
service yarprobotinterfaceRpc {
  /** Return the phase: startup, run, interrupt1 and so on, shutdown, or unknown. */
  string get_phase();
  /** Return the level of the phase. */
  i32 get_level();
  /** Return the name of the robot. */
  string get_robot();
  /** Return whether all devices are started. */
  bool is_ready();
  /** Stop the robot and end the program; so do the two others. */
  string quit();
  string bye();
  string exit()
}
