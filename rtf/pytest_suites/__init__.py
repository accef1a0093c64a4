"""Suites as pytest files, their tests as pytest items. Loaded when the first suite file is collected, and not before.

``nodes`` are the files and items, ``session`` is what they share, ``conductor`` has the runner run what pytest asks
for, ``listener`` hears what came of it, and ``verdicts``, ``texts`` and ``properties`` say it the way pytest's reports
can.
"""
