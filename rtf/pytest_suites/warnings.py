"""The warnings of the plug-in, for people who filter them by class."""

from __future__ import annotations

import pytest


class RobotTestWarning(pytest.PytestWarning):
    """Something about robot tests that is no failure, and that somebody should know."""


class SuiteFileWarning(RobotTestWarning):
    """A suite file says something that is probably not what was meant."""


class FlakyTestWarning(RobotTestWarning):
    """A test passed, but not at the first attempt."""


class FixtureWarning(RobotTestWarning):
    """A fixture collapsed, and was brought up again."""
