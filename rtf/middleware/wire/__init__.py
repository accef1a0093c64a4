"""What travels over a connection, as pure functions and objects on bytes: no socket, no thread."""
