"""Control boards and cameras of YARP 3, whose requests are words: ``[set] [pos] 3 20.5``."""
