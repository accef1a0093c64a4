"""The entry point of ``rtf``.

Nothing is imported before :func:`main`, so that an interrupt has its meaning from the first moment on.
"""

from __future__ import annotations


def main(arguments: list[str] | None = None) -> int:
    """Run one of the commands below ``rtf``; returns the exit code."""
    try:
        from rtf.cli.startup import collect_rarely

        collect_rarely()
        from rtf.cli import command_tree
    except KeyboardInterrupt:
        return 2
    return command_tree.main(command_tree.RTF, arguments)
