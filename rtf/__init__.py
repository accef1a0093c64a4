"""Robot Testing Framework: tests of a robot, isolated, supervised, truthful."""

__version__ = "0.1.0"
