"""The client of a control board: axes, and moving them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.robot.client.stub import BoardStub
from rtf.robot.interfaces import IAxisInfo, IControlLimits, IPositionControl, IPositionDirect, IVelocityControl

if TYPE_CHECKING:
    from rtf.robot.interfaces import AxisSelection, FloatArray, JointType, Values


class MotionStub(BoardStub, IAxisInfo, IPositionControl, IVelocityControl, IPositionDirect, IControlLimits):
    """Positions, velocities and limits. Errors as the interfaces say."""

    # Axes --------------------------------------------------------------------------------------------------------

    def axes(self) -> int:
        """As the board said when it was opened."""
        return self._link.axes

    def axis_name(self, joint: int) -> str:
        """See IAxisInfo."""
        return str(self._get_of("axis_name", joint))

    def joint_type(self, joint: int) -> JointType:
        """See IAxisInfo."""
        kind: JointType = self._get_of("joint_type", joint)
        return kind

    # Trajectories ------------------------------------------------------------------------------------------------

    def position_move(self, targets: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set("position_move", targets, joints)

    def relative_move(self, distances: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set("relative_move", distances, joints)

    def motion_done(self, joints: AxisSelection = None) -> bool:
        """See IPositionControl."""
        return self._flag("motion_done", joints)

    def target_positions(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionControl."""
        return self._floats("target_positions", joints)

    def set_reference_speeds(self, speeds: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set("set_reference_speeds", speeds, joints)

    def reference_speeds(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionControl."""
        return self._floats("reference_speeds", joints)

    def set_reference_accelerations(self, accelerations: Values, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._set("set_reference_accelerations", accelerations, joints)

    def reference_accelerations(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionControl."""
        return self._floats("reference_accelerations", joints)

    def stop(self, joints: AxisSelection = None) -> None:
        """See IPositionControl."""
        self._do("stop", joints)

    # Velocities and direct positions -----------------------------------------------------------------------------

    def velocity_move(self, velocities: Values, joints: AxisSelection = None) -> None:
        """See IVelocityControl. Streamed: the board does not answer."""
        self._stream("velocity_move", velocities, joints)

    def target_velocities(self, joints: AxisSelection = None) -> FloatArray:
        """See IVelocityControl."""
        return self._floats("target_velocities", joints)

    def set_positions(self, positions: Values, joints: AxisSelection = None) -> None:
        """See IPositionDirect. Streamed: the board does not answer."""
        self._stream("set_positions", positions, joints)

    def reference_positions(self, joints: AxisSelection = None) -> FloatArray:
        """See IPositionDirect."""
        return self._floats("reference_positions", joints)

    # Limits ------------------------------------------------------------------------------------------------------

    def limits(self, joint: int) -> tuple[float, float]:
        """See IControlLimits."""
        low, high = self._get_of("limits", joint)
        return low, high

    def set_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """See IControlLimits."""
        self._set_of("set_limits", joint, *self._finite(minimum, maximum))

    def velocity_limits(self, joint: int) -> tuple[float, float]:
        """See IControlLimits."""
        low, high = self._get_of("velocity_limits", joint)
        return low, high

    def set_velocity_limits(self, joint: int, minimum: float, maximum: float) -> None:
        """See IControlLimits."""
        self._set_of("set_velocity_limits", joint, *self._finite(minimum, maximum))
