"""Names: who knows which port is where. A server that keeps them, and the ways to ask one."""
