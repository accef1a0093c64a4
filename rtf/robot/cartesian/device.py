"""``cartesiancontrollerserver``: the Cartesian controller as a device of a configuration, on the attached boards.

Its group ``GENERAL`` is that of the original: ``KinematicPart`` and ``KinematicType`` (``arm`` and ``left_v2.5`` are
version 2.5 of the chain ``left_arm`` in the tables of the robot), ``ControllerName`` and ``ControllerPeriod`` (ms,
default 10). The joints of the chain are found on the boards by their names, so their order there does not matter. The
solver is part of the controller, unless ``SolverNameToConnect`` names one that is a program, such as
``cartesianSolver/left_arm``. The groups ``DRIVER_i`` are read by nobody.

Of this project: ``Robot``, one of ``rtf robot list`` or a path, which has the tables (default icub), and lists of
joints: ``Inactive`` ones, which take no part in motions at first, and those that are only switched ``Together``.
``Drawn`` is a link and a place to which it is drawn, such as an elbow downwards: ``(5 (0 0 -1) (0 0 1))`` with the
weights of the axes.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property, as_string
from rtf.robot import parameters
from rtf.robot.cartesian.controller import CartesianController
from rtf.robot.cartesian.remote_solver import RemoteSolver
from rtf.robot.cartesian.server import CartesianServer
from rtf.robot.cartesian.solvers import OwnSolver, PoseSolver
from rtf.robot.devices.remapper import ControlBoardRemapper
from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import PointPreference, robot_chains
from rtf.robot.model import load_robot
from rtf.robot.network.elements import inner, number, whole
from rtf.robot.network.publishing_device import PublishingDevice
from rtf.robot.network.request_table import VERSION
from rtf.robot.network.task_server import ControlledServer

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rtf.robot.device import Device
    from rtf.robot.kinematics import Chain

_KIND = re.compile(r"(?P<side>[a-zA-Z]+)(?:_v?(?P<version>\d+(?:\.\d+)?))?")
_PERIOD = 10.0  # ms
_MILLISECOND = 1e-3
_ROBOT = "icub"


class CartesianControllerDevice(PublishingDevice):
    """The controller, and the server of its ports."""

    _chain: Chain
    _solver: PoseSolver | None = None

    def open(self, configuration: Property) -> None:
        """Read the configuration. Raises ConfigurationError, with its place."""
        general = parameters.group_of(configuration, "GENERAL")
        part, kind = (as_string(general.get(key, "")) for key in ("KinematicPart", "KinematicType"))
        found = _KIND.fullmatch(kind)
        if not part or found is None:
            key = "KinematicType" if part else "KinematicPart"
            raise parameters.wrong(general, key, "a part and its type are needed, such as arm and left_v2.5")
        side, version = found["side"], found["version"] or "1.0"
        self._type = part, kind, version if "." in version else f"{version}.0"
        self.port_name = f"/{as_string(general.get('ControllerName', f'cartController/{part}{side}')).strip('/')}"
        self.period = parameters.positive(general, "ControllerPeriod", _PERIOD) * _MILLISECOND
        robot = load_robot(as_string(general.get("Robot", _ROBOT)))
        try:
            self._chain = robot_chains(robot).chain(f"{side}_{part}", self._type[2]).limited_by(robot.axes)
            self._inactive = [self._chain.index(joint) for joint in parameters.names(general, "Inactive")]
            self._together = parameters.names(general, "Together")
            for joint in self._together:
                self._chain.index(joint)
        except RefusedError as error:
            raise parameters.wrong(general, "KinematicType", str(error)) from None
        self._drawn = read_preference(general, self._chain)
        self._solver_name = as_string(general.get("SolverNameToConnect", "")).strip("/")
        self._configuration = configuration

    def attach(self, devices: Mapping[str, Device]) -> None:
        """Find the joints on the boards, and open the ports. Raises DeviceError."""
        board = ControlBoardRemapper(self.name, network=self.network)
        board.open(Property({"axesNames": Bottle(list(self._chain.joints))}))
        board.attach(devices)
        super().attach({"the chain": board})

    def detach(self) -> None:
        super().detach()
        if self._solver is not None:
            self._solver.close()
            self._solver = None

    def _make_solver(self) -> PoseSolver:
        if not self._solver_name:
            return OwnSolver(self._drawn)
        name = f"{self.port_name}/{self._solver_name}"
        return RemoteSolver(f"/{self._solver_name}", name, network=self.network, drawn=self._drawn)

    def serve(self, device: Device) -> ControlledServer[CartesianController]:
        """Make the controller of a board, and open its ports."""
        part, kind, version = self._type
        self._solver = self._make_solver()
        controller = CartesianController(
            device,
            self._chain,
            active=[place not in self._inactive for place in range(len(self._chain))],
            together=self._together,
            solver=self._solver,
            period=self.period,
            info=[("server_version", VERSION), (f"{part}_version", version), (f"{part}_type", kind)],
        )
        server = CartesianServer(
            controller, self.port_name, network=self.network, period=self.period, outlets=self.outlets
        )
        return ControlledServer(controller, server)


def read_preference(general: Property, chain: Chain) -> PointPreference | None:
    """Return the parameter ``Drawn``; None without it. Raises ConfigurationError."""
    if not general.check("Drawn"):
        return None
    try:
        link, place, weights = inner(general.find("Drawn"), 3)
        x, y, z = (number(one) for one in inner(place, 3))
        by_x, by_y, by_z = (number(one) for one in inner(weights, 3))
        preference = PointPreference(whole(link), (x, y, z), (by_x, by_y, by_z))
        chain.jacobian([0.0] * len(chain), preference.link)
    except (RefusedError, ValueError) as error:
        raise parameters.wrong(general, "Drawn", f"a link, a place and weights are needed: {error}") from None
    return preference
