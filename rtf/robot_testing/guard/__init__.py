"""Safety of a robot under test: the motion guard with its limits, contacts, snapshots, and the record of motion."""
