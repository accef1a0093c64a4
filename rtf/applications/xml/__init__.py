"""YARP's XML files of applications: read with their places, checked against their vocabulary, written back whole.

``read_tree`` and ``to_bytes`` keep all that a file has, known or not. ``read_application`` makes of a file, and of
those that it embeds, the application that is run: variables replaced, prefixes put before ports.
"""
