"""Logs of programs, as YARP forwards them to ``/yarplogger``: records, forwarding, a collector and its file."""

from rtf.logs.forwarding import ForwardingHandler, forward_if_enabled, handler
from rtf.logs.record import Level, LogRecord

__all__ = ["ForwardingHandler", "Level", "LogRecord", "forward_if_enabled", "handler"]
