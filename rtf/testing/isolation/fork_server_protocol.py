"""The messages between a runner and its fork server, and the signals that stop a test and make it dump its stacks.

Requests and reports are records of fixed size on a stream socket: both ends handle some for every test. They have a
file of their own because the runner needs the words and not the fork server, which loads everything that a test needs.
"""

from __future__ import annotations

import signal
import struct

#: What the runner asks for: the kind, and for the signals and MARK_HOST a child, and the signal for it. PRELOAD is
#: followed by the names of modules in a text, with its length in bytes in the place of the child.
REQUEST = struct.Struct("=cii")
FORK, FORK_SPARE, SIGNAL, SIGNAL_GROUP, MARK_HOST, PRELOAD = b"f", b"l", b"s", b"g", b"h", b"p"
FORK_REQUEST = REQUEST.pack(FORK, 0, 0)
#: A child that nobody waits for: the report of it may come together with that of the next end or child, because each
#: report wakes the runner.
FORK_SPARE_REQUEST = REQUEST.pack(FORK_SPARE, 0, 0)

#: What the fork server tells: the kind, a process, its wait status, CPU time in seconds and largest resident size in
#: bytes. CHILD comes with the runner's ends of the child's socket and of its pipes for stdout and stderr. READY and
#: UNFIT are followed by a text, with its length in bytes in the place of the process.
REPORT = struct.Struct("=ciidq")
CHILD, EXITED, READY, UNFIT = b"c", b"x", b"r", b"u"

#: Asks a test to end, and makes any process of ours write the stacks of its threads into the fork server's dump file.
STOP_SIGNAL = signal.SIGINT
DUMP_SIGNAL = signal.SIGQUIT
#: Does nothing but wake a process that was asked to end. The interpreter does not notice a signal that comes between
#: its last look for one and the system call in which it then waits, until another comes: so who asked goes on nudging.
NUDGE_SIGNAL = signal.SIGURG
NUDGE_PERIOD = 0.1

#: Seconds in which a fixture has put right what a test left, whoever waits for it: a robot may have some way to go.
SAFE_STATE_LIMIT = 45.0
#: Seconds that all fixtures together have to come down after SIGTERM or SIGHUP, unless one declares that it needs longer.
STOP_LIMIT = 4.0
#: What a fixture's process calls itself meanwhile (at most 15 bytes), so that its fork server knows without the runner.
SAFE_STATE_NAME = "rtf parking"

#: The files of a fork server beside 0, 1 and 2. A child has its own socket on SOCKET_FD, the dump file, and no others.
SOCKET_FD = 3
DUMP_FD = 4
CONTROL_FD = 5
