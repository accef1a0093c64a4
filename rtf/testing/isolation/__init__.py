"""The process is the isolation: the nursery, the process of a test, what it says, and its end."""
