"""Core dumps of programs under test: kept on request with the files of the test, where the kernel writes files."""

from __future__ import annotations

import glob
import resource
import shutil
from pathlib import Path

_PATTERN = Path("/proc/sys/kernel/core_pattern")
_WITH_PID = Path("/proc/sys/kernel/core_uses_pid")


def allow() -> None:
    """Let this process, and the programs it becomes, write core files. In the child, before the program."""
    _, most = resource.getrlimit(resource.RLIMIT_CORE)
    resource.setrlimit(resource.RLIMIT_CORE, (most, most))


def keep(pid: int, folder: Path, since: float) -> str:
    """Move the core file of a program that crashed into a folder. Says why there is none, or nothing.

    ``since`` is when the program was started, in seconds since 1970; an older file is of another one.
    """
    pattern = _PATTERN.read_text().strip()
    if pattern.startswith("|"):
        return (
            f"no core dump is kept: the kernel hands it to {pattern[1:].split()[0]}; "
            "`sysctl kernel.core_pattern=core.%p` has it write files"
        )
    if resource.getrlimit(resource.RLIMIT_CORE)[1] == 0:
        return "no core dump is kept: the limit of this machine is 0 (ulimit -Hc)"
    found = [path for path in _candidates(pattern, pid) if path.is_file() and path.stat().st_mtime >= since - 1.0]
    if not found:
        return f"the kernel has written no core dump as {pattern} in {Path.cwd()}"
    newest = max(found, key=lambda path: path.stat().st_mtime)
    folder.mkdir(parents=True, exist_ok=True)
    shutil.move(newest, folder / f"core.{pid}")
    return ""


def _candidates(pattern: str, pid: int) -> list[Path]:
    """The files that the pattern may mean; of its variables only the process is known for sure, see core(5)."""
    name, parts = "", iter(pattern)
    for character in parts:
        variable = next(parts, "") if character == "%" else ""
        name += {"%": "%", "p": str(pid)}.get(variable, "*") if variable else glob.escape(character)
    names = [name, f"{name}.{pid}"] if _WITH_PID.read_text().strip() != "0" else [name]
    return [Path(path) for one in names for path in glob.glob(one)]  # noqa: PTH207 - the pattern may be absolute
