"""The plug-ins that this process or its parents have loaded, importable as ``rtf_plugins.<kind>.<stem>``.

So objects and functions of a plug-in can be pickled, and a process that ``multiprocessing`` spawns finds them again.
``rtf.testing.plugins`` puts the folder of this package on ``sys.path`` and the plug-ins' folders into the variable.
"""

from __future__ import annotations

import os
import sys
from types import ModuleType

_FOLDERS = [entry.partition("=") for entry in os.environ.get("RTF_PLUGIN_FOLDERS", "").split(os.pathsep)]

for _kind in ("test", "fixture"):
    _package = ModuleType(f"{__name__}.{_kind}")
    _package.__path__ = [folder for kind, _, folder in _FOLDERS if kind == _kind]
    sys.modules[_package.__name__] = _package
