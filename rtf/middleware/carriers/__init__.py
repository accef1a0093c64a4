"""Carriers: the ways in which a message travels from one port to another."""
