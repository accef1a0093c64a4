"""The tools for a network of ports, under the words that YARP's own tool has for them.

Each is a function that takes its words and returns an exit code; a module is loaded when one of its tools is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence


class Tool(NamedTuple):
    """Where a tool is, as ``module:function``, and what it does in half a line."""

    home: str
    summary: str


_HERE = "rtf.cli.network"
TOOLS = {
    "nameserver": Tool("rtf.cli.name_server:nameserver", "keep the names of a network's ports"),
    "list": Tool(f"{_HERE}.port_list:list_ports", "the ports of the network, which of them answer, what is connected"),
    "top": Tool(f"{_HERE}.top:top", "ports and connections while they work: rates, bandwidth, latency"),
    "read": Tool(f"{_HERE}.read:read", "open a port and print what comes to it"),
    "write": Tool(f"{_HERE}.write:write", "open a port and send it the lines that are typed"),
    "rpc": Tool(f"{_HERE}.rpc:rpc", "put questions to a port and print the answers"),
    "rpcserver": Tool(f"{_HERE}.rpc_server:rpcserver", "open a port and type the answers to its questions"),
    "admin": Tool(f"{_HERE}.rpc:admin", "put questions of administration to a port"),
    "connect": Tool(f"{_HERE}.connect:connect", "have a port send to another one"),
    "disconnect": Tool(f"{_HERE}.connect:disconnect", "end that again"),
    "exists": Tool(f"{_HERE}.exists:exists", "whether a port answers, or two are connected"),
    "wait": Tool(f"{_HERE}.exists:wait", "wait until a port answers, or two are connected"),
    "ping": Tool(f"{_HERE}.exists:ping", "what a port is connected to, and how fast it answers"),
    "terminate": Tool(f"{_HERE}.terminate:terminate", "ask the program of a port to end"),
    "name": Tool(f"{_HERE}.names:name", "give the name server a command"),
    "clean": Tool(f"{_HERE}.names:clean", "forget the names of ports that are gone"),
    "conf": Tool(f"{_HERE}.name_server_address:conf", "the file that says where the name server is"),
    "detect": Tool(f"{_HERE}.name_server_address:detect", "look for a name server"),
    "namespace": Tool(f"{_HERE}.name_server_address:namespace", "the name of the name server"),
    "where": Tool(f"{_HERE}.name_server_address:where", "where the name server is"),
}


def run(word: str, words: Sequence[str]) -> int:
    """Run one of ``TOOLS``; returns its exit code."""
    from importlib import import_module

    from rtf.cli.network.terminal import run_to_its_end

    module, _, function = TOOLS[word].home.partition(":")
    return run_to_its_end(word, getattr(import_module(module), function), words)
