"""The chains of the shipped iCub."""

from __future__ import annotations

import pytest

from rtf.robot.kinematics import ChainTables, robot_chains
from rtf.robot.model import RobotModel, load_robot


@pytest.fixture(scope="session")
def icub() -> RobotModel:
    """The iCub."""
    return load_robot("icub")


@pytest.fixture(scope="session")
def tables(icub: RobotModel) -> ChainTables:
    """Its tables."""
    return robot_chains(icub)
