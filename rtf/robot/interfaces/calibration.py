"""Calibration: of single axes by a board, and of whole parts by a calibrator that is asked through the network."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple


class CalibrationParameters(NamedTuple):
    """How an axis is calibrated: the type of procedure, its parameters, and the zero."""

    kind: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    zero: float = 0.0


class IControlCalibration(ABC):
    """Calibration as boards do it."""

    @abstractmethod
    def calibrate_axis(self, joint: int, parameters: CalibrationParameters) -> None:
        """Start to calibrate an axis."""

    @abstractmethod
    def set_calibration_parameters(self, joint: int, parameters: CalibrationParameters) -> None:
        """Keep the parameters for later."""

    @abstractmethod
    def calibration_done(self, joint: int) -> bool:
        """Whether an axis knows where it is."""


class IRemoteCalibrator(ABC):
    """A calibrator that stands behind a board. The calls return when it is done."""

    @abstractmethod
    def has_calibrator(self) -> bool:
        """Whether there is one."""

    @abstractmethod
    def calibrate_joint(self, joint: int) -> None:
        """Calibrate one joint."""

    @abstractmethod
    def calibrate_part(self) -> None:
        """Calibrate all."""

    @abstractmethod
    def home_joint(self, joint: int) -> None:
        """Bring one joint to its home pose."""

    @abstractmethod
    def home_part(self) -> None:
        """Bring all there."""

    @abstractmethod
    def park_joint(self, joint: int) -> None:
        """Bring one joint to its parking pose."""

    @abstractmethod
    def park_part(self) -> None:
        """Bring all there."""

    @abstractmethod
    def quit_calibrate(self) -> None:
        """End a calibration that is going on."""

    @abstractmethod
    def quit_park(self) -> None:
        """End a parking that is going on."""
