"""Calibration: of single axes by a board, and of whole parts by a calibrator behind the board."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple


class CalibrationParameters(NamedTuple):
    """The calibration of an axis: the type of procedure, its parameters, and the zero."""

    kind: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    zero: float = 0.0


class IControlCalibration(ABC):
    """Calibration by the board itself."""

    @abstractmethod
    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """Start the calibration of an axis."""

    @abstractmethod
    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        """Store the parameters of a later calibration."""

    @abstractmethod
    def calibration_done(self, joint: int) -> bool:
        """Return whether an axis is calibrated."""


class IRemoteCalibrator(ABC):
    """The calibrator of a board. The calls return when the movement is done."""

    @abstractmethod
    def has_calibrator(self) -> bool:
        """Return whether the board has a calibrator."""

    @abstractmethod
    def calibrate_joint(self, joint: int) -> None:
        """Calibrate one joint."""

    @abstractmethod
    def calibrate_part(self) -> None:
        """Calibrate all joints."""

    @abstractmethod
    def home_joint(self, joint: int) -> None:
        """Move one joint to its home pose."""

    @abstractmethod
    def home_part(self) -> None:
        """Move all joints to their home pose."""

    @abstractmethod
    def park_joint(self, joint: int) -> None:
        """Move one joint to its parking pose."""

    @abstractmethod
    def park_part(self) -> None:
        """Move all joints to their parking pose."""

    @abstractmethod
    def quit_calibrate(self) -> None:
        """Abort the calibration in progress."""

    @abstractmethod
    def quit_park(self) -> None:
        """Abort the parking in progress."""
