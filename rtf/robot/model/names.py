"""The names by which programs and fixtures choose a robot model; imported by command lines, so nothing else is here."""

#: The file of a robot, and the robot of commands, suites and tests that name none.
FILE, DEFAULT_ROBOT = "robot.toml", "icub"
#: The environment variable with the name or path of the robot model; a fixture that starts a robot sets it.
ROBOT_MODEL_VARIABLE = "RTF_ROBOT_MODEL"
