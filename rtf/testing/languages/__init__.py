"""Tests that are not Python classes of ours: Lua, the ancestor's scripts, and programs of any language."""
