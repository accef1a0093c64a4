"""Name service: a server that stores where each port is, and the clients that query one."""
