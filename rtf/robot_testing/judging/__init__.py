"""Evaluation of measurements: statistics, step responses, kinematics, likely causes. It knows no board and no port."""
