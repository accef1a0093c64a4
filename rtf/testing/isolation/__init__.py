"""The process is the isolation: the fork server, the process of a test, what it says, and its end."""
