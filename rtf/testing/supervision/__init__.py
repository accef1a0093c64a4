"""Fixtures as processes of their own: their host, their generations, and their supervision."""
