"""Suites: what one is, and the XML that it is read from."""
