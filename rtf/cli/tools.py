"""The entry point of ``rtf``.

Nothing is imported before :func:`main`, so that an interrupt has its meaning from the first moment on.
"""

from __future__ import annotations


def main(arguments: list[str] | None = None) -> int:
    """Run one of the commands below ``rtf``; returns the exit code."""
    try:
        import atexit
        import gc

        # Imports make many objects and hardly any garbage: looking for it, at the end too, took a sixth of --help.
        gc.set_threshold(20_000)
        atexit.register(gc.freeze)
        from rtf.cli import command_tree
    except KeyboardInterrupt:
        return 2
    return command_tree.main(command_tree.RTF, arguments)
