"""Logs of programs, as YARP forwards them to ``/yarplogger``."""
