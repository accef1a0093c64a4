"""``rtf``: the tools of the framework under one name."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the commands below ``rtf``; returns the exit code."""
    from rtf.cli import command_tree

    return command_tree.main(command_tree.RTF, arguments)
