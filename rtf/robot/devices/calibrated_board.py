"""Boards with a calibrator, which clients of the board may use, also through the network."""

from __future__ import annotations

from abc import abstractmethod

from rtf.robot.device import Calibrator, Device
from rtf.robot.errors import NotSupportedError
from rtf.robot.interfaces import IRemoteCalibrator


class JointCalibrator(Calibrator):
    """A calibrator that can also calibrate, home and park single joints. The calls are like those for all joints."""

    @abstractmethod
    def calibrate_joint(self, target: Device, joint: int) -> None:
        """Find the zero of a joint."""

    @abstractmethod
    def home_joint(self, target: Device, joint: int) -> None:
        """Move a joint to its home pose."""

    @abstractmethod
    def park_joint(self, target: Device, joint: int) -> None:
        """Move a joint to its parking pose."""


class Calibrated(Device, IRemoteCalibrator):
    """The calibrator methods of a board, which are passed on to the calibrator that it was given.

    Every call raises the errors of the calibrator, and NotSupportedError while there is none.
    """

    _calibrator: Calibrator | None = None

    def set_calibrator(self, calibrator: Calibrator) -> None:
        """Use this calibrator from now on."""
        self._calibrator = calibrator

    def has_calibrator(self) -> bool:
        return self._calibrator is not None

    def calibrate_joint(self, joint: int) -> None:
        self._calibrator_of_joints().calibrate_joint(self, joint)

    def calibrate_part(self) -> None:
        self._its_calibrator().calibrate(self)

    def home_joint(self, joint: int) -> None:
        self._calibrator_of_joints().home_joint(self, joint)

    def home_part(self) -> None:
        self._its_calibrator().home(self)

    def park_joint(self, joint: int) -> None:
        self._calibrator_of_joints().park_joint(self, joint)

    def park_part(self) -> None:
        self._its_calibrator().park(self)

    def quit_calibrate(self) -> None:
        self._its_calibrator().abort()

    def quit_park(self) -> None:
        self._its_calibrator().abort()

    def _its_calibrator(self) -> Calibrator:
        if self._calibrator is None:
            raise NotSupportedError(f"{self.name} has no calibrator; an action 'calibrate' of its robot gives it one")
        return self._calibrator

    def _calibrator_of_joints(self) -> JointCalibrator:
        calibrator = self._its_calibrator()
        if not isinstance(calibrator, JointCalibrator):
            raise NotSupportedError(f"{calibrator.name} ({type(calibrator).__name__}) calibrates whole parts only")
        return calibrator
