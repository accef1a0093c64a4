"""Likely causes of failures: hints for the engineer who has to repair the robot."""

from __future__ import annotations

#: Causes by finding, as tests name it; those that labs have met, the likeliest first.
_CAUSES: dict[str, tuple[str, ...]] = {
    "sign": (
        "the sign of the encoder's resolution in the configuration",
        "two wires of the motor exchanged",
        "a gearbox ratio with the wrong sign",
    ),
    "ratio": (
        "a wrong gearbox ratio (an extra stage of 75/50 gives 1.5)",
        "a wrong resolution of the encoder",
        "a wrong row of the coupling matrix",
    ),
    "frozen": ("the encoder's cable", "an encoder that is not configured", "a board that no longer updates it"),
    "drift": ("a dirty encoder disk", "electrical noise on the encoder's lines", "a slipping coupling"),
    "spikes": ("a disturbed or damaged line of the encoder", "a loose connector", "a dirty disk or magnet"),
    "late encoder": ("an encoder that is read too seldom", "a filter in its board", "a loaded bus"),
    "encoder error": (
        "a magnet that is not centred, or loose",
        "an encoder that loses counts at high speed",
        "a slipping coupling, or a belt or tendon that yields",
        "a wrong resolution or ratio in the configuration",
    ),
    "sticky": ("a damaged tooth of the gearbox", "a kinked cable or tendon", "a dented or dry bearing"),
    "blocked at times": ("something loose in the gearbox", "a cable that hooks", "an obstacle that gave way"),
    "swapped encoders": ("exchanged connectors", "swapped addresses or channels of the encoders in the configuration"),
    "swapped motors": ("exchanged connectors of the motors", "swapped channels of the amplifiers in the configuration"),
    "current sensor": (
        "a broken line, or a wrong scale, of the current sensor",
        "a broken winding or a loose connector of the motor, or a weak amplifier",
        "another resistance than that in robot.toml",
    ),
    "current sign": ("exchanged lines of the current sensor", "the sign of the current in the configuration"),
    "current zero": ("a current sensor that was not calibrated", "a current sensor that drifts"),
    "uneven amplifier": ("a bad transistor of the amplifier, or its driver", "a current sensor that is not linear"),
    "weak magnets": ("magnets that have been too hot", "another torque constant than that in robot.toml"),
    "short of limit": (
        "a limit in the configuration beyond the hardware's",
        "an obstacle",
        "too little torque, or too much friction",
        "a wrong zero of the encoder",
    ),
    "wrong limit": ("a limit of another joint or of another robot in the configuration",),
    "no range": ("swapped or missing limits in the configuration",),
    "beyond limit": ("a board that does not keep its limits", "a wrong zero of the encoder"),
    "does not move": (
        "a broken motor cable",
        "a mechanical block",
        "an amplifier that is off or dead",
        "a wrong zero or scale of the encoder, so that the joint is at its stop",
        "two wires of the motor exchanged, so that it has driven the joint to its stop",
    ),
    "does not start": ("a lost command", "a board that acknowledges the command and does not execute it"),
    "weak": ("a weak motor or a low supply voltage", "more friction than usual", "gains that are too small"),
    "jitter": ("a loaded machine or network", "a board that sends late"),
    "lost": ("a loaded network", "a reader that is too slow"),
    "slow": ("a wrong period in the configuration", "messages lost on the way", "a loaded machine"),
    "duplicate": ("a sensor slower than its publisher", "messages sent twice"),
    "stamps": ("a board that stamps old readings", "a clock that is set while the robot runs"),
    "offset": ("a sensor that was not calibrated", "a sensor that was overloaded"),
    "sensor gain": ("the calibration matrix of another sensor", "a wrong full scale in the configuration"),
    "sensor axes": ("a wrong calibration matrix", "a sensor that is mounted turned", "a wrong frame in the model"),
    "noise": ("a loose cable", "electrical noise"),
    "backlash": ("play in the gearbox", "a loose cable of the transmission"),
    "camera frozen": ("a camera that has stopped", "a driver that repeats its last picture"),
    "cameras swapped": ("exchanged cables of cameras", "exchanged names in the configuration of the cameras"),
    "camera dark": ("a cap on the lens", "an exposure of zero", "a dead sensor"),
    "camera size": ("a wrong size in the configuration of the driver",),
    "orientation": ("an IMU mounted in another orientation", "a wrong frame in the model"),
    "mode late": ("a board that reads its modes in a slow loop", "a server that repeats an old state", "a loaded bus"),
    "mode": ("firmware that breaks the rules of the control modes",),
    "sensor frozen": ("a loose cable of the sensor", "a sensor that has stopped", "a driver that repeats a value"),
    "taxel": (
        "a broken trace or a short circuit of the taxel",
        "a triangle without its chip",
        "a board that repeats it",
    ),
    "taxel pressed": ("something that touches the skin", "a cover that presses on it", "a damaged layer of the skin"),
    "skin size": ("a wrong number of triangles in the configuration", "a wrong number in robot.toml"),
    "depth frozen": ("a depth sensor that has stopped", "a driver that repeats its last depth"),
    "depth scale": (
        "depths in another unit than metres",
        "a wrong scale in the configuration of the driver",
        "a wrong calibration of the depth sensor",
    ),
    "depth missing": ("something in front of the camera", "a dead projector", "wrong clip planes"),
    "intrinsics": ("parameters of another resolution", "a wrong field of view in the configuration"),
    "battery voltage": (
        "wrong voltages in robot.toml",
        "a discharged or overcharged battery",
        "a wrong calibration of its gauge",
    ),
    "battery charge": (
        "old or dead cells, with less capacity than robot.toml says",
        "a wrong calibration of the gauge's current",
        "a wrong capacity in robot.toml",
    ),
    "model": ("a description of another version of the robot", "a joint or an offset that was changed in one of them"),
    "overshoot": ("badly tuned gains", "a weak motor", "a delay in the control loop"),
    "irregular": ("stick-slip", "a loose transmission", "lost commands"),
    "stopped": (
        "a joint without torque: a broken motor cable, or a dead amplifier",
        "a wrong sign in the loop, or gains far too large",
        "a wrong sensor",
        "an obstacle",
    ),
    "blocked": (
        "a mechanical block, or an obstacle",
        "a joint without torque: a broken motor cable, or a dead amplifier",
        "two wires of the motor exchanged, or another wrong sign in the loop, that drove the joint to its stop",
        "a wrong zero or scale of the encoder, so that the joint is at its stop",
        "a frozen encoder",
    ),
    "runs away": ("gains far too large", "a wrong sign in the loop", "a wrong sensor"),
    "lost commands": ("a loaded network", "a board that drops commands"),
    "lag": ("gains that are too small", "commands or answers that are late", "a weak motor"),
    "torque dead": (
        "no torque estimates: wholeBodyDynamics does not run, or does not send them to this board",
        "a dead torque sensor",
    ),
    "torque answer": ("a wrong factor of the torque sensing", "a weak or dead motor", "a wrong model of the motor"),
    "torque gain": (
        "a wrong factor or sign of the torque sensing",
        "a wrong mass in the model",
        "a wrong zero or scale of the encoder",
    ),
    "torque offset": (
        "torque sensing that was not calibrated",
        "a load on the robot, or a contact",
        "a wrong zero or scale of the encoder",
    ),
    "impedance": ("a wrong factor of the torque sensing", "a board that computes in other units", "a weak motor"),
    "references": ("a lost command", "a board that does not report the command it was given"),
}


def likely_causes(*findings: str) -> str:
    """Return the likely causes of findings, for the end of a failure text. KeyError for an unknown finding."""
    causes = list(dict.fromkeys(cause for finding in findings for cause in _CAUSES[finding]))
    return f"likely: {'; '.join(causes)}"
