"""Tests that are not Python classes of ours: Lua, the C++ framework's scripts, and programs of any language."""
