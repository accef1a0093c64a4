"""Tests are isolated by processes: the fork server, the process of a test, its messages, and its end."""
