"""Tests that are not Python classes of RTF: Lua, the C++ framework's scripts, and programs of any language."""
