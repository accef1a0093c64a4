"""Fixtures as processes of their own: their host, their incarnations, and who watches over them."""
