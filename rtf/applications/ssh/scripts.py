"""Commands for a shell at the other end of ssh: to start a program, to list what runs, to send signals, to measure.

Scripts go to ``sh`` by its standard input, so that neither the login shell nor a list of processes sees what is in
them. Each word from a file is quoted once, by :func:`shlex.quote`. They need a POSIX shell, ``setsid``, ``grep`` and
Linux's ``/proc``.

A program runs in a session of its own, whose leader is a shell with the tag in its environment, which all that the
program starts inherits. So a tag is found again without a file: by the environments of all processes. What a script
says for its sender has a ``token`` before it, which distinguishes it from what login files print.
"""

from __future__ import annotations

import errno
import os
import re
from shlex import quote
from typing import TYPE_CHECKING

from rtf.applications.run.errors import StartError
from rtf.applications.run.protocol import read_environment, split_words
from rtf.applications.run.sysinfo import SystemInfo

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.applications.run.protocol import Start

#: What is executed by the user's shell, whichever that is.
COMMAND = "exec sh -s"
#: The variable with the tag.
MARK = "RTF_RUN_SSH"
_NUMBER = re.compile(r"\d{1,12}(\.\d{1,6})?")
_KIB = 1024
_NAME = re.compile(r"[A-Za-z_][0-9A-Za-z_]*")

#: Set ``found`` to the file of the program $1 as a node does: in this folder, then on PATH; a word with a slash is one.
_LOCATE = """\
locate() {
    found=
    case $1 in */*) [ -f "$1" ] && [ -x "$1" ] && found=$1; return ;; esac
    places=.:$PATH
    while [ -n "$places" ]; do
        place=${places%%:*}
        case $places in *:*) places=${places#*:} ;; *) places= ;; esac
        if [ -f "${place:-.}/$1" ] && [ -x "${place:-.}/$1" ]; then found=${place:-.}/$1; return; fi
    done
}
"""

#: The leader of the session: descriptor 3 is the way to the sender. Signals to all do not end it before the program.
_LEADER = 'echo "$0 pid $$" >&3; exec 3>&-; trap : HUP INT TERM; (exec "$@" 2>&1); exit $?'

#: The output goes to the sender as long as there is one, and then nowhere: the program never notices.
_START = """\
say() {{ echo {token} "$1" >&2; }}
echo {token}
sh=$(command -v sh) && setsid=$(command -v setsid) || {{ say "no there is no setsid; install util-linux"; exit; }}
{directory}{{
{exports}    locate {program}
    [ -n "$found" ] || {{ say "no {missing}"; exit; }}
    {mark} "$setsid" "$sh" -c {leader} {token} "$found" {words} </dev/null 3>&2 2>/dev/null
    say "ended $?"
}} | {{ cat; cat >/dev/null; }}
"""
_GO = 'CDPATH= cd -- {directory} 2>/dev/null || {{ say "no cannot set working directory {missing}"; exit; }}\n'
_MISSING = os.strerror(errno.ENOENT)

_SIGNAL = """\
groups=
for file in $(LC_ALL=C grep -lszxF -e {mark} /proc/[0-9]*/environ); do
    read -r line 2>/dev/null <"${{file%environ}}stat" || continue
    set -- ${{line##*) }}
    case $3 in ''|*[!0-9]*) continue ;; esac
    case "$groups " in *" -$3 "*) ;; *) groups="$groups -$3" ;; esac
done
[ -n "$groups" ] || exit
echo sent
kill -s {signal} -- $groups 2>/dev/null
"""

_FIGURES = """\
read -r loads </proc/loadavg && echo "loads $loads"
grep -E '^(MemTotal|MemAvailable):' /proc/meminfo
echo "siblings $(grep -c ^processor /proc/cpuinfo)"
echo "system $(uname -m) $(uname -s) $(uname -r)"
df -Pk / | while read -r _ total _ free _; do echo "storage $total $free"; done
"""


def start_script(request: Start, token: str) -> str:
    """Return the script that starts a program, and lives as long as it. Raises StartError for what cannot be started.

    It says ``pid N`` on its standard error, or ``no REASON``, and ``ended STATUS`` afterwards. The output of the
    program is its standard output.
    """
    words = split_words(request.command)
    if not words or not request.tag:
        raise StartError("it has no command" if not words else "it has no tag")
    directory = _GO.format(directory=quote(request.directory), missing=_MISSING) if request.directory else ""
    return _LOCATE + _START.format(
        token=token,
        directory=directory,
        exports="".join(_exports(request)),
        program=quote(words[0]),
        missing=_MISSING,
        mark=f"{MARK}={quote(request.tag)}",
        leader=quote(_LEADER),
        words=" ".join(map(quote, words[1:])),
    )


def _exports(request: Start) -> Sequence[str]:
    """Return the lines that set and remove variables. Those of YARP's nodes tell a program where its output goes."""
    logged = request.log is not None
    variables: dict[str, str | None] = {"YARP_IS_YARPRUN": "1", "YARPRUN_IS_FORWARDING_LOG": str(int(logged))}
    if logged:
        variables["PYTHONUNBUFFERED"] = "1"
    variables.update(read_environment(request.environment))
    for name in variables:
        if not _NAME.fullmatch(name):
            raise StartError(f"{name!r} cannot be the name of a variable; use letters, digits and _")
    return [
        f"    unset {name}\n" if value is None else f"    export {name}={quote(value)}\n"
        for name, value in variables.items()
    ]


def list_script(token: str) -> str:
    """Return the script that lists processes by ``/proc/PID/environ:RTF_RUN_SSH=TAG``, each with a zero byte behind."""
    return f"echo {token}\nLC_ALL=C exec grep -sz '^{MARK}=' /proc/[0-9]*/environ /dev/null\n"


def read_list(output: bytes) -> dict[str, int]:
    """Return the tags that are listed, each with the lowest process id: that of the leader as long as it is there."""
    found: dict[str, int] = {}
    for entry in output.split(b"\0"):
        path, _, mark = entry.partition(b":")
        number, tag = path.removeprefix(b"/proc/").removesuffix(b"/environ"), mark.partition(b"=")[2]
        if number.isdigit() and tag:
            text = tag.decode("utf-8", "surrogateescape")
            found[text] = min(int(number[:10]), found.get(text, 1 << 31))
    return found


def signal_script(tag: str, signal: str, token: str) -> str:
    """Return the script that sends a signal to all process groups with a tag, once each; it says ``sent`` if any is."""
    return f"echo {token}\n{_SIGNAL.format(mark=quote(f'{MARK}={tag}'), signal=signal.removeprefix('SIG'))}"


def locate_script(program: str, directory: str, token: str) -> str:
    """Return the script that says where a program is; nothing if it is not there."""
    go = f"CDPATH= cd -- {quote(directory)} 2>/dev/null || exit\n" if directory else ""
    return f'echo {token}\n{go}{_LOCATE}locate {quote(program)}\necho "$found"\n'


def figures_script(token: str) -> str:
    """Return the script that says the figures of the machine, a line each."""
    return f"echo {token}\n{_FIGURES}"


def read_figures(output: bytes) -> SystemInfo:
    """Return the figures of a machine; those that it does not say are 0."""
    said: dict[str, list[str]] = {}
    for line in output.decode("utf-8", "replace").splitlines():
        name, *words = line.split() or [""]
        said[name.rstrip(":")] = words

    def number(name: str, place: int = 0) -> float:
        words = said.get(name, [])
        text = words[place] if place < len(words) else ""
        return float(text) if _NUMBER.fullmatch(text) else 0.0

    system = [*said.get("system", []), "", "", ""]
    return SystemInfo(
        memory_total=int(number("MemTotal")) // _KIB,
        memory_free=int(number("MemAvailable")) // _KIB,
        storage_total=int(number("storage")) // _KIB,
        storage_free=int(number("storage", 1)) // _KIB,
        architecture=system[0],
        siblings=int(number("siblings")),
        load_1=number("loads"),
        load_5=number("loads", 1),
        load_15=number("loads", 2),
        name=system[1],
        kernel=system[2],
    )
