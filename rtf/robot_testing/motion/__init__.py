"""Motion of joints in tests: parts, routines for several joints at once, recorded states, start positions."""
