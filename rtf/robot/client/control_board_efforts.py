"""The client of a control board: torques, impedances, currents and duty cycles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.robot.client.stub import BoardStub
from rtf.robot.extended_state import Field
from rtf.robot.interfaces import ICurrentControl, IImpedanceControl, IPWMControl, ITorqueControl

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, MotorTorqueParameters, Values


class EffortsStub(BoardStub, ITorqueControl, IImpedanceControl, ICurrentControl, IPWMControl):
    """References are streamed, so the board does not answer them; what is measured is that of the last state.

    The currents are read where those of the amplifiers are, as they are the same.
    """

    # Torques -----------------------------------------------------------------------------------------------------

    def torques(self, joints: AxisSelection = None) -> FloatArray:
        """See ITorqueControl."""
        return self._link.state.read(Field.TORQUES, joints)

    def torque_range(self, joint: int) -> tuple[float, float]:
        """See ITorqueControl."""
        low, high = self._get_of("torque_range", joint)
        return low, high

    def set_reference_torques(self, torques: Values, joints: AxisSelection = None) -> None:
        """See ITorqueControl."""
        self._stream("set_reference_torques", torques, joints)

    def reference_torques(self, joints: AxisSelection = None) -> FloatArray:
        """See ITorqueControl."""
        return self._floats("reference_torques", joints)

    def motor_torque_parameters(self, joint: int) -> MotorTorqueParameters:
        """See ITorqueControl."""
        parameters: MotorTorqueParameters = self._get_of("motor_torque_parameters", joint)
        return parameters

    def set_motor_torque_parameters(self, joint: int, parameters: MotorTorqueParameters) -> None:
        """See ITorqueControl."""
        self._set_of("set_motor_torque_parameters", joint, Bottle.adopt(self._finite(*parameters)))

    # Impedances --------------------------------------------------------------------------------------------------

    def impedance(self, joint: int) -> tuple[float, float]:
        """See IImpedanceControl."""
        stiffness, damping = self._get_of("impedance", joint)
        return stiffness, damping

    def set_impedance(self, joint: int, stiffness: float, damping: float) -> None:
        """See IImpedanceControl."""
        self._set_of("set_impedance", joint, Bottle.adopt(self._finite(stiffness, damping)))

    def impedance_offset(self, joint: int) -> float:
        """See IImpedanceControl."""
        return float(self._get_of("impedance_offset", joint))

    def set_impedance_offset(self, joint: int, offset: float) -> None:
        """See IImpedanceControl."""
        self._set_of("set_impedance_offset", joint, Bottle.adopt(self._finite(offset)))

    def impedance_limits(self, joint: int) -> tuple[float, float, float, float]:
        """See IImpedanceControl."""
        limits: tuple[float, float, float, float] = self._get_of("impedance_limits", joint)
        return limits

    # Currents ----------------------------------------------------------------------------------------------------

    def current_range(self, motor: int) -> tuple[float, float]:
        """See ICurrentControl."""
        low, high = self._get_of("current_range", motor)
        return low, high

    def set_reference_currents(self, currents: Values, motors: AxisSelection = None) -> None:
        """See ICurrentControl."""
        self._stream("set_reference_currents", currents, motors)

    def reference_currents(self, motors: AxisSelection = None) -> FloatArray:
        """See ICurrentControl."""
        return self._floats("reference_currents", motors)

    # Duty cycles -------------------------------------------------------------------------------------------------

    def set_reference_duty_cycles(self, duties: Values, motors: AxisSelection = None) -> None:
        """See IPWMControl. There is no command for several: they get one each."""
        self._stream("set_reference_duty_cycles", duties, motors)

    def reference_duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl."""
        return self._floats("reference_duty_cycles", motors)

    def duty_cycles(self, motors: AxisSelection = None) -> FloatArray:
        """See IPWMControl."""
        return self._link.state.read(Field.DUTY_CYCLES, motors)
