"""The commands ``rtf can``: look at CAN buses, record and replay them, and read and set parameters of boards."""
