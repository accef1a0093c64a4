"""The entry point of ``testrunner``.

Nothing is imported before :func:`main`, so that an interrupt has its meaning from the first moment on.
"""

from __future__ import annotations


def main(arguments: list[str] | None = None) -> int:
    """Run ``testrunner``, or one of the commands below it; returns the exit code."""
    try:
        from rtf.cli.startup import collect_rarely

        collect_rarely()
        from rtf.cli import command_tree
    except KeyboardInterrupt:
        return 2
    return command_tree.main(command_tree.TESTRUNNER, arguments)


if __name__ == "__main__":
    import sys

    sys.exit(main())
