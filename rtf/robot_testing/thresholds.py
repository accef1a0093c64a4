"""The thresholds of tests that a robot's profile has: a layer of their parameters, over the defaults."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.robot.model import RobotModelError
from rtf.testing.inspection import try_uses
from rtf.testing.isolation.messages import Use
from rtf.testing.parameters import Given
from rtf.testing.plugins import PluginNotFoundError, find

if TYPE_CHECKING:
    from rtf.robot.model import RobotModel
    from rtf.robot.model.values import Thresholds
    from rtf.testing.case import TestCase
    from rtf.testing.plugins import PluginRef


#: In what is said of a parameter that suites have to give: no fault of the profile.
_MISSING = ": must be given ("


def thresholds_for(test: type[TestCase], robot: RobotModel, folder: str) -> list[Given]:
    """Return the values that a robot's profile has for a test, by any of its names.

    ``folder`` is that of the suite, whose tests may be meant, too. Raises RobotModelError if the profile has thresholds
    for a test that does not exist: with another name, they would be those of a test that is run.
    """
    for table in robot.thresholds.values():
        _find(table, Path(folder) if folder else None)
    names = {test.__name__, test.plugin_name, *test.aliases}
    return [
        Given(key, Bottle(value if isinstance(value, list) else [value]), f"{table.places[key]}, {table.origin}")
        for name, table in robot.thresholds.items()
        if name in names
        for key, value in table.values.items()
    ]


def wrong_thresholds(robot: RobotModel) -> list[str]:
    """Return what is wrong with a robot's thresholds, each with its place: unknown tests and parameters, wrong values.

    The tests are loaded in a process of their own.
    """
    found, uses = [], []
    use = Use(environment=f'--robotmodel "{robot.folder}/"', folder=str(Path.cwd()))
    for table in robot.thresholds.values():
        try:
            uses.append((_find(table, Path.cwd()), use))
        except RobotModelError as error:
            found.append(str(error))
    if found:
        return found  # each test would say so, too
    trials = try_uses(uses)
    return [said for one in uses for said in trials[one].problems if _MISSING not in said]


def _find(table: Thresholds, beside: Path | None) -> PluginRef:
    try:
        return find("test", table.test, beside=beside)
    except PluginNotFoundError as error:
        raise RobotModelError(f"{table.place}: thresholds: {error.args[0]}") from None
